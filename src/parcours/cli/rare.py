"""`parcours rare`: how rarely the cases of a study fail."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, count, print_json, seed, set_parameters, workers


@click.command("rare")
@click.argument("study")
@count("--max-runs", "budget", default=100_000, least=1000, help="Most runs of a case.")
@count("--repeats", default=10, least=3, most=1000, help="How many estimates share the runs; the interval is theirs.")
@click.option(
    "--max-probability", type=click.FloatRange(0.0, 1.0, min_open=True), metavar="P",
    help="Exit 1 unless the upper end of the interval is below it.",
)  # fmt: skip
@click.option("--out", type=PATH, help="Folder for a case that fails, its test and a run of it.")
@seed
@set_parameters
@workers
@as_json
def command(
    study: str, budget: int, repeats: int, max_probability: float | None, out: Path | None, seed: int,
    settings: tuple[str, ...], workers: int, as_json: bool,
) -> None:  # fmt: skip
    """Estimate how likely a case of STUDY fails, where a campaign would need millions of cases to see it once.

    Cases are split: those nearest to failing are copied and moved, level by level. The interval is at 95 %. The same
    seed gives the same answer with any number of workers.

    Example: parcours rare my_study --max-runs 300000

    Example: parcours rare navigation --set planner=mine:drive --max-probability 1e-4
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress
    from parcours.study.splitting import estimate_and_keep

    with progress() as report:
        found = estimate_and_keep(
            study, settings, out and out.absolute(), report, seed=seed, budget=budget, repeats=repeats, workers=workers
        )
    if as_json:
        print_json({**asdict(found), "reached": found.reached})
    else:
        click.echo(str(found))
        for file in found.files:
            click.echo(f"wrote {file}")
    raise click.exceptions.Exit(1 if max_probability is not None and not found.high < max_probability else 0)
