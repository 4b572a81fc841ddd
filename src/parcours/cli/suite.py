"""`parcours suite`: the executable cases of a study as a file."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import seed


@click.command("suite")
@click.argument("study")
@click.option(
    "--cases", type=click.IntRange(1, 10_000_000), default=None, help="How many; by default what the criterion needs."
)
@seed
@click.option("--out", type=click.Path(path_type=Path), required=True, help="File to write (JSON Lines).")
def command(study: str, cases: int | None, seed: int, out: Path) -> None:
    """Write the cases of a study: stable ids, values in SI units, time budgets.

    Example: parcours suite ramp_system --cases 27 --out suite.jsonl
    """
    from parcours.studies import suite_of
    from parcours.suite import write_suite

    click.echo(f"wrote {write_suite(out, suite_of(study, seed=seed, n_cases=cases))} cases to {out}")
