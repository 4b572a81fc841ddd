"""`parcours binding check`: what is wrong with a binding file, before a study is made of it."""

from __future__ import annotations

from pathlib import Path

import click


@click.group("binding", short_help="Check a binding file: foreign nodes as a system under test.")
def command() -> None:
    """Check bindings: which nodes that know nothing of Parcours a study of kind `ros` runs (docs/bindings.md)."""


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
    from parcours_navigation.foreign.door import check_nodes, check_types

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
