"""`parcours world`: list, check and draw worlds."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import FILE, as_json, print_json


@click.group("world")
def command() -> None:
    """Worlds for planners: ready ones and your own, as files.

    Example: parcours world check doorway
    """


@command.command("list")
@as_json
def listed(as_json: bool) -> None:
    """List the worlds that ship with Parcours.

    Example: parcours world list
    """
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table
    from parcours_navigation.worlds.file import read_world, shipped

    worlds = {name: read_world(path) for name, path in shipped().items()}
    if as_json:
        print_json({name: {"doc": one.doc, "file": str(shipped()[name])} for name, one in worlds.items()})
    else:
        print_table(
            Table(
                "worlds",
                (Column("world"), Column("what it is")),
                tuple((name, one.doc) for name, one in worlds.items()),
            )
        )


@command.command("check")
@click.argument("world")
@click.option("--cases", default=20, type=click.IntRange(1, 10_000), show_default=True, help="How many cases are made.")
@click.option("--seed", default=1, type=click.IntRange(0, 2**63 - 1), show_default=True, help="Campaign seed.")
@as_json
def check(world: str, cases: int, seed: int, as_json: bool) -> None:
    """Make the first cases of WORLD, a shipped name or a file, and say what is wrong or cannot be solved.

    Exit code 1 if a case cannot be made, or the ground lets no robot through.

    Example: parcours world check doorway
    """
    from parcours.cli.progress import progress, say_if_cold
    from parcours_navigation.worlds.checking import check_world, lines

    say_if_cold()
    with progress() as show:
        found = check_world(world, cases, seed, lambda done, total: show("cases", done, total))
    if as_json:
        print_json(found.document())
    else:
        for line in lines(found):
            click.echo(line)
    if not found.passed:
        raise click.exceptions.Exit(1)


@command.command("draw")
@click.argument("world")
@click.option("--case", "number", default=0, type=click.IntRange(0, 2**53 - 1), show_default=True, help="Which case.")
@click.option("--seed", default=1, type=click.IntRange(0, 2**63 - 1), show_default=True, help="Campaign seed.")
@click.option("--svg", type=FILE, help="Write the picture there instead of to standard output.")
def draw(world: str, number: int, seed: int, svg: Path | None) -> None:
    """Draw a case of WORLD at its beginning, as SVG.

    Example: parcours world draw doorway --svg out/doorway.svg
    """
    from parcours.report.writing import write_text
    from parcours_navigation.worlds.drawing import drawing
    from parcours_navigation.worlds.file import find_world

    picture = drawing(find_world(world), seed, number)
    if svg is None:
        click.echo(picture)
    else:
        write_text(svg, picture)
        click.echo(f"wrote {svg}", err=True)
