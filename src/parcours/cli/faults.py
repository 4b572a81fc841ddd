"""`parcours faults`: RAMP under a catalogue of faults, as a table fault x outcome."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import as_json, print_json, seed, workers


@click.command("faults")
@click.option("--schedule", default="both", show_default=True, help="original, guarded or both.")
@click.option("--cases", type=click.IntRange(1, 1000), default=5, show_default=True, help="How many cases a fault.")
@click.option("--only", default="", help="Only faults whose line contains this: a channel, a component, a kind.")
@click.option("--list", "listed", is_flag=True, help="Print the catalogue and run nothing.")
@seed
@workers
@click.option("--out", type=click.Path(path_type=Path), default=None, help="Folder for faults.json and faults.html.")
@as_json
def command(
    schedule: str, cases: int, only: str, listed: bool, seed: int, workers: int, out: Path | None, as_json: bool
) -> None:
    """Strike RAMP's channels and components, one fault at a time, and see what becomes of the robot.

    A case takes about half a second to a second: both schedules with 5 cases a fault took 14 minutes on two processors.

    Example: parcours faults --schedule guarded --only Planner --cases 10 --out out/faults
    """
    import json

    from parcours.cli.progress import progress, say_if_cold
    from parcours.errors import require_known
    from parcours.report.page import to_html
    from parcours.report.terminal import print_table
    from parcours.report.writing import write_text
    from parcours.run.atomic import require_writable
    from parcours.studies.ramp_faults.catalogue import chosen
    from parcours.studies.ramp_faults.reporting import fault_document, fault_page, tables
    from parcours.studies.ramp_faults.running import run_faults

    require_known(schedule, ("original", "guarded", "both"), "schedule", slug="unknown-schedule")
    entries = chosen(only)
    if listed:
        click.echo("\n".join(map(str, entries)))
        return
    if out is not None:
        require_writable(out)
    say_if_cold()
    schedules = ("original", "guarded") if schedule == "both" else (schedule,)
    with progress() as report:
        results = run_faults(entries, schedules, seed=seed, cases=cases, workers=workers, progress=report)
    document = fault_document(results)
    if out is not None:
        write_text(out / "faults.json", json.dumps(document, indent=1) + "\n")
        write_text(out / "faults.html", to_html(fault_page(results)))
        click.echo(f"wrote {out / 'faults.json'} and {out / 'faults.html'}", err=True)
    if as_json:
        print_json(document)
        return
    for table in tables(results):
        print_table(table)
        click.echo()
