"""`parcours convert`: a model file of one format to a file of another, with a report of what is lost."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, print_json


@click.command("convert")
@click.argument("source", metavar="IN", type=PATH)
@click.argument("target", metavar="OUT", type=PATH)
@click.option("--from", "source_format", default="", help="Format of IN, if its suffix does not show it.")
@click.option("--to", "target_format", default="", help="Format of OUT, if its suffix does not show it.")
@as_json
def command(source: Path, target: Path, source_format: str, target_format: str, as_json: bool) -> None:
    """Write the model in IN to OUT, and report what either format cannot express.

    Formats: native (our YAML), uppaal, scxml, graphwalker, graphml, dot, aut; out also plantuml and mermaid.
    OUT is written whole or not at all; losses are not errors.

    Example: parcours convert train.xml train.yaml
    """
    from parcours.model.formats import format_of, formats, read_any, write_as
    from parcours.report.writing import write_text

    name = target_format or format_of(target)
    reading = read_any(source, source_format)
    writing = write_as(reading.cefsm, name)
    write_text(target, writing.text)
    sides = [(str(source), reading.losses), (str(target), writing.losses)]
    if as_json:
        losses = [
            {"file": file, "line": loss.line, "where": loss.where, "what": loss.what}
            for file, found in sides
            for loss in found
        ]
        print_json({"written": str(target), "format": name, "losses": losses})
        return
    for file, found in sides:
        for loss in found:
            click.echo(f"{file}: {loss}")
    count = sum(len(found) for _, found in sides)
    lost = f" ({formats()[name].title}), {count} losses" if count else ", nothing lost"
    click.echo(f"wrote {target}{lost}")
