"""`parcours report`: results of campaigns as tables, HTML and JUnit."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, print_json

if TYPE_CHECKING:
    from parcours.report.pieces import Figure, Table
    from parcours.studies.ramp_components.results import ComponentResult
    from parcours.studies.ramp_system.outcome_tables import Results


@click.command("report")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--html", type=click.Path(path_type=Path), help="Write one self-contained page.")
@click.option("--junit", type=click.Path(path_type=Path), help="Write the verdicts as JUnit XML.")
@as_json
def command(folders: tuple[Path, ...], html: Path | None, junit: Path | None, as_json: bool) -> None:
    """Judge the results in one or more folders that `parcours run` wrote.

    Example: parcours report out/original out/guarded --html out/report.html --junit out/junit.xml
    """
    from parcours.report.junit import to_junit
    from parcours.report.writing import write_text
    from parcours.studies.navigation.campaigns import error_table
    from parcours.studies.ramp_components.results import FILE, component_table, read_components, timing_pieces
    from parcours.studies.ramp_system.campaigns import campaigns_page, junit_results

    components = {folder: read_components(folder) for folder in folders if (folder / FILE).exists()}
    results = load([folder for folder in folders if folder not in components])
    summarise(results, as_json, {str(folder): list(found.results) for folder, found in components.items()})
    if html is not None:
        from parcours.report.page import to_html

        tables: list[Table | Figure] = []
        for folder, found in components.items():
            where = f"{folder}, host: {found.host}"
            tables.append(component_table(found.results, f"Component cases, {where}"))
            tables += timing_pieces(found, where)
        errors = error_table(results)
        tables += [errors] if errors is not None else []
        write_text(html, to_html(campaigns_page(results, tables)))
        click.echo(f"wrote {html}", err=True)
    if junit is not None:
        verdicts = [*(r.junit() for found in components.values() for r in found.results), *junit_results(results)]
        write_text(junit, to_junit("parcours", verdicts))
        click.echo(f"wrote {junit}", err=True)


def load(folders: list[Path]) -> dict[str, Results]:
    """Return the results of system campaigns by folder."""
    from parcours.studies.navigation.campaigns import load_results

    return {str(folder): load_results(folder) for folder in folders}


def summarise(
    results: dict[str, Results], as_json: bool, components: dict[str, list[ComponentResult]] | None = None
) -> None:
    """Print the outcomes of campaigns and component studies."""
    from parcours.report.terminal import print_table
    from parcours.studies.navigation.campaigns import error_table, summary
    from parcours.studies.ramp_system.campaigns import measure_table
    from parcours.studies.ramp_system.outcome_tables import outcome_table

    components = components or {}
    if as_json:
        judged = {name: [asdict(result) for result in found] for name, found in components.items()}
        print_json({**{name: summary(result) for name, result in results.items()}, **judged})
        return
    if components:
        from parcours.studies.ramp_components.results import component_table

        for name, found in components.items():
            print_table(component_table(found, f"Component cases, {name}"))
    if results:
        print_table(outcome_table(results))
        print_table(measure_table(results))
    errors = error_table(results)
    if errors is not None:
        print_table(errors)
