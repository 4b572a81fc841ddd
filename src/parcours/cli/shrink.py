"""`parcours shrink`: a failing case made small, and kept as a test."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, count, named_study, print_json
from parcours.cli.renaming import formerly


@formerly({"--runs": "--max-runs"})
@click.command("shrink")
@click.argument("folder", type=PATH)
@click.argument("case")
@click.option("--out", type=PATH, required=True, help="Folder for the small case, its test and a run of it.")
@count("--max-runs", "runs", default=199, help="Most runs of a case.")
@named_study
@as_json
def command(folder: Path, case: str, out: Path, runs: int, study: str, as_json: bool) -> None:
    """Make a failing CASE of the campaign in FOLDER small: few things that move, a short time, round numbers.

    The small case fails for the same cause. It is written as a file, with a pytest file that fails as long as the
    case does, and with a run of it for `parcours replay`. The same case gives the same files.

    Example: parcours shrink out/now 17 --out tests/case-17

    Example: pytest tests/case-17 && parcours replay tests/case-17/run 17
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress
    from parcours.study.shrinking import shrink

    with progress() as report:
        found = shrink(folder.absolute(), case, out.absolute(), report, given=study, budget=runs)
    if as_json:
        print_json(asdict(found))
        return
    click.echo(str(found))
    for file in found.files:
        click.echo(f"wrote {file}")
