"""Waits until the processes of a slot plan are ready, or says what is missing, with its line."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from parcours.errors import HostFailure
from parcours.model.finding import Finding
from parcours.run.binding import structure
from parcours.run.binding.domains import parted, within
from parcours.run.binding.graph import RegisteredGraph, graph_findings
from parcours.run.binding.in_transit import ServiceCall
from parcours.run.binding.relay import Relay
from parcours.run.binding.slots import ProcessSlot, SlotPlan, Spoke
from parcours.run.binding.structure import ReadyWhen
from parcours.run.hosts.foreign.host import ForeignHost

_EARLIEST, _LOOK, _SAME = 1_500_000_000, 200_000_000, 1_000_000_000
"""A graph that has not changed for `_SAME` counts as complete; when, and how often, it is looked at [ns]."""

_AT_WORK = 0.3
"""Nodes that still load what they need use, or wait for, more of a processor than this; complete ones sleep."""

_UNSEEN = ("node-twice", "qos-mismatch", "bridged-twice", "clock-twice")
"""What may be wrong although every node, for itself, is ready."""


class Readiness:
    """What is still waited for, of the slots that have been started."""

    def __init__(self, host: ForeignHost, slot_plan: SlotPlan, relay: Relay, now: Callable[[], int]) -> None:
        self._host, self._seating, self._relay, self._now = host, slot_plan, relay, now
        self._began: dict[str, int] = {}
        self._waiting: dict[str, list[ReadyWhen]] = {}
        self._looked, self._changed, self._state = 0, 0, RegisteredGraph()
        self._demands: dict[str, int] = {}
        self._asked: dict[ServiceCall, int] = {}
        self._progressed = 0  # when a node was begun, or was seen to have more of what it needs

    def begin(self, slots: Iterable[ProcessSlot]) -> None:
        """Wait for these, too, from now on."""
        self._changed = self._progressed = self._now()
        for slot in slots:
            self._began[slot.name], self._waiting[slot.name] = self._now(), list(slot.node.ready)

    def startable(self) -> list[ProcessSlot]:
        """Return the slots that are not started, whose predecessors are ready."""
        there = {slot.node.name for slot in self._seating.slots}
        done = there - {slot.node.name for slot in self._seating.slots if self._is_pending(slot)}
        return [
            slot for slot in self._seating.slots
            if slot.name not in self._began and set(slot.node.after) & there <= done
        ]  # fmt: skip

    def looks(self) -> bool:
        """Return whether all is there of what has been started.

        Raises HostFailure if something is not, in its time, or will not be; the message lists what is missing.
        """
        begun = [slot for slot in self._seating.slots if slot.name in self._began]
        for slot in begun:
            waiting = [one for one in self._waiting[slot.name] if not self._holds(slot, one)]
            if waiting != self._waiting[slot.name]:
                self._waiting[slot.name], self._progressed = waiting, self._now()
        pending = [slot for slot in begun if self._is_pending(slot)]
        if not pending:
            # A receiver is ready while its sender is not there yet: whether the two connect is only known now.
            wrong = [one for one in self.findings() if one.rule in _UNSEEN]
            if wrong and len(begun) == len(self._seating.slots):
                raise HostFailure(wrong[0].where, wrong[0].message, wrong[0].remedy, slug=wrong[0].rule)
            return True
        now = self._now()
        late = [
            (slot, one) for slot in pending for one in self._waiting[slot.name]
            if now - self._began[slot.name] > one.timeout * 1e9
        ]  # fmt: skip
        if late or self._has_settled(begun):
            raise self.complaint(late)
        return False

    def _has_settled(self, begun: list[ProcessSlot]) -> bool:
        """Whether nodes that have the usual time to start have registered what they will, and something is missing."""
        now = self._now()
        if now - max(self._began.values()) < _EARLIEST or now - self._looked < _LOOK:
            return False
        elapsed, self._looked = now - self._looked, now
        if len(begun) < len(self._seating.slots) or any(
            one.kind != "bound" or one.timeout != structure.START for slot in begun for one in slot.node.ready
        ):
            return False
        state, running = self._host.graph.state(), self._host.running
        demands = {name: process.demand() for name, (_, process) in running.items()}
        is_busy = any(process.is_wanting() for _, process in running.values()) or any(
            demand - self._demands.get(name, 0) > _AT_WORK * elapsed for name, demand in demands.items()
        )
        known = {
            within(who, parted(name)[1])
            for table in (state.publishers, state.subscribers, state.servers)
            for name, all_ in table.items()
            for who in all_
        }
        are_there = all(slot.graph_name in known for slot in begun if slot.ros_node)
        if state != self._state or is_busy or not are_there:  # one may not even be discovered
            self._changed = now
        self._state, self._demands = state, demands
        return now - self._changed > _SAME and bool(self.findings())

    def _holds(self, slot: ProcessSlot, one: ReadyWhen) -> bool:
        host = self._host
        match one.kind:
            case "bound":
                if slot.ros_node and not slot.node.components:  # nothing is bound to it
                    return host.graph.answers(slot.graph_name)
                is_stack = host.binding.stack is not None  # whose channels are those of all nodes together
                wanted = "" if is_stack else slot.name
                spokes = [
                    spoke for spoke in self._seating.spokes if spoke.slot == wanted or self._overhears(spoke, slot)
                ]
                return all(host.is_connected(spoke, "" if is_stack else slot.ros_node) for spoke in spokes)
            case "after":
                return self._now() - self._began[slot.name] >= float(one.value) * 1e9
            case "parameter":
                is_own = one.name.rpartition("/")[0] == slot.ros_node  # another domain may have a node of that name
                name = within(one.name, slot.node.domain) if is_own else one.name
                return bool(host.graph.parameter(name) == one.value)
            case "life":
                return host.graph.lead(slot.graph_name, str(one.value))
            case "node":
                return host.graph.answers(within(one.name, slot.node.domain))
            case "message":
                return any(one.name == host.binding.channel(event.channel).address for event in self._relay.events
                           if event.kind == "send")  # fmt: skip
        state = host.graph.state()
        tables = (state.servers,) if one.kind == "service" else (state.publishers, state.subscribers)
        return any(table.get(within(one.name, slot.node.domain)) for table in tables)

    def _is_pending(self, slot: ProcessSlot) -> bool:
        """Whether a slot is waited for: not once it waits for an answer itself, and none has come for long.

        Such a node has not all that it needs, since it goes on only then: it is waited for again once it is answered.
        Time counts from when another node was ready, which may be about to answer.
        """
        now = self._now()
        asked = [call for call in self._relay.calls if call.client == slot.name]
        awaits = [now - max(self._asked.setdefault(call, now), self._progressed) > _EARLIEST for call in asked]
        waiting = self._waiting.get(slot.name)
        if waiting is None:  # it is not begun
            return True
        return bool(waiting) and not (any(awaits) and all(one.kind == "bound" for one in waiting))

    def _overhears(self, spoke: Spoke, slot: ProcessSlot) -> bool:
        """Whether the tester overhears there, in an abstract case, what a slot sends."""
        senders = {self._host.binding.ends(channel)[0] for channel in spoke.channels if spoke.overheard}
        return not spoke.slot and not senders.isdisjoint(slot.node.components)

    def complaint(self, late: list[tuple[ProcessSlot, ReadyWhen]]) -> HostFailure:
        """Return what is missing by now; `late` is what has not come in its time."""
        where = self._host.binding.source or self._host.binding.name
        absent = [(slot, one) for slot, one in late if slot.ros_node and not self._host.graph.answers(slot.graph_name)]
        found = self.findings()
        if found and not absent:
            if len(found) == 1:
                return HostFailure(found[0].where, found[0].message, found[0].remedy, slug=found[0].rule)
            listed = "".join(f"\n  {one}" for one in found) + "\n "
            rule = f"the running system must have what is bound, but {len(found)} things are wrong:{listed}"
            return HostFailure(where, rule, "correct them from the first on", slug=found[0].rule)
        named = absent or late
        names = ", ".join(dict.fromkeys(f"{slot.name} ({_said(one)})" for slot, one in named))
        slot, one = named[0]
        process = self._host.running.get(slot.name)
        said = process[1].tail() if process else []
        why = "; ".join(self._host.graph.refusals[:3]) or (
            f"its last lines: {' | '.join(said)}" if said else "it says nothing"
        )
        if absent:
            lives = f"; its process lives and has worked for {process[1].effort() * 1e-9:.1f} s" if process else ""
            why = f"the graph knows no {slot.graph_name}{lives}; {why}"
        rule = f"must be ready within {one.timeout:g} s, but is not: {why}"
        remedy = "give it a longer 'timeout' if it starts slowly; see 'ready' and 'ros_node'"
        return HostFailure(f"{where}:{one.line}: node {names}", rule, remedy, slug="foreign-ready")

    def findings(self) -> list[Finding]:
        """Return what the graph lacks, or has with another type, by now."""
        binding = self._host.binding
        services = {one.address for one in self._seating.spokes} | {one.address for one in binding.channels}
        return graph_findings(binding, self._host.graph.state(services), self._seating)


def _said(one: ReadyWhen) -> str:
    return "all that is bound to it" if one.kind == "bound" else f"{one.kind} {one.name or one.value}"
