"""The nodes of a navigation stack, running, and the tester beside them: time, messages, goals, the last command."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from parcours.errors import HostFailure
from parcours.run.binding import Compiled
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.message_formulas import message_type
from parcours.run.binding.slots import whole
from parcours.run.binding.standard import ACTIONS
from parcours.run.binding.structure import Binding, Stack
from parcours.run.recording import Raw
from parcours.run.trace import TraceEvent

if TYPE_CHECKING:
    from parcours.run.hosts.foreign.session import Session
    from parcours.run.hosts.ros2.actions import ActionCaller
    from parcours.run.hosts.ros2.stepping import SteppedClock

Values = dict[str, object]

_FOLDER = "parcours-stack-"

_BEFORE = 1_000_000
"""How long before timers are due the sensors speak [ns]."""

_PATIENCE = 2.0
"""How long nodes whose topics are there may take to be found on /clock, and to answer a goal [s]."""

_PIECE = 5_000_000
"""The longest wait in one piece [ns]."""

_ENDING = 10.0
"""How long a goal that is cancelled may take to end [s of the nodes' clock]."""

_GOALS = ("goal", "navigate")
"""Channels of which nodes hear when a case begins, and when the goal moves, as of those that are latched."""


def check_stack(binding: Binding) -> None:
    """Start the nodes of a stack once, in this network, and see that they have what is bound, and follow its clock.

    Raises as `StackNodes`.
    """
    assert binding.stack is not None
    nodes = StackNodes(replace(binding, stack=replace(binding.stack, own=False)))
    try:
        nodes.begin()
    finally:
        nodes.close()


def _folder() -> Path:
    """Return this process's folder for the output of nodes. Workers are killed when they are done: others clean up."""
    here = Path(tempfile.gettempdir())
    for old in here.glob(f"{_FOLDER}*"):
        if not Path("/proc", old.name.removeprefix(_FOLDER)).exists():
            shutil.rmtree(old, ignore_errors=True)
    return here / f"{_FOLDER}{os.getpid()}"


class StackNodes:
    """The nodes of a stack, running, and the tester beside them.

    Args:
        binding: of the stack.

    Raises:
        HostFailure: the nodes cannot be had here: no ROS 2, no network, something absent or of another type.
        BadRequest: the binding does not fit the message types.
    """

    def __init__(self, binding: Binding) -> None:
        from parcours.run.hosts.foreign.host import ForeignHost
        from parcours.run.hosts.foreign.session import Session

        assert binding.stack is not None
        self._stack: Stack = binding.stack
        provided = [one for one in binding.channels if one.role == "provide"]
        self.once = [one for one in provided if one.latch or one.name in _GOALS]
        self.continual = [one for one in provided if one not in self.once]
        self._closing = contextlib.ExitStack()
        self._last: bytes | None = None
        self._clock: SteppedClock | None = None
        self._server: ActionCaller | None = None
        self._began = 0
        try:
            if self._stack.own:
                from parcours.run.hosts.isolation import enter_own_network

                enter_own_network()
            host = self._closing.enter_context(ForeignHost(binding, _folder(), is_shared=not self._stack.own))
            self._session: Session = Session(host, whole(binding), listener=self._hear)
            self._session.relay.reports_at_once = True  # time stands still until a command has been heard
            self._closing.callback(self._session.end)
            self._session.start()
            self._compiled: Compiled = host.compile()
            self._decoder = Decoder(binding, self._compiled.types)
            self._find_server()
            self._make_clock()
        except BaseException:
            self._closing.close()
            raise

    def _make_clock(self) -> None:
        from parcours_navigation.foreign.tester_messages import Maker

        self._maker = Maker(self._compiled)
        if not self._stack.simulated:
            return
        from parcours.run.hosts.ros2.stepping import SteppedClock

        graph: Any = self._session.host.graph
        nodes = [slot.ros_node for slot in self._session.slot_plan.slots]
        self._clock = SteppedClock(
            graph.participant, nodes, step=round(self._stack.step * 1e9), hops=self._stack.hops,
            quiet=round(self._stack.quiet * 1e9), tasks=self._server is not None, discovery=_PATIENCE,
            look=self._look,
        )  # fmt: skip

    def _find_server(self) -> None:
        channel = next((one for one in self.once if one.part == "goal"), None)
        if channel is None:
            return
        from parcours.run.hosts.ros2.actions import ActionCaller

        graph: Any = self._session.host.graph
        caller = ActionCaller(graph.participant, graph.known.action(channel.type), channel.address)
        deadline = time.monotonic() + _PATIENCE
        while not caller.is_served:
            self._wait()
            if time.monotonic() > deadline:
                rule = f"{channel.name!r} needs a node that serves the action {channel.address}, but none does"
                raise HostFailure(self._session.host.binding.source, rule, slug="absent-topic")
        self._server = caller

    def _wait(self) -> None:
        self._session.poll(self._session.now() + _PIECE)
        self._look()

    def _hear(self, event: TraceEvent) -> None:
        if event.kind == "receive" and event.channel == self._stack.command and isinstance(event.payload, Raw):
            self._last = event.payload.content
            if self._clock is not None:
                self._clock.stirred()

    def _look(self) -> None:
        """See whether all nodes live. Raises HostFailure if one does not."""
        self._session.poll(self._session.now())
        for name, how in self._session.deaths.items():
            raise HostFailure(f"node {name}", f"must live, but {how}", "look into its output", slug="foreign-dead")

    @property
    def processes(self) -> list[int]:
        """The ids of the processes that were started."""
        return [process.pid for _, process in self._session.host.running.values()]

    def output(self, name: str) -> str:
        """Return what a node has printed so far."""
        return self._session.host.running[name][1].output()

    def begin(self) -> None:
        """Begin a case: time starts again, the binding's steps are done, and earlier messages are dropped."""
        from parcours_navigation.foreign.setup_steps import act

        self._look()
        self._give_up()
        if self._clock is not None:
            self._clock.begin()
        act(self._session, "before_case")
        if self._clock is not None:
            self._clock.settle()
        self._session.relay.events.clear()
        self._last, self._began = None, time.perf_counter_ns()

    def await_time(self, now: int, due: int) -> None:
        """Let time pass to just before timers are due at the end of a period [ns since the case began]."""
        if self._clock is not None:
            self._clock.advance(due - _BEFORE)
            return
        while (left := self._began + now - time.perf_counter_ns()) > 0:
            self._session.poll(self._session.now() + left)
            self._look()

    def stamp(self) -> float:
        """Return what the nodes' clock shows [s]."""
        return time.time() if self._clock is None else self._clock.instant * 1e-9

    def tell(self, channel: str, values: Mapping[str, object], items: Sequence[Mapping[str, object]]) -> None:
        """Publish a message on a channel, and let the nodes work on it: what comes next finds it done."""
        message = self._maker.message(channel, values, items)
        if self._server is not None and channel in ACTIONS:
            self._ask(self._server, channel, message)
        else:
            self._session.relay.inject(channel, message)
        if self._clock is not None:
            self._clock.settle()

    def _ask(self, server: ActionCaller, channel: str, message: bytes) -> None:
        """Send a goal, and see that it is accepted."""
        bound = self._session.host.binding.channel(channel)
        server.send(self._compiled.types.unpacked(message_type(bound), message))
        deadline = time.monotonic() + _PATIENCE
        while server.state == "sent" and time.monotonic() < deadline:
            if self._clock is not None:
                self._clock.settle()
            else:
                self._wait()
        if server.state in ("sent", "refused"):
            how = "was refused" if server.state == "refused" else f"was not answered within {_PATIENCE:g} s"
            rule = f"a goal must be accepted, but one of {bound.address} {how}"
            raise HostFailure(f"channel {channel!r}", rule, "look into the output of its server", slug="stack-goal")

    def _give_up(self) -> None:
        """Cancel the goal of the last case, and let time pass until its server has ended it."""
        if self._server is None or not self._server.is_busy:
            return
        self._server.cancel()
        until = self.stamp() + _ENDING
        while self._server.is_busy:
            if self._clock is None:
                self._wait()
            else:
                self._clock.settle()
                self._clock.advance(self._clock.now() + round(self._stack.step * 1e9))
            if self.stamp() > until:
                rule = f"a goal that is cancelled must end within {_ENDING:g} s, but its server goes on"
                raise HostFailure("channel 'navigate'", rule, "let it see is_cancel_requested", slug="stack-goal")

    def pass_on(self, due: int) -> None:
        """Let the timers of the nodes fire that are due at `due` [ns]."""
        if self._clock is None:
            self._look()
        else:
            self._clock.advance(due)

    def command(self) -> tuple[float, float, float] | None:
        """Return the last command of the case: speed ahead and to the left [m/s], yaw rate [rad/s]; None before.

        Raises HostFailure if it cannot be read.
        """
        self._session.relay.events.clear()
        if self._last is None:
            return None
        channel = self._stack.command
        message = self._decoder.message(channel, self._last)
        twist = message.twist if channel == "command_stamped" else message
        return twist.linear.x, twist.linear.y, twist.angular.z

    def close(self) -> None:
        """End the nodes."""
        self._closing.close()
