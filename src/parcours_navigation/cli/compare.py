"""`parcours compare`: planners, or runs of any study, on the same cases, with paired tests."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import FILE, PATH, as_json, count, print_json, seed, workers
from parcours.cli.renaming import formerly


@formerly({"--measured": "--scored-cases", "--timed": "--timed-cases"})
@click.command("compare", short_help="Planners or runs on the same cases, with paired tests.")
@click.argument("planners", nargs=-1, required=True)
@count("--cases", default=1000, most=100_000_000, help="How many, the same for all.")
@click.option("--protocol", default="table-vii", show_default=True, help="table-vii or published.")
@click.option("--command-delay", type=click.FloatRange(0.0, 10.0), default=0.0, show_default=True,
              help="Delay from an answer to the robot [s], in steps of 0.01 s. Planners with published computing times "
              "keep them.")  # fmt: skip
@count("--scored-cases", "measured", default=200, least=0,
       help="How many of the first cases are run again, to be scored as the code of published benchmarks "
       "does.")  # fmt: skip
@count("--timed-cases", "timed", default=3, least=0, help="In how many of the first cases decisions are timed.")
@click.option("--require", multiple=True, help="What must hold of every case: 'keeps-away: always clearance > 0.05'; "
              "may be repeated.")  # fmt: skip
@click.option("--fail", multiple=True, help="A case fails if this holds: 'travelled > 4 or time > 30'.")
@click.option("--measure", multiple=True, help="A measure of your own: 'crowding: mine.py:crowding', or a formula over "
              "the values of a case; may be repeated.")  # fmt: skip
@seed
@workers
@click.option("--world", default="", metavar="NAME|FILE",
              help="A shipped world or a .yaml file, instead of the paper's arena.")  # fmt: skip
@click.option("--out", type=PATH, default=Path("out/compare"), show_default=True,
              help="Folder for the campaigns; resumed if it holds some.")  # fmt: skip
@click.option("--html", type=FILE, help="Write one self-contained page.")
@click.option("--markdown", is_flag=True, help="Print the tables of results as Markdown, and nothing else.")
@as_json
def command(
    planners: tuple[str, ...], cases: int, protocol: str, command_delay: float, world: str, measured: int, timed: int,
    require: tuple[str, ...], fail: tuple[str, ...], measure: tuple[str, ...], seed: int, workers: int, out: Path,
    html: Path | None, markdown: bool, as_json: bool,
) -> None:  # fmt: skip
    """Run PLANNERS on the same cases, and test each against the first, or compare existing folders of results.

    The folders must belong to one study: their cases are paired by their ids, rates are tested on the pairs, and cases
    whose verdict changed are listed. A planner is a known name, package.module:Name, or path/to/file.py:Name. Planners
    with published computing times keep them; the others answer instantly unless --command-delay is given.

    Example: parcours compare orca dwa mppi --cases 10000 --html out/compare.html

    Example: parcours compare out/lift-before out/lift-now
    """
    from parcours.run.locations import location

    folders = [location(one) for one in planners]
    if all(one.is_dir() for one in folders):
        from parcours.cli.compare import compare_folders

        compare_folders(folders, as_json)
        return
    from parcours.cli.progress import progress, say_if_cold
    from parcours.errors import BadRequest
    from parcours.report.page import to_html
    from parcours.report.terminal import print_page
    from parcours.report.writing import write_text
    from parcours.run.campaign import Interrupted
    from parcours_navigation.comparison.analysis import analyse
    from parcours_navigation.comparison.document import comparison_document
    from parcours_navigation.comparison.page import compare_page
    from parcours_navigation.comparison.running import run_comparison
    from parcours_navigation.comparison.tables import to_markdown_page
    from parcours_navigation.requirements.requirement import read_requirements

    if markdown and as_json:
        rule = "either --json or --markdown can be printed, but both are asked for"
        raise BadRequest("compare", rule, slug="compare-both")
    say_if_cold()
    try:
        with progress() as show:
            results = run_comparison(
                planners, out.absolute(), n_cases=cases, seed=seed, workers=workers, world=world, protocol=protocol,  # type: ignore[arg-type]
                command_delay=command_delay, measured=measured, timed=timed,
                requirements=read_requirements("\n".join(require), "\n".join(fail), "\n".join(measure)), progress=show,
            )  # fmt: skip
    except Interrupted as stopped:
        click.echo(str(stopped), err=True)
        raise click.exceptions.Exit(130) from None
    found = analyse(results)
    page = compare_page(found)
    if html is not None:
        write_text(html, to_html(page))
        click.echo(f"wrote {html}", err=True)
    if as_json:
        print_json(comparison_document(found))
    elif markdown:
        click.echo(to_markdown_page(found))
    else:
        print_page(page)
