"""`parcours falsify`: the search for a failing case over the input domains of a study."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, choice, count, print_json, seed, set_parameters


@click.command("falsify")
@click.argument("study")
@click.option("--out", type=PATH, required=True, help="Folder for the failing case, its test and a run of it.")
@count("--max-runs", "budget", default=1000, help="Most runs of a case.")
@choice("--method", "evolution", "cma-es", "random", help="How cases are chosen.")
@click.option("--cause", default="", help='Failures of this cause only: "collided", "violates keeps-away".')
@seed
@set_parameters
@as_json
def command(
    study: str, out: Path, budget: int, method: str, cause: str, seed: int, settings: tuple[str, ...], as_json: bool
) -> None:  # fmt: skip
    """Look for a failing case of STUDY, over its input domains, guided by how close each case came to failing.

    The search ends with the first failure, which is written as `parcours shrink` writes a case, or with the last run.
    The same seed makes the same search. Exit code 1 if a failure was found.

    Example: parcours falsify my_study --max-runs 2000 --out out/found

    Example: parcours shrink out/found/run 117 --out tests/found
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress
    from parcours.study.falsifying import search_and_keep

    with progress() as report:
        found = search_and_keep(
            study, settings, out.absolute(), report, seed=seed, budget=budget, method=method, cause=cause
        )
    if as_json:
        print_json(asdict(found))
    else:
        click.echo(str(found))
        for file in found.files:
            click.echo(f"wrote {file}")
    raise click.exceptions.Exit(1 if found.cause else 0)
