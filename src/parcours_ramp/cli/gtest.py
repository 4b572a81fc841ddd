"""`parcours export gtest`: a suite of component cases as a program of Google Test."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH


@click.command("gtest")
@click.argument("suite", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder to write.")
@click.option("--repeats", type=click.IntRange(1, 100_000), default=60, show_default=True, help="Of each timing case.")
@click.option(
    "--warm-up", type=click.IntRange(0, 10_000), default=3, show_default=True, help="Repeats that are discarded."
)
@click.option(
    "--percent", type=float, default=95.0, show_default=True, help="Percentage of all repeats that must stay in time."
)
def command(suite: Path, out: Path, repeats: int, warm_up: int, percent: float) -> None:
    """Write a C++ program of Google Test that runs component cases against live ROS 1 nodes.

    Example: parcours export gtest suite.jsonl --out gtest
    """
    from parcours_ramp.gtest.export import Repeats, export_gtest

    done = export_gtest(suite, out, Repeats(repeats, warm_up, percent))
    click.echo(f"wrote {done.n_functional} functional and {done.n_timing} timing tests to {out}")
