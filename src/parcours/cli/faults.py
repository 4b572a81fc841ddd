"""`parcours faults STUDY`: a study under a catalogue of faults, as a table fault x outcome."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, count, print_json, seed, set_parameters, workers


@click.command("faults")
@click.argument("study")
@set_parameters
@count("--cases", default=5, most=1000, help="How many cases per fault.")
@click.option("--only", default="", help="Only faults whose line contains this: a channel, a component, a kind.")
@click.option("--list", "listed", is_flag=True, help="Print the catalogue and run nothing.")
@seed
@workers
@click.option("--out", type=PATH, help="Folder for faults.json and faults.html.")
@as_json
def command(
    study: str, settings: tuple[str, ...], cases: int, only: str, listed: bool, seed: int, workers: int,
    out: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Inject one fault at a time into a study's channels and components, and see how its cases end.

    Example: parcours faults examples/lift --only Door --cases 10 --out out/faults
    """
    import json

    from parcours.cli.progress import progress, say_if_cold
    from parcours.errors import BadRequest
    from parcours.report.page import to_html
    from parcours.report.terminal import print_table
    from parcours.report.writing import write_text
    from parcours.run.atomic import require_writable
    from parcours.study.finding import find
    from parcours.study.parameters import pairs_of, settings_of
    from parcours.study.protocol import FaultRequest, Strikeable

    found = find(study)
    if not isinstance(found, Strikeable):
        rule = f"{found.name} has no channels or components that could be struck"
        raise BadRequest(study, rule, "faults are for component studies and live systems", slug="faults-study")
    pairs = pairs_of(settings)
    chosen = settings_of(found.parameters, pairs, found.name)
    request = FaultRequest(chosen, frozenset(pairs), seed, cases, only, workers, listed)
    if out is not None:
        require_writable(out)
    if not listed and getattr(found, "compiles", False):
        say_if_cold()
    with progress() as report:
        struck = found.faults(request, report)
    if listed:
        click.echo("\n".join(struck.catalogue))
        return
    if out is not None and struck.page is not None:
        write_text(out / "faults.json", json.dumps(struck.document, indent=1) + "\n")
        write_text(out / "faults.html", to_html(struck.page))
        click.echo(f"wrote {out / 'faults.json'} and {out / 'faults.html'}", err=True)
    if as_json:
        print_json(struck.document)
        return
    for table in struck.tables:
        print_table(table)
        click.echo()
