"""`parcours report`: results of runs as tables, HTML and JUnit."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import FILE, LOCATION, as_json, baseline, fail_if, named_study


@click.command("report")
@click.argument("folders", nargs=-1, required=True, type=LOCATION)
@click.option("--html", type=FILE, help="Write one self-contained page.")
@click.option("--junit", type=FILE, help="Write the verdicts as JUnit XML.")
@named_study
@fail_if
@baseline
@as_json
def command(
    folders: tuple[Path, ...], html: Path | None, junit: Path | None, study: str, fail_if: tuple[str, ...],
    baseline: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Judge the results in one or more folders that `parcours run` wrote.

    Exit codes are those of `parcours run`: 0 if all cases passed, 1 if one failed, 3 if some are inconclusive and
    none failed.

    Example: parcours report out/lift-before out/lift --html out/report.html --junit out/junit.xml
    """
    from parcours.cli.verdicts import conclude, tell
    from parcours.run.locations import location
    from parcours.study.finding import read_all
    from parcours.study.gate import parse_condition
    from parcours.study.reproducing import noted

    conditions = [parse_condition(text) for text in fail_if]
    families = read_all(folders, study)
    tell(families, as_json)
    again = {folder: found for folder in map(str, folders) if (found := noted(location(folder))) is not None}
    for folder, one in again.items():
        click.echo(f"{folder}: {one}", err=as_json)
    if html is not None:
        from parcours.report.page import to_html
        from parcours.report.writing import write_text
        from parcours.study.reporting import report_page

        write_text(html, to_html(report_page(families)))
        click.echo(f"wrote {html}", err=True)
    conclude(families, conditions, baseline, junit)
