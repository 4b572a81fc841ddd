"""Puts the tester into the graph of a foreign ROS 1 system: every bound channel passes it."""

from __future__ import annotations

import contextlib
import functools
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

from parcours.errors import BadRequest
from parcours.filenames import file_name
from parcours.run.binding import Binding, Compiled, MessageTypes, compile_binding
from parcours.run.binding.passing import Answered
from parcours.run.binding.readings import message_type
from parcours.run.binding.slots import Slot, SlotPlan, Spoke
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.interfaces import TESTER
from parcours.run.hosts.ros1.client import Client
from parcours.run.hosts.ros1.ends import ANY, Caller, Kind, Publisher
from parcours.run.hosts.ros1.foreign_master import MasterEnd, plain_value
from parcours.run.hosts.ros1.foreign_types import ForeignTypes
from parcours.run.hosts.ros1.graph import LOOPBACK
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.process import KeptProcess

_MASTER = 3.0
"""How long a master that runs already may take to answer [s]."""

_LANES = 64
"""How many calls of a foreign service may be open at once."""

Owner = tuple[Callable[[Spoke, bytes], None], Callable[[Spoke, bytes, Reply], None], Spoke]
"""What is called with messages and requests that come on a spoke."""


class ForeignHost:
    """The tester on the graph, and the processes that it has started; a context.

    Args:
        binding: of transport ros1.
        folder: for the output of the nodes; made if it is not there.
        master: of a ROS 1 master that runs; the binding's, if empty; one of the tester's own, if that is empty, too.

    Attributes:
        refusals: connections that were declined, or could not be made, and why.
        running: slots whose process was started here and is not ended.

    Raises:
        HostFailure: there is no ROS 1, or no master answers at the address within 5 s.
        BadRequest: the binding does not fit the message types, or is for another transport.
    """

    def __init__(self, binding: Binding, folder: Path, master: str = "") -> None:
        if binding.transport != "ros1":
            rule = f"is for the transport {binding.transport!r}, but this host is ROS 1"
            raise BadRequest(binding.source or binding.name, rule, slug="foreign-transport")
        self.binding, self.folder = binding, folder
        self.types = ForeignTypes(binding.python_paths, binding.interfaces)
        self._uri = master or binding.master
        self.refusals: list[str] = []
        self.running: dict[str, tuple[Slot, KeptProcess]] = {}
        self._callers: dict[str, Caller] = {}
        self._owner: dict[str, Owner] = {}
        self._kinds: dict[str, tuple[str, str, str]] = {}
        self._compiled: Compiled | None = None
        self._closing = contextlib.ExitStack()
        try:
            self.compile()
        except BadRequest as error:
            if "unknown-message-type" not in str(error):  # a node may yet tell its type
                raise

    def compile(self) -> Compiled:
        """Return the binding compiled for the types that are known by now. Raises BadRequest if it does not fit."""
        if self._compiled is None:
            self._compiled = compile_binding(self.binding, MessageTypes(self.types.find))
        return self._compiled

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        if self._uri:
            require_master(self._uri, _MASTER)
            self.environment = {"ROS_MASTER_URI": self._uri, "ROS_IP": LOOPBACK, "ROS_HOSTNAME": LOOPBACK}
        else:
            own = self._closing.enter_context(Master())
            self._uri, self.environment = own.uri, own.environment
        try:
            self.middle = Client(TESTER, self._uri, self._refused)
            self._closing.callback(self.middle.close)
            self.master = MasterEnd(TESTER, self._uri)
            self.master.set_parameters({name: plain_value(value) for name, value in self.binding.parameters})
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes, leave the graph, and stop the master if it is the tester's own."""
        self.stop(list(self.running))
        self._closing.close()

    def _refused(self, text: str) -> None:
        if text not in self.refusals:
            self.refusals.append(text)

    # Processes.

    def start(self, slots: list[Slot]) -> None:
        """Start the processes of slots that the tester starts, all at once; those that run already go on.

        Raises HostFailure if a command cannot be run.
        """
        self.stop([name for name, (_, process) in self.running.items() if not process.is_alive])
        fresh = [slot for slot in slots if slot.node.is_ours and slot.name not in self.running]
        for slot in fresh:
            self.master.copy_parameters(slot.node.ros_node, slot.ros_node)
        for slot in fresh:
            node = slot.node
            env = {**os.environ, **self.environment, **dict(node.env)}
            log = self.folder / f"{file_name(slot.name)}.log"
            process = KeptProcess(slot.name, (*node.command, *slot.arguments), node.cwd, env, log)
            self.running[slot.name] = slot, process
            self.middle.watch(process.descriptor, functools.partial(self._look, process))
        for slot in fresh:
            self.running[slot.name][1].await_start()

    def _look(self, process: KeptProcess) -> None:
        if process.look():
            self.middle.unwatch(process.descriptor)

    def stop(self, names: list[str], patience: float = float("inf")) -> None:
        """End processes; those that do not end when asked, within their `stop` and the patience [s], are killed."""
        ending = [self.running.pop(name) for name in names if name in self.running]
        for _, process in ending:
            process.ask_to_end()
        asked = time.monotonic()
        for slot, process in ending:
            self.middle.unwatch(process.descriptor)
            process.end(asked + min(slot.node.stop, patience) - time.monotonic())
            if process.was_killed and slot.ros_node:
                self.master.forget(slot.ros_node)

    # Ends on the graph; made once for each name, for all runs.

    def attach(self, slot_plan: SlotPlan, heard: Callable[[Spoke, bytes], None],
               asked: Callable[[Spoke, bytes, Reply], None]) -> None:  # fmt: skip
        """Listen and serve wherever the slot_plan says, and only there.

        Raises:
            HostFailure: the master refuses.
            BadRequest: a service's type is unknown.
        """
        self._owner = {spoke.address: (heard, asked, spoke) for spoke in slot_plan.spokes if spoke.side == "out"}
        for publisher in self.middle.publishers.values():
            publisher.forget_last()
        for spoke in slot_plan.spokes:
            if spoke.is_service:
                self._attach_service(spoke)
            elif spoke.side == "into":
                self.publisher(spoke)
            elif spoke.address not in self.middle.subscribers:
                kind = self.types.kind(spoke.type) or Kind(spoke.type, ANY)
                heard_here = functools.partial(self._heard, spoke.address)
                self.middle.subscribe(spoke.address, kind, heard_here, joined=self.types.learn)
        self.middle.join()

    def detach(self) -> None:
        """Hear nothing; calls are refused."""
        self._owner = {}

    def _attach_service(self, spoke: Spoke) -> None:
        kind = self.types.service(spoke.type)
        if kind is None:
            remedy = "install its package, or name the folder of its .srv file under 'interfaces'"
            rule = f"a service's type must be known, but {spoke.type} is not"
            channel = self.binding.channel(next(name for name in spoke.channels if name))
            where = f"{self.binding.source}:{channel.line}: channel {channel.name!r}"
            raise BadRequest(where, rule, remedy, slug="unknown-message-type")
        if spoke.side == "into":
            self._callers.setdefault(spoke.address, self.middle.call(spoke.address, kind, _LANES))
        elif spoke.address not in self.middle.servers:
            self.middle.serve(spoke.address, kind, functools.partial(self._asked, spoke.address))

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

    def publisher(self, spoke: Spoke) -> Publisher | None:
        """Return where the tester publishes; None while the type is unknown."""
        if spoke.address not in self.middle.publishers:
            kind = self.types.kind(spoke.type)
            if kind is None:
                return None
            channel = self.binding.channel(spoke.channels[0])
            self.middle.publish(spoke.address, kind, queue=max(channel.queue, 16), latch=channel.latch)
        return self.middle.publishers[spoke.address]

    def is_connected(self, spoke: Spoke, ros_node: str) -> bool:
        """Return whether a slot's end of a spoke is there: by its name, if that is known."""
        if spoke.is_service:  # clients do not register
            return spoke.side == "out" or self._callers[spoke.address].is_matched
        end = self.middle.subscribers[spoke.address] if spoke.side == "out" else self.publisher(spoke)
        peers = end.peers if end is not None else set()
        return ros_node in peers if ros_node else bool(peers)

    # What a relay asks for.

    def say(self, spoke: Spoke, data: bytes) -> int:
        """Publish; return to how many listeners it was lost."""
        publisher = self.publisher(spoke)
        return publisher.send(data) if publisher is not None else 0

    def ask(self, spoke: Spoke, data: bytes, answered: Answered) -> None:
        """Call a service."""
        self._callers[spoke.address].ask(data, answered)

    def abandon(self, spoke: Spoke, answered: Answered) -> None:
        """Wait no longer for a response."""
        self._callers[spoke.address].abandon(answered)

    def kind_of(self, channel: str) -> tuple[str, str, str]:
        """Return type, md5 sum and definition of a channel's messages."""
        if channel not in self._kinds:
            kind = self.types.kind(message_type(self.binding.channel(channel)))
            if kind is None:
                return ANY, ANY, ""
            self._kinds[channel] = kind.type, kind.md5, kind.definition
        return self._kinds[channel]
