"""`parcours compare`: runs of a study on the same cases, with paired tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from parcours.cli.options import LOCATION, as_json, print_json


@click.command("compare")
@click.argument("folders", nargs=-1, required=True, type=LOCATION)
@as_json
def command(folders: tuple[Path, ...], as_json: bool) -> None:
    """Compare FOLDERS of runs of one study with the first of them: rates are tested on the cases that they share.

    Example: parcours compare out/lift-before out/lift-now
    """
    compare_folders(folders, as_json)


def compare_folders(folders: Sequence[Path], as_json: bool) -> None:
    """Compare runs with the first of them, on the cases that they share. Runs of
    other seeds count as separate samples. Raises BadRequest if there is one only."""
    from parcours.cli.verdicts import require_same_cases, same_seed
    from parcours.errors import BadRequest
    from parcours.report.terminal import print_table
    from parcours.study.comparing import compare_apart, compare_with_baseline, outline_of, share_cases
    from parcours.study.finding import study_of

    if len(folders) < 2:
        raise BadRequest("compare", "two folders are needed, but one is given", "name the earlier run first",
                         slug="compare-one")  # fmt: skip
    first = outline_of(study_of(folders[0]).read(folders[0]))
    documents: dict[str, object] = {}
    for folder in folders[1:]:
        now = outline_of(study_of(folder).read(folder))
        if not same_seed(folder, folders[0]) or not share_cases(now, first):
            table = compare_apart(now, first)
            heads = [one.name for one in table.columns]
            documents[str(folder)] = {"shared": 0, "rows": [dict(zip(heads, row, strict=True)) for row in table.rows]}
            if not as_json:
                click.echo(f"{folder} against {folders[0]}")
                print_table(table)
            continue
        require_same_cases(folder, folders[0])
        compared = compare_with_baseline(now, first)
        documents[str(folder)] = compared.document() if as_json else {}
        if not as_json:
            click.echo(f"{folder} against {folders[0]}")
            print_table(compared.table())
            for line in compared.lines():
                click.echo(line)
    if as_json:
        print_json(documents)
