"""`parcours binding`: systems of others through a binding file: checked, run, judged again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, print_json, seed

if TYPE_CHECKING:
    from parcours.run.binding import Binding
    from parcours_navigation.foreign.results import Result

_file = click.argument("file", type=click.Path(path_type=Path))
_master = click.option("--master", default="", metavar="URI", help="A ROS 1 master that runs; else one of its own.")
_network = click.option("--network", type=click.Choice(["own", "shared"]), default="own", show_default=True,
                        help="Whether its own master and the nodes are out of reach of everybody.")  # fmt: skip


@click.group("binding")
def command() -> None:
    """Test nodes that know nothing of Parcours, through a binding file (docs/bindings.md)."""


def _enter_network(file: Path, master: str, network: str) -> None:
    """Enter a network of its own, unless there is a master to join: first of all, before anything starts threads."""
    import contextlib
    import re

    text = ""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        text = file.read_text(encoding="utf-8")
    if network == "own" and not master and not re.search(r"(?m)^master\s*:", text):
        from parcours.run.hosts.isolation import enter_own_network

        enter_own_network()


@command.command("check")
@_file
@click.option("--live", is_flag=True, help="Start the nodes, too, and compare what they register.")
@_master
@_network
def check(file: Path, live: bool, master: str, network: str) -> None:
    """Check a binding: its form, its model, message types; with --live the running system. Exit 2 if it is wrong.

    Example: parcours binding check examples/ros1_python/binding.yaml --live
    """
    if live:
        _enter_network(file, master, network)
    from parcours.run.binding import check_binding, read_binding

    binding = read_binding(file)
    for finding in check_binding(file.read_text(encoding="utf-8"), str(file))[1]:
        click.echo(str(finding), err=True)
    where = f"{file}: {len(binding.nodes)} nodes, {len(binding.channels)} channels of {binding.model.name!r}"
    if live:
        _check_live(binding, master)
        click.echo(f"{where}: the running system has all that is bound")
        return
    _check_types(binding)
    click.echo(f"{where}: fine")


def _check_types(binding: Binding) -> None:
    from parcours.errors import HostFailure
    from parcours.run.binding import MessageTypes, compile_binding

    if binding.transport != "ros1":
        return
    from parcours.run.hosts.ros1.foreign_types import ForeignTypes

    try:
        types = ForeignTypes(binding.python_paths, binding.interfaces)
    except HostFailure as error:
        click.echo(f"message types were not checked: {error}", err=True)
        return
    compile_binding(binding, MessageTypes(types.find))


def _check_live(binding: Binding, master: str) -> None:
    import tempfile

    from parcours.run.binding.slots import whole
    from parcours.run.hosts.ros1.foreign import ForeignHost
    from parcours.run.hosts.ros1.foreign_session import Session

    with tempfile.TemporaryDirectory(prefix="parcours-") as folder, ForeignHost(binding, Path(folder), master) as host:
        session = Session(host, whole(binding))
        try:
            session.start()
            if session.readiness.findings():
                raise session.readiness.complaint([])
        finally:
            session.end()


@command.command("run")
@_file
@click.option("--cases", type=click.IntRange(0, 1_000_000), help="So many abstract cases.  [default: each once]")
@click.option("--case", "case", default="", metavar="ID", help="Only this abstract case.")
@click.option("--system", type=click.IntRange(0, 100_000), default=0, show_default=True, help="System cases.")
@click.option("--protocol", type=click.Choice(["table-vii", "published", "empty"]), default="table-vii",
              show_default=True, help="How obstacles move in system cases.")  # fmt: skip
@click.option("--repeats", type=click.IntRange(0, 1_000_000), default=0, show_default=True,
              help="Of each span that `timing` bounds.")  # fmt: skip
@click.option("--faults", "faults", default="", metavar="TEXT", help="A plan of faults, or a file (docs/faults.md).")
@click.option("--record", type=click.Choice(["mcap", "bag"]), help="Record each case.")
@_master
@_network
@seed
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for results.")
@as_json
def run(
    file: Path, cases: int | None, case: str, system: int, protocol: str, repeats: int, faults: str,
    record: str | None, master: str, network: str, seed: int, out: Path, as_json: bool,
) -> None:  # fmt: skip
    """Run abstract cases, system cases and timing on the nodes of a binding. Exit 0 if all pass, 1 if one fails,
    3 if some are inconclusive and none fails.

    Results are kept case by case: Ctrl-C keeps what is finished. Without --master, master and nodes run in a network of
    their own, out of reach of everybody.

    Example: parcours binding run examples/ros1_python/binding.yaml --system 2 --record mcap --out out/small
    """
    _enter_network(file, master, network)
    from parcours.run.binding import read_binding
    from parcours.run.faults import FaultPlan
    from parcours.run.faults.text import read_plan

    binding = read_binding(file)
    from parcours.report.terminal import print_table
    from parcours.run.atomic import require_writable
    from parcours.run.hosts.ros1.foreign import ForeignHost
    from parcours_navigation.foreign.reporting import Folder, tables
    from parcours_navigation.foreign.results import Wanted
    from parcours_navigation.foreign.running import ForeignStudy

    require_writable(out)
    plan = read_plan(faults) if faults else FaultPlan(0)
    wanted = Wanted(cases, case, system, repeats, plan, record or "", seed, protocol)
    results: list[Result] = []
    folder, interrupted = Folder(out), False
    with ForeignHost(binding, out / "nodes", master) as host:
        study = ForeignStudy(host, wanted, out)
        try:
            for result in study.run():
                results.append(result)
                folder.add(result)
                verdict = result.judged.judgement.verdict
                why = "" if verdict == "pass" else f": {result.judged.judgement.why}"
                click.echo(f"{result.id}: {verdict}{why}", err=as_json)
        except KeyboardInterrupt:
            interrupted = True
    folder.close(binding, results)
    if as_json:
        print_json([result.document() for result in results])
    else:
        for table in tables(results):
            print_table(table)
        click.echo(f"results in {out}")
    if interrupted:
        raise click.exceptions.Exit(130)
    verdicts = {str(result.judged.judgement.verdict) for result in results}
    if verdicts & {"fail", "error"}:
        raise click.exceptions.Exit(1)
    if verdicts != {"pass"}:  # what could not be judged, or no case at all, is no pass
        raise click.exceptions.Exit(3)


@command.command("judge")
@_file
@click.argument("recordings", nargs=-1, required=True, type=click.Path(path_type=Path))
def judge(file: Path, recordings: tuple[Path, ...]) -> None:
    """Judge recordings of `binding run` again; exit 1 if a verdict differs from the recorded one.

    Example: parcours binding judge examples/ros1_python/binding.yaml out/small/recordings/*.mcap
    """
    from parcours.run.binding import read_binding
    from parcours_navigation.foreign.recorded import rejudge

    binding, differ = read_binding(file), 0
    for path in recordings:
        judged, recorded = rejudge(path, binding)
        verdict = judged.judgement.verdict
        differ += str(verdict) != recorded
        told = "" if str(verdict) == recorded else f" (recorded: {recorded or 'none'})"
        click.echo(f"{path}: {verdict}{told}: {judged.judgement.why}")
    if differ:
        raise click.exceptions.Exit(1)
