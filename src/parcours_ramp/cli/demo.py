"""`parcours demo`: the whole study of the paper, as one report."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, seed, workers
from parcours.cli.renaming import formerly


@formerly({"--delayed": "--delayed-cases"})
@click.command("demo", short_help="The whole study of the paper, as one report.")
@click.option(
    "--cases", type=click.IntRange(1, 1_000_000), default=905, show_default=True, help="System cases per schedule."
)
@click.option(
    "--delayed-cases", "delayed", type=click.IntRange(1, 1_000_000), show_default="300, or --cases if fewer",
    help="Cases per point of the curves over added delays.",
)  # fmt: skip
@seed
@workers
@click.option("--out", type=PATH, default=Path("out/demo"), show_default=True, help="Folder to write.")
def command(cases: int, delayed: int | None, seed: int, workers: int, out: Path) -> None:
    """Run the paper's whole study, from the model to system campaigns, and write one report on it.

    Example: parcours demo --cases 905 --seed 1 --out out/demo
    """
    from parcours.cli.progress import progress, say_if_cold
    from parcours.report.junit import to_junit
    from parcours.report.page import to_html
    from parcours.report.terminal import print_page
    from parcours.report.writing import write_text
    from parcours.run.atomic import require_writable
    from parcours.run.campaign import Interrupted
    from parcours.study.components.results import component_results, write_components
    from parcours_navigation.study.campaigns import junit_results
    from parcours_ramp.paper.report import compose
    from parcours_ramp.paper.results import run_paper

    require_writable(out)
    say_if_cold()
    try:
        with progress() as report:
            results = run_paper(out, cases=cases, seed=seed, workers=workers, delayed=delayed, progress=report)
    except Interrupted as stopped:
        click.echo(str(stopped), err=True)
        raise click.exceptions.Exit(130) from None
    page = compose(results)
    system = {f"{protocol}-{schedule}": r for (protocol, schedule), r in results.system.items()}
    components = component_results("here", results.functional, results.timing)
    write_components(out, components)
    verdicts = [*(result.junit() for result in components.results), *junit_results(system)]
    write_text(out / "junit.xml", to_junit("demo", verdicts))
    write_text(out / "report.html", to_html(page))
    print_page(page)
    click.echo(f"\nreport: {out / 'report.html'}\nverdicts: {out / 'junit.xml'}")
