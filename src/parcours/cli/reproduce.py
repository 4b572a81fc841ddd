"""`parcours reproduce`: the failing cases of a campaign, run again and compared to the byte."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import LOCATION, as_json, named_study, print_json, workers


@click.command("reproduce")
@click.argument("folder", type=LOCATION)
@workers
@named_study
@as_json
def command(folder: Path, workers: int, study: str, as_json: bool) -> None:
    """Run every failing case of the campaign in FOLDER again, even if it was made elsewhere.

    Says how many give the same facts, equal to the byte, and notes it in the folder, for `parcours report`. Exit
    code 0 if all do, 1 if some do not.

    Example: parcours reproduce out/now
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress
    from parcours.errors import BadRequest
    from parcours.study.reproducing import note, reproduce

    with progress() as report:
        found = reproduce(folder.absolute(), report, given=study, workers=workers)
    try:
        note(folder, found)
    except BadRequest as error:
        click.echo(f"not noted: {error}", err=True)
    if as_json:
        print_json(asdict(found))
    else:
        click.echo(f"{folder}: {found}")
    for line in found.changed:
        click.echo(f"what it depends on has changed: {line}", err=True)
    if found.equal != found.failing:
        raise click.exceptions.Exit(1)
