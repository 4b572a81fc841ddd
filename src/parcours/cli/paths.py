"""`parcours paths`: internal test paths of a model."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import as_json, model_file, print_json


@click.command("paths")
@model_file
@click.option("--criterion", default="edge", show_default=True, help="node, edge or edge-pair.")
@as_json
def command(file: Path, criterion: str, as_json: bool) -> None:
    """Print the internal test paths of each component.

    Example: parcours paths model.yaml --criterion edge
    """
    from parcours.model import read_model
    from parcours.paths import internal_paths
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    found = [path for paths in internal_paths(read_model(file), criterion).values() for path in paths]
    if as_json:
        print_json(
            [{"name": p.name, "component": p.component, "machine": p.machine, "transitions": p.ids} for p in found]
        )
        return
    rows = tuple((p.component, p.name, " ".join(p.ids), len(p.ids)) for p in found)
    columns = (Column("component"), Column("path"), Column("transitions"), Column("length"))
    print_table(Table(f"Internal test paths, {criterion} coverage", columns, rows))
