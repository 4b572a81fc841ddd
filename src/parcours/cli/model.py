"""`parcours model`: what is wrong with a model file, and what it looks like."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, counted, model_file, print_json, read_model


@click.group("model")
def command() -> None:
    """Check a model file, draw its machines.

    Example: parcours model check model.yaml
    """


@command.command("check")
@model_file
@as_json
def check(file: Path, as_json: bool) -> None:
    """Report everything that is wrong or doubtful in a model; exit code 2 if there are errors.

    For another tool's file it also reports what the model cannot express.

    Example: parcours model check examples/lift/model.yaml
    """
    from parcours.model import check_file, findings
    from parcours.model.formats import format_of, read_any

    losses: tuple[object, ...] = ()
    if format_of(file) == "native":
        found = list(check_file(file).findings)
    else:
        reading = read_any(file)
        found, losses = findings(reading.cefsm, str(file)), reading.losses
    if as_json:
        print_json([dataclasses.asdict(finding) for finding in found])
    else:
        for loss in losses:
            click.echo(f"{file}: lost: {loss}")
        for finding in found:
            click.echo(str(finding))
        errors = sum(finding.severity == "error" for finding in found)
        click.echo(f"{file}: {counted(errors, 'error')}, {counted(len(found) - errors, 'warning')}")
    if any(finding.severity == "error" for finding in found):
        raise click.exceptions.Exit(2)


@command.command("show")
@model_file
@click.option("--svg", "folder", type=PATH, help="Draw each machine as an SVG file into this folder.")
def show(file: Path, folder: Path | None) -> None:
    """Draw the machines of a model: as tables, or as pictures.

    Example: parcours model show model.yaml --svg pictures
    """
    from parcours.filenames import file_name
    from parcours.model import to_svg, to_text
    from parcours.report.writing import write_text

    cefsm = read_model(file)
    click.echo(to_text(cefsm))
    if folder is not None:
        for component in cefsm.components:
            for machine in component.machines:
                path = folder / f"{file_name(f'{component.name}-{machine.name}')}.svg"
                write_text(path, to_svg(machine, f"{component.name}: {machine.name}"))
                click.echo(f"wrote {path}")
