"""`parcours coverage`: what campaigns have not tested yet."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import LOCATION, as_json, count, named_study, print_json, print_rows


@click.command("coverage")
@click.argument("folders", nargs=-1, required=True, type=LOCATION)
@count("--show", default=10, least=0, help="How much of what is missing to name, of each kind.")
@named_study
@as_json
def command(folders: tuple[Path, ...], show: int, study: str, as_json: bool) -> None:
    """Say what the campaigns in FOLDERS cover together, and what is missing.

    It counts blocks of test data, alone and in pairs; start vectors, alone and with each block; verdicts and outcomes
    that were seen.

    Example: parcours coverage out/monday out/tuesday
    """
    from dataclasses import asdict

    from parcours.study.covering import coverage
    from parcours.study.finding import study_of

    goals = coverage({str(folder): study_of(folder, study).read(folder) for folder in folders})
    if as_json:
        print_json([asdict(goal) for goal in goals])
        return
    rows = [(goal.name, goal.held, goal.wanted, goal.held / max(goal.wanted, 1)) for goal in goals]
    print_rows("Coverage", ("of", ("covered", ",d"), ("wanted", ",d"), ("share", ".1%")), rows)
    for goal in goals:
        if goal.missing and show:
            left = goal.wanted - goal.held - show
            more = f", and {left} more" if left > 0 else ""
            click.echo(f"missing, {goal.name}: {'; '.join(goal.missing[:show])}{more}")
