"""`parcours suite`: the executable cases of a study as a file."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import seed, set_parameters


@click.command("suite")
@click.argument("study")
@click.option(
    "--cases", type=click.IntRange(1, 10_000_000), default=None, help="How many; by default what the criterion needs."
)
@set_parameters
@seed
@click.option("--out", type=click.Path(path_type=Path), required=True, help="File to write (JSON Lines).")
def command(study: str, cases: int | None, settings: tuple[str, ...], seed: int, out: Path) -> None:
    """Write the cases of a study: stable ids, values in SI units, time budgets.

    Example: parcours suite ramp_system --cases 27 --out suite.jsonl

    Example: parcours suite examples/lift --out suite.jsonl
    """
    from parcours.study.finding import find
    from parcours.study.parameters import settings_from
    from parcours.suite import write_suite

    found = find(study)
    written = write_suite(out, found.suite(settings_from(found.parameters, settings, found.name), seed, cases))
    click.echo(f"wrote {written} cases to {out}")
