"""Compares a binding with message types and nodes, soon: what only cases need is loaded where cases run."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from typing import cast

from parcours.errors import BadRequest
from parcours.run.binding import Binding, compile_binding
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.graph import types_of
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.trace import TraceEvent
from parcours_navigation.foreign.isolation import ProcessOrder, run_apart
from parcours_navigation.foreign.quiescence import proposals


def is_own(binding: Binding, master: object, network: object) -> bool:
    """Return whether master and nodes run in a network of their own: one that the user starts is never there."""
    return binding.starts_all and not master and not binding.master and network == "own"


def check_types(binding: Binding, *, others: bool = False) -> None:
    """Compare a binding with its message types.

    Args:
        binding: checked.
        others: whether types may be unknown, since a node may yet tell them.

    Raises:
        BadRequest: a place or a formula does not fit its type, or a type is not known.
        HostFailure: there is no such ROS.
    """
    try:
        compile_binding(binding, types_of(binding))
    except BadRequest as error:
        if not others or binding.transport != "ros1" or "unknown-message-type" not in str(error):
            raise


def check_nodes(binding: Binding, master: str, network: str) -> list[str]:
    """Start the nodes of a binding once, compare what they register with it, and return what it should say otherwise.

    Raises:
        HostFailure: a node does not start, or something bound is missing or of another type.
    """
    with tempfile.TemporaryDirectory(prefix="parcours-") as folder:
        own = is_own(binding, master, network)
        [result] = run_apart(ProcessOrder(binding.source, folder, own, master, only_check=True))
    return [str(one) for one in cast(list[object], result["proposals"])]


def check_live(host: ForeignHost) -> list[str]:
    """Start the nodes once, compare what they register with the binding, and let them drive for a moment.

    Returns:
        what to change in the binding so that nobody's usual silence counts as one.

    Raises:
        HostFailure: a node does not start, or something bound is missing or of another type.
    """
    listeners: list[Callable[[TraceEvent], None]] = []

    def tell(event: TraceEvent) -> None:
        for listener in listeners:
            listener(event)

    session = Session(host, whole(host.binding), listener=tell)
    try:
        session.start()
        if session.readiness.findings():
            raise session.readiness.complaint([])
        if host.binding.system is None:
            return []
        from parcours_navigation.foreign.running import dry_run

        dry_run(session, listeners)
        return proposals(host.binding, [one for one in session.relay.events if one.time >= session.case_began])
    finally:
        session.end()
