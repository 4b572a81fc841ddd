"""A binding -> a running ROS 1 system of somebody else, every bound channel of which passes the tester."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from parcours.errors import BadRequest, HostFailure
from parcours.filenames import file_name
from parcours.run.binding import Binding, Compiled, MessageTypes, compile_binding
from parcours.run.binding.passing import Answered
from parcours.run.binding.readings import message_type
from parcours.run.binding.slots import Slot, SlotPlan, Spoke
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.ros1.client import Client
from parcours.run.hosts.ros1.ends import ANY, Caller, Kind, Publisher, Subscriber
from parcours.run.hosts.ros1.foreign_master import MasterEnd, plain_value
from parcours.run.hosts.ros1.foreign_types import ForeignTypes
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.process import KeptProcess

NAME = "/parcours"
_MASTER = 3.0
"""So long a master that shall run already may take to answer [s]."""


class ForeignHost:
    """The tester on the graph, and the processes that it has started; a context.

    Args:
        binding: of transport ros1.
        folder: for the output of the nodes; made if it is not there.
        master: of a ROS 1 master that runs; the binding's, if empty; one of the tester's own, if that is empty, too.

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
        self._own: Master | None = None
        self.environment: dict[str, str] = {}
        self.refusals: list[str] = []
        """Connections that were declined, or could not be made, and why."""
        self._publishers: dict[str, Publisher] = {}
        self._subscribers: dict[str, Subscriber] = {}
        self._served: set[str] = set()
        self._callers: dict[str, Caller] = {}
        self._owner: dict[str, tuple[Callable[[Spoke, bytes], None], Callable[[Spoke, bytes, Reply], None], Spoke]] = {}
        self.running: dict[str, tuple[Slot, KeptProcess]] = {}
        """Slots whose process was started here and is not ended."""
        self._kinds: dict[str, tuple[str, str, str]] = {}
        self.compiled: Compiled | None = self._tried()

    def _tried(self) -> Compiled | None:
        """Return the binding compiled; None while a type is not known that a node may yet tell."""
        try:
            return compile_binding(self.binding, MessageTypes(self.types.find))
        except BadRequest as error:
            if "unknown-message-type" not in str(error):
                raise
            return None

    def compile(self) -> Compiled:
        """Return the binding compiled for the types that are known by now. Raises BadRequest if it does not fit."""
        if self.compiled is None:
            self.compiled = compile_binding(self.binding, MessageTypes(self.types.find))
        return self.compiled

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        if self._uri:
            require_master(self._uri, _MASTER)
            self.environment = {"ROS_MASTER_URI": self._uri, "ROS_IP": "127.0.0.1", "ROS_HOSTNAME": "127.0.0.1"}
        else:
            self._own = Master()
            self._own.__enter__()
            self._uri, self.environment = self._own.uri, self._own.environment
        try:
            self.middle = Client(NAME, self._uri, self._refused)
            self.master = MasterEnd(NAME, self._uri)
            self.master.set_parameters({name: plain_value(value) for name, value in self.binding.parameters})
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:  # fmt: skip
        self.close()

    def close(self) -> None:
        """End the processes, leave the graph, and stop the master if it is the tester's own."""
        self.stop(list(self.running))
        if hasattr(self, "middle"):
            self.middle.close()
        if self._own is not None:
            self._own.close()
            self._own = None

    def _refused(self, text: str) -> None:
        if text not in self.refusals:
            self.refusals.append(text)

    # Processes.

    def start(self, slots: list[Slot]) -> None:
        """Start the processes of slots that the tester starts, all at once; those that run already go on.

        Raises:
            HostFailure: a command cannot be run.
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
        ending = [(name, *self.running.pop(name)) for name in names if name in self.running]
        for _, _, process in ending:
            process.ask_to_end()
        asked = time.monotonic()
        for _, slot, process in ending:
            if hasattr(self, "middle"):
                self.middle.unwatch(process.descriptor)
            process.end(asked + min(slot.node.stop, patience) - time.monotonic())
            if process.was_killed and slot.ros_node and hasattr(self, "middle"):
                self.master.forget(slot.ros_node)

    # Ends on the graph; made once for each name, whoever is behind them.

    def attach(self, slot_plan: SlotPlan, heard: Callable[[Spoke, bytes], None],
               asked: Callable[[Spoke, bytes, Reply], None]) -> None:  # fmt: skip
        """Listen and serve wherever the slot_plan says; what is not said any more is not heard any more.

        Raises:
            HostFailure: the master refuses.
            BadRequest: a service's type is unknown.
        """
        self._owner = {spoke.address: (heard, asked, spoke) for spoke in slot_plan.spokes if spoke.side == "out"}
        for publisher in self._publishers.values():
            publisher.forget_last()
        for spoke in slot_plan.spokes:
            if spoke.is_service:
                self._attach_service(spoke)
            elif spoke.side == "out":
                self._listen(spoke)
            else:
                self.publisher(spoke)
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
            self._callers.setdefault(spoke.address, self.middle.call(spoke.address, kind))
        elif spoke.address not in self._served:
            self._served.add(spoke.address)
            address = spoke.address
            self.middle.serve(address, kind, lambda data, reply: self._asked(address, data, reply))

    def _asked(self, address: str, data: bytes, reply: Reply) -> None:
        owner = self._owner.get(address)
        if owner is None:
            reply(None)
        else:
            owner[1](owner[2], data, reply)

    def _listen(self, spoke: Spoke) -> None:
        if spoke.address in self._subscribers:
            return
        address, kind = spoke.address, self.types.kind(spoke.type) or Kind(spoke.type, ANY)

        def heard(data: bytes) -> None:
            owner = self._owner.get(address)
            if owner is not None:
                owner[0](owner[2], data)

        def joined(told: Kind) -> None:
            self.types.learn(told)

        self._subscribers[address] = self.middle.subscribe(address, kind, heard, joined=joined)

    def publisher(self, spoke: Spoke) -> Publisher | None:
        """Return where the tester publishes; None while the type is unknown."""
        if spoke.address not in self._publishers:
            kind = self.types.kind(spoke.type)
            if kind is None:
                return None
            channel = self.binding.channel(spoke.channels[0])
            queue = max(channel.queue, 16)
            self._publishers[spoke.address] = self.middle.publish(spoke.address, kind, queue=queue, latch=channel.latch)
        return self._publishers[spoke.address]

    def is_connected(self, spoke: Spoke, ros_node: str) -> bool:
        """Return whether a slot's end of a spoke is there: by its name, if that is known."""
        if spoke.is_service:
            if spoke.side == "out":
                return True  # clients do not register
            try:
                self._callers[spoke.address].connect()
            except HostFailure:
                return False
            return True
        if spoke.side == "out":
            peers = self._subscribers[spoke.address].peers
        else:
            publisher = self.publisher(spoke)
            peers = publisher.peers if publisher is not None else set()
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
