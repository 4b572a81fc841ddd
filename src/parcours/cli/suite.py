"""`parcours suite`: the executable cases of a study as a file."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, count, seed, set_parameters


@click.command("suite")
@click.argument("study")
@count("--cases", most=10_000_000, help="How many; by default what the criterion needs.")
@set_parameters
@seed
@click.option("--out", type=PATH, required=True, help="File to write (JSON Lines).")
def command(study: str, cases: int | None, settings: tuple[str, ...], seed: int, out: Path) -> None:
    """Write the cases of a study: stable ids, values in SI units, time budgets.

    Example: parcours suite examples/lift --cases 27 --out suite.jsonl
    """
    from parcours.study.finding import find
    from parcours.study.parameters import pairs_of, settings_of
    from parcours.suite import write_suite

    found = find(study)
    chosen = settings_of(found.parameters, pairs_of(settings), found.name)
    written = write_suite(out, found.suite(chosen, seed, cases))
    click.echo(f"wrote {written} cases to {out}")
