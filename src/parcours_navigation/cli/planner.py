"""`parcours planner check`: tell a planner's author what is wrong."""

from __future__ import annotations

import click

from parcours.cli.options import as_json, print_json
from parcours.cli.renaming import formerly


@click.group("planner")
def command() -> None:
    """Check a planner of your own for mistakes.

    Example: parcours planner check package.module:Planner
    """


@formerly({"--patience": "--timeout"})
@command.command("check")
@click.argument("planner")
@click.option("--only", "only", multiple=True, metavar="CHECK", help="Make only this check; may be repeated.")
@click.option(
    "--world", default="", help="Show it the kind and the limits of this world's robot: a shipped name or a file."
)
@click.option("--list", "listed", is_flag=True, help="List the checks, and make none.")
@click.option("--timeout", "patience", type=click.FloatRange(0.1, 86400.0), default=120.0, show_default=True,
              help="Longest time for one check [s].")  # fmt: skip
@as_json
def check(planner: str, only: tuple[str, ...], world: str, listed: bool, patience: float, as_json: bool) -> None:
    """Put PLANNER into small situations, and say what is wrong and what to do. Exit code 1 if there is an error.

    PLANNER is a shipped name, package.module:Name, or path/to/file.py:Name.

    Example: parcours planner check orca
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress, say_if_cold
    from parcours.report.terminal import print_table
    from parcours_navigation.checking.battery import check_apart, checks_table, report_lines

    if listed:
        table = checks_table()
        if as_json:
            print_json({str(name): words for name, words in table.rows})
        else:
            print_table(table)
        return
    say_if_cold()
    with progress() as show:
        report = check_apart(
            planner, only or None, world=world, patience=patience, progress=lambda _, n, all: show("checks", n, all)
        )
    if as_json:
        findings = [asdict(finding) for finding in report.findings]
        print_json({"planner": report.planner, "passed": report.passed, "findings": findings, "made": report.made,
                    "left": report.left})  # fmt: skip
    else:
        click.echo(report_lines(report))
    if not report.passed:
        raise click.exceptions.Exit(1)
