"""`parcours export`: a suite as a test script of another tool."""

from __future__ import annotations

import os
from pathlib import Path

import click


@click.group("export")
def command() -> None:
    """Write a suite as a test script of another tool.

    Example: parcours export pytest suite.jsonl --out test_suite.py
    """


@command.command("pytest")
@click.argument("suite", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Python file to write: test_*.py.")
@click.option("--schedule", default="", help="original or guarded (ramp_system).")
@click.option("--refer", is_flag=True, help="Let the script read the suite file, and check it, instead of holding it.")
def export_pytest(suite: Path, out: Path, schedule: str, refer: bool) -> None:
    """Write one test a case, its id naming the abstract case and the row; a failure explains itself.

    Example: parcours export pytest suite.jsonl --out test_suite.py
    """
    from parcours.report.writing import write_text
    from parcours.studies.judging import check_schedule
    from parcours.suite import read_suite
    from parcours.suite.exporting import checksum, to_pytest

    cases = list(read_suite(suite))
    for study in dict.fromkeys(case.study for case in cases):
        check_schedule(study, schedule)
    place = Path(os.path.relpath(suite.resolve(), out.resolve().parent)).as_posix() if refer else ""
    text = to_pytest(cases, out.name, schedule=schedule, suite=place, sha256=checksum(suite) if refer else "")
    write_text(out, text)
    click.echo(f"wrote {len(cases)} tests to {out}")
