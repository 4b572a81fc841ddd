"""`parcours export`: a suite as a test script of another tool."""

from __future__ import annotations

import os
from pathlib import Path

import click

from parcours.cli.extending import Extensible
from parcours.cli.options import PATH, set_parameters


@click.group("export", cls=Extensible)
def command() -> None:
    """Write a suite as a test script of another tool.

    Example: parcours export pytest suite.jsonl --out test_suite.py
    """


@command.command("pytest")
@click.argument("suite", type=PATH)
@click.option("--out", type=PATH, required=True, help="Python file to write: test_*.py.")
@click.option("--study", default="", metavar="STUDY", help="Where the study is, if it is not a registered one.")
@set_parameters
@click.option("--refer", is_flag=True, help="Let the script read the suite file, and check it, instead of holding it.")
def export_pytest(suite: Path, out: Path, study: str, settings: tuple[str, ...], refer: bool) -> None:
    """Write one test per case, its id naming the abstract case and the row; a failure explains itself.

    Example: parcours export pytest suite.jsonl --out test_suite.py

    Example: parcours export pytest suite.jsonl --study examples/lift --set repeats=20 --out test_lift.py
    """
    from parcours.report.writing import write_text
    from parcours.study.finding import find
    from parcours.study.parameters import pairs_of, settings_of
    from parcours.suite import read_suite
    from parcours.suite.exporting import checksum, to_pytest

    cases = list(read_suite(suite))
    given: dict[str, object] = {}
    for name in dict.fromkeys(case.study for case in cases):
        found = find(study or name)
        pairs = pairs_of(settings)
        checked = settings_of(found.parameters, pairs, found.name)
        given = {key: checked[key] for key in pairs}
    beside = out.resolve().parent
    where = study
    if study and Path(study).exists():
        where = "./" + Path(os.path.relpath(Path(study).resolve(), beside)).as_posix()
    place = Path(os.path.relpath(suite.resolve(), beside)).as_posix() if refer else ""
    text = to_pytest(cases, out.name, study=where, settings=given, suite=place, sha256=checksum(suite) if refer else "")
    write_text(out, text)
    click.echo(f"wrote {len(cases)} tests to {out}")
