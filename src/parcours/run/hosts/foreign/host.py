"""Puts the tester into the graph of a foreign system: every bound channel passes it."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from parcours.errors import BadRequest
from parcours.filenames import file_name
from parcours.run.binding import Binding, Compiled, compile_binding
from parcours.run.binding.actions import STATUS, WIRE
from parcours.run.binding.domains import domain_of, domains, within
from parcours.run.binding.in_transit import Answered
from parcours.run.binding.message_formulas import message_type
from parcours.run.binding.slots import ProcessSlot, SlotPlan, Spoke
from parcours.run.binding.structure import BoundChannel
from parcours.run.hosts.foreign.graph import ForeignGraph, TesterClient, TesterEnd, TesterPublisher, open_graph
from parcours.run.hosts.foreign.process import KeptProcess
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.scheduling import NODE_PRIORITY
from parcours.run.recording import Raw

_CLOCK = "rosgraph_msgs/Clock"

Owner = tuple[Callable[[Spoke, bytes], None], Callable[[Spoke, bytes, Reply], None], Spoke]
"""What is called with messages and requests that come on a spoke."""


class ForeignHost:
    """The tester on the graph, and the processes that it has started; a context.

    Args:
        binding: of any transport.
        folder: for the output of the nodes; made if it is not there.
        master: of a ROS 1 master that runs; the binding's, if empty; one of the tester's own, if that is empty, too.
        is_shared: whether others may be in the network: a domain of ROS 2 that is in use is refused.

    Attributes:
        graph: once entered.
        running: slots whose process was started here and is not ended.

    Raises:
        HostFailure: there is no such ROS, no master answers at the address within 5 s, or the domain is in use.
        BadRequest: the binding does not fit the message types.
    """

    graph: ForeignGraph

    def __init__(self, binding: Binding, folder: Path, master: str = "", *, is_shared: bool = False) -> None:
        self.binding, self.folder, self._master, self._is_shared = binding, folder, master, is_shared
        self.running: dict[str, tuple[ProcessSlot, KeptProcess]] = {}
        self._owner: dict[str, Owner] = {}
        self._listeners: dict[str, TesterEnd] = {}
        self._callers: dict[str, TesterClient] = {}
        self._waiting: list[tuple[Spoke, bytes, Answered]] = []
        self._like: dict[str, str] = {}
        self._kinds: dict[str, Raw] = {}
        self._compiled: Compiled | None = None
        self._entered = time.perf_counter_ns()

    def compile(self) -> Compiled:
        """Return the binding compiled for the types that are known by now. Raises BadRequest if it does not fit."""
        if self._compiled is None:
            self._compiled = compile_binding(self.binding, self.graph.types)
        return self._compiled

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        self.graph = open_graph(self.binding, self._master)
        self.binding = self.graph.binding
        try:
            try:
                self.compile()
            except BadRequest as error:
                if self.graph.label != "ros1" or "unknown-message-type" not in str(error):
                    raise  # on ROS 1 a node may yet tell its type
            self.graph.declare(dict(self.binding.parameters))
            if self._is_shared and self.binding.starts_all:
                self.graph.require_alone()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes, and leave the graph."""
        self.stop(list(self.running))
        self.graph.close()

    def tell_time(self) -> None:
        """Say on /clock how long the tester has been here, from 1 s on: 0 means that there is no time yet."""
        made: Any = self.graph.types.create(_CLOCK)
        made.clock.sec, made.clock.nanosec = divmod(
            time.perf_counter_ns() - self._entered + 1_000_000_000, 1_000_000_000
        )
        for domain in (None, *domains(self.binding)):
            end = self.graph.publish(within("/clock", domain), _CLOCK, queue=10, latch=False)
            if end is not None:
                end.send(self.graph.types.packed(made))

    # Processes.

    def start(self, slots: list[ProcessSlot]) -> None:
        """Start the processes of slots that the tester starts, all at once; those that run already go on.

        Raises HostFailure if a command cannot be run.
        """
        fresh = [slot for slot in slots if slot.node.is_ours and slot.name not in self.running]
        for slot in fresh:
            node = slot.node
            where = {} if node.domain is None else {"ROS_DOMAIN_ID": str(node.domain)}
            env = {**os.environ, **self.graph.environment, **where, **dict(node.env)}
            log = self.folder / f"{file_name(slot.name)}.log"
            command = (*node.command, *self.graph.arguments(slot))
            priority = NODE_PRIORITY if node.realtime else 0
            process = KeptProcess(slot.name, command, node.cwd, env, log, priority=priority)
            self.running[slot.name] = slot, process
            self.graph.watch(process.descriptor, functools.partial(self._look, process))
        for slot in fresh:
            self.running[slot.name][1].await_start()

    def _look(self, process: KeptProcess) -> None:
        if process.look():
            self.graph.unwatch(process.descriptor)

    def stop(self, names: list[str], patience: float = float("inf")) -> None:
        """End processes; those that do not end when asked, within their `stop` and the patience [s], are killed."""
        ending = [self.running.pop(name) for name in names if name in self.running]
        for _, process in ending:
            process.ask_to_end()
        asked = time.monotonic()
        for slot, process in ending:
            self.graph.unwatch(process.descriptor)
            process.end(asked + min(slot.node.stop, patience) - time.monotonic())
            for node in (slot.ros_node, *(one.ros_node for one in self.binding.launched_by(slot.node))):
                if process.was_killed and node:
                    self.graph.forget(node)

    # Ends on the graph.

    def attach(self, slot_plan: SlotPlan, heard: Callable[[Spoke, bytes], None],
               asked: Callable[[Spoke, bytes, Reply], None]) -> None:  # fmt: skip
        """Listen and serve wherever the slot_plan says, and only there.

        Raises:
            HostFailure: the graph refuses.
            BadRequest: a service's type is unknown.
        """
        self.graph.renew()
        self._listeners.clear()
        self._callers.clear()
        self._waiting.clear()
        outward = [spoke for spoke in slot_plan.spokes if spoke.side == "out"]
        self._owner = {spoke.address: (heard, asked, spoke) for spoke in outward}
        self._like = {
            spoke.address: next((one.address for one in outward if set(one.channels) & set(spoke.channels)), "")
            for spoke in slot_plan.spokes
            if spoke.side == "into"
        }
        for spoke in slot_plan.spokes:
            if spoke.is_service:
                self._attach_service(spoke)
            elif spoke.side == "into":
                self.publisher(spoke)
            elif spoke.address not in self._listeners:
                hear = functools.partial(self._heard, spoke.address)
                self._listeners[spoke.address] = self.graph.subscribe(spoke.address, spoke.type, hear)
        for goal in (one for one in self.binding.channels if one.action == "goal"):
            client, server = (self.binding.process_of(end) for end in self.binding.ends(goal.name))
            near, far = domain_of(goal, client), domain_of(goal, server)
            if client is not None and all(slot.node is not server for slot in slot_plan.slots):
                self._attach_rest(goal, near, self._offer)
            elif client is not None and near != far:
                self._attach_rest(goal, near, functools.partial(self._pass_on, far=far))
        self.graph.spin(0)

    def _attach_rest(self, goal: BoundChannel, near: int | None, attach: Callable[[str, str, str], None]) -> None:
        """Stand in for what is not bound of an action that no node serves on the domain of its client.

        Clients wait until all of it is there: `attach` is given the end of each name, the name and its type.
        """
        front, base = goal.address.rpartition("/")[0], goal.type.removesuffix("_SendGoal")
        ends = set(self.binding.ends(goal.name))
        bound = {one.address for one in self.binding.channels if set(self.binding.ends(one.name)) == ends}
        for end, kind in ((end, kind.format(base)) for end, kind in (STATUS, *(one[:2] for one in WIRE.values()))):
            if f"{front}/{end}" not in bound:
                attach(end, within(f"{front}/{end}", near), kind)

    def _offer(self, end: str, address: str, kind: str) -> None:
        """Be the server of a part of an action, which knows no goal."""
        if end in ("status", "feedback"):
            self.graph.publish(address, kind, queue=1, latch=False)
        else:
            done = self.graph.types.packed(self.graph.types.create("action_msgs/CancelGoalResponse"))
            answer = done if end == "cancel_goal" else None
            self.graph.serve(address, kind, lambda data, reply: reply(answer))

    def _pass_on(self, end: str, address: str, kind: str, *, far: int | None) -> None:
        """Bring a part of an action from the domain of its server, or calls to it."""
        there = within(address.partition("@")[0], far)
        if end in ("status", "feedback"):
            publisher = self.graph.publish(address, kind, queue=1, latch=end == "status", like=there)

            def heard(data: bytes) -> None:
                if publisher is not None:
                    publisher.send(data)

            self.graph.subscribe(there, kind, heard)
        else:
            caller = self.graph.call(there, kind)
            self.graph.serve(address, kind, lambda data, reply: caller.ask(data, lambda answer, why: reply(answer)))

    def detach(self) -> None:
        """Hear nothing; calls are refused."""
        self._owner = {}
        self._waiting.clear()

    def _attach_service(self, spoke: Spoke) -> None:
        if not self.graph.knows_service(spoke.type):
            remedy = "install its package, or name the folder of its .srv file under 'interfaces'"
            rule = f"a service's type must be known, but {spoke.type} is not"
            channel = self.binding.channel(next(name for name in spoke.channels if name))
            where = f"{self.binding.source}:{channel.line}: channel {channel.name!r}"
            raise BadRequest(where, rule, remedy, slug="unknown-message-type")
        if spoke.side == "into" and spoke.address not in self._callers:
            self._callers[spoke.address] = self.graph.call(spoke.address, spoke.type)
        elif spoke.side == "out":
            self.graph.serve(spoke.address, spoke.type, functools.partial(self._asked, spoke.address))

    def _asked(self, address: str, data: bytes, reply: Reply) -> None:
        owner = self._owner.get(address)
        if owner is None:
            reply(None)
        else:
            owner[1](owner[2], data, reply)

    def _heard(self, address: str, data: bytes) -> None:
        owner = self._owner.get(address)
        if owner is not None:
            owner[0](owner[2], data)

    def publisher(self, spoke: Spoke) -> TesterPublisher | None:
        """Return where the tester publishes; None while the type is unknown."""
        channel = self.binding.channel(spoke.channels[0])
        like = self._like.get(spoke.address, "")
        return self.graph.publish(spoke.address, spoke.type, queue=channel.queue, latch=channel.latch, like=like)

    def is_connected(self, spoke: Spoke, ros_node: str) -> bool:
        """Return whether a slot's end of a spoke is there: by its name, if that is known."""
        if spoke.is_service:  # on ROS 1 clients do not register
            return spoke.side == "out" or self._callers[spoke.address].is_matched
        end = self._listeners[spoke.address] if spoke.side == "out" else self.publisher(spoke)
        peers = end.peers if end is not None else set()
        return ros_node in peers if ros_node else bool(peers)

    # What a relay asks for.

    def say(self, spoke: Spoke, data: bytes) -> int:
        """Publish; return to how many listeners it was lost."""
        publisher = self.publisher(spoke)
        return publisher.send(data) if publisher is not None else 0

    def ask(self, spoke: Spoke, data: bytes, answered: Answered) -> None:
        """Call a service; a call that comes before its server waits for it, until it is abandoned."""
        if any(one.address == spoke.address for one, _, _ in self._waiting) or not self._is_served(spoke):
            self._waiting.append((spoke, data, answered))
        else:
            self._callers[spoke.address].ask(data, answered)

    def _is_served(self, spoke: Spoke) -> bool:
        return self._callers[spoke.address].is_matched

    def ask_again(self) -> None:
        """Pass on the calls that have waited for a server, as far as it is there by now."""
        there = {spoke.address: self._is_served(spoke) for spoke, _, _ in self._waiting}
        waiting, self._waiting = self._waiting, []
        for spoke, data, answered in waiting:
            if there[spoke.address]:
                self._callers[spoke.address].ask(data, answered)
            else:
                self._waiting.append((spoke, data, answered))

    @property
    def has_waiting_calls(self) -> bool:
        """Whether a call waits for its server."""
        return bool(self._waiting)

    def abandon(self, spoke: Spoke, answered: Answered) -> None:
        """Wait no longer for a response."""
        self._waiting = [one for one in self._waiting if one[2] is not answered]
        self._callers[spoke.address].abandon(answered)

    def kind_of(self, channel: str) -> Raw:
        """Return an empty message of a channel, as recordings name it."""
        if channel not in self._kinds:
            kind = self.graph.kind(message_type(self.binding.channel(channel)))
            if kind is None:
                return Raw("*", "*", "", b"")
            self._kinds[channel] = replace(kind, content=b"")
        return self._kinds[channel]
