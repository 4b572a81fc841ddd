"""`parcours nodes`: the nodes of a study on a running ROS 1 graph, for testers of other tools."""

from __future__ import annotations

import click

from parcours.cli.renaming import formerly


@formerly({"--resident": "--program"})
@click.command("nodes", short_help="RAMP's nodes on a ROS 1 graph, for testers of other tools.")
@click.argument("study", type=click.Choice(["ramp_components"]))
@click.option("--master", envvar="ROS_MASTER_URI", default="http://127.0.0.1:11311", show_default=True,
              help="http://host:port; ROS_MASTER_URI by default.")  # fmt: skip
@click.option("--program", default="", help="module:callable of what runs in the nodes, instead of RAMP's components.")
def command(study: str, master: str, program: str) -> None:
    """Start the nodes of a study; they serve one tester after another, until Ctrl-C.

    Example: parcours nodes ramp_components --master http://127.0.0.1:11311
    """
    import contextlib
    import signal

    from parcours_ramp.gtest.persistent_nodes import NODE_PROGRAM, StandingNodes

    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's background jobs inherit that Ctrl-C is ignored
        signal.signal(number, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt), StandingNodes(master, program or NODE_PROGRAM, click.echo) as nodes:
        click.echo(f"nodes wait for a tester at {master}; Ctrl-C ends them")
        nodes.stay()
