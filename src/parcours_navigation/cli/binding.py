"""`parcours binding check`: what is wrong with a binding file, before a study is made of it."""

from __future__ import annotations

import shlex
from pathlib import Path, PurePosixPath
from typing import Literal

import click


@click.group("binding", short_help="Check or draft a binding file: foreign nodes as a system under test.")
def command() -> None:
    """Check and draft bindings: which foreign nodes a study of kind `ros` runs (docs/bindings.md)."""


@command.command("check")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--live", is_flag=True, help="Start the nodes, too, compare what they register, and measure silences.")
@click.option("--master", default="", metavar="URI", help="A ROS 1 master that runs; else one of its own.")
@click.option("--network", type=click.Choice(["own", "shared"]), default="own", show_default=True,
              help="Whether its own master and the nodes are isolated from the network.")  # fmt: skip
def check(file: Path, live: bool, master: str, network: str) -> None:
    """Check a binding: its form, its model, message types; with --live the running system. Exit 2 if it is wrong.

    Example: parcours binding check examples/ros1_python/binding.yaml --live
    """
    from parcours.errors import HostFailure
    from parcours.run.binding import check_binding, read_binding
    from parcours_navigation.foreign.checking import check_nodes, check_types

    binding = read_binding(file)
    for finding in check_binding(file.read_text(encoding="utf-8"), str(file))[1]:
        click.echo(str(finding), err=True)
    whose = "a navigation stack" if binding.stack else repr(binding.model.name)
    where = f"{file}: {len(binding.nodes)} nodes, {len(binding.channels)} channels of {whose}"
    if live:
        for proposal in check_nodes(binding, master, network):
            click.echo(f"note: {proposal}", err=True)
        click.echo(f"{where}: the running system has all that is bound")
        return
    try:
        check_types(binding)
    except HostFailure as error:
        click.echo(f"message types were not checked: {error}", err=True)
    click.echo(f"{where}: fine")


@command.command("new")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--from-graph", is_flag=True, required=True, help="Look at the nodes that run.")
@click.option("--transport", type=click.Choice(["ros1", "ros2"]), help="Which ROS; else that of this interpreter.")
@click.option("--master", default="", metavar="URI", help="Of ROS 1; else $ROS_MASTER_URI.")
@click.option("--interfaces", multiple=True, type=click.Path(path_type=Path, exists=True, file_okay=False),
              help="A folder with definitions of types that are not installed; may be repeated.")  # fmt: skip
def new(
    folder: Path, from_graph: bool, transport: Literal["ros1", "ros2"] | None, master: str, interfaces: tuple[Path, ...]
) -> None:
    """Write a first binding of the nodes that run, the skeleton of their model, and a study into FOLDER.

    Nodes become components, topics, services and actions channels. Nothing is overwritten.

    Example: parcours binding new mine --from-graph
    """
    from parcours.run.binding.drafting import draft
    from parcours.run.hosts.foreign.introspection import address, graph_that_runs, transport_here
    from parcours.study.copying import study_name, write_new

    kind = transport or transport_here()
    uri = address(master) if kind == "ros1" else ""
    name = study_name(folder)
    places = [one.resolve() for one in interfaces]
    drafted = draft(*graph_that_runs(kind, uri, places), kind, name, uri, list(map(str, places)))
    study = f"parcours: study/1\nname: {name}\nkind: ros\n"
    texts = {"model.yaml": drafted.model, "binding.yaml": drafted.binding, "study.yaml": study}
    write_new(folder, {PurePosixPath(file): text.encode() for file, text in texts.items()}, frozenset())
    for note in drafted.notes:
        click.echo(f"note: {note}", err=True)
    for file in texts:
        click.echo(f"wrote {folder / file}")
    click.echo(f"Next:\n  parcours binding check {shlex.quote(str(folder / 'binding.yaml'))} --live")
