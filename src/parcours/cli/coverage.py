"""`parcours coverage`: what campaigns have not tested yet."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import LOCATION, PATH, as_json, count, named_study, print_json, print_rows


@click.command("coverage")
@click.argument("folders", nargs=-1, required=True, type=LOCATION)
@count("--show", default=10, least=0, help="How much of what is missing to name, of each kind.")
@count("--strength", default=2, least=1, help="How many blocks at most are looked for together.")
@click.option("--html", type=PATH, metavar="FILE", help="Write it as a page, drawn.")
@named_study
@as_json
def command(folders: tuple[Path, ...], show: int, strength: int, html: Path | None, study: str, as_json: bool) -> None:
    """Say what the campaigns in FOLDERS cover together, and what is missing.

    It counts blocks of test data, alone, in pairs and t-wise; start vectors, alone and with these; verdicts, outcomes
    and bands of the least clearance that were seen; transitions of the model that were taken, and pairs of them;
    data oracles that were asked; requirements that were kept and violated, rules that decided a case.

    Example: parcours coverage out/monday out/tuesday --html out/coverage.html
    """
    from dataclasses import asdict

    from parcours.study.covering import coverage, coverage_page
    from parcours.study.finding import study_of

    goals = coverage({str(folder): study_of(folder, study).read(folder) for folder in folders}, strength)
    if html is not None:
        from parcours.report.page import to_html
        from parcours.report.writing import write_text

        write_text(html, to_html(coverage_page(goals, tuple(map(str, folders)))))
        click.echo(f"wrote {html}", err=True)
    if as_json:
        print_json([asdict(goal) for goal in goals])
        return
    rows = [(goal.name, goal.held, goal.wanted, goal.held / max(goal.wanted, 1)) for goal in goals]
    print_rows("Coverage", ("of", ("covered", ",d"), ("wanted", ",d"), ("share", ".1%")), rows)
    for goal in goals:
        if goal.missing and show:
            left = goal.wanted - goal.held - show
            more = f", and {left} more" if left > 0 else ""
            click.echo(f"missing, {goal.name}: {'; '.join(goal.missing[:show])}{more}")
