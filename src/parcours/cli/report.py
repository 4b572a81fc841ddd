"""`parcours report`: results of campaigns as tables, HTML and JUnit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, print_json

if TYPE_CHECKING:
    from parcours.studies.paper.results import SystemResults


@click.command("report")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--html", type=click.Path(path_type=Path), help="Write one self-contained page.")
@click.option("--junit", type=click.Path(path_type=Path), help="Write the verdicts as JUnit XML.")
@as_json
def command(folders: tuple[Path, ...], html: Path | None, junit: Path | None, as_json: bool) -> None:
    """Judge the results in one or more campaign folders.

    Example: parcours report out/original out/guarded --html out/report.html --junit out/junit.xml
    """
    results = summarise(list(folders), as_json)
    if html is not None:
        from parcours.report.page import to_html
        from parcours.report.writing import write_text
        from parcours.studies.paper.campaigns import campaigns_page

        write_text(html, to_html(campaigns_page(results)))
        click.echo(f"wrote {html}", err=True)
    if junit is not None:
        from parcours.report.junit import to_junit
        from parcours.report.writing import write_text
        from parcours.studies.paper.campaigns import junit_results

        write_text(junit, to_junit("ramp_system", junit_results(results)))
        click.echo(f"wrote {junit}", err=True)


def summarise(folders: list[Path], as_json: bool) -> dict[str, SystemResults]:
    """Print the outcomes of the campaigns, and return their results by folder."""
    from parcours.report.terminal import print_table
    from parcours.studies.paper.campaigns import load_campaign, outcome_table, summary

    results = {str(folder): load_campaign(folder) for folder in folders}
    if as_json:
        print_json({name: summary(result) for name, result in results.items()})
    else:
        print_table(outcome_table(results))
    return results
