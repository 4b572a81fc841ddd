"""Leads nodes that use simulated time from instant to instant by /clock, as fast as they can work.

A step publishes the next instant and waits until all nodes are quiet. Whether one is cannot be seen from outside, but
it can be asked: every node of rclpy and rclcpp serves its parameters in the executor that also runs its callbacks. An
executor looks for what has come, and runs one callback of each entity that has something: that is one round. It
looks at subscriptions before services, so a question that arrives just then overtakes what was published before it:

    round 1  looks at /clock, nothing | /clock moves, question 1 | looks at services: question 1    at worst
    round 2  /clock, question 2
    round 3  timers that are due, question 3
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from parcours.errors import BadRequest, HostFailure
from parcours.run.clocks import ClockName
from parcours.run.hosts.ros2.participant import Ros2Participant

START = 1_000_000_000
"""The first instant [ns]: zero on /clock means that there is no time yet."""

_QUESTIONS = 2
"""How many follow a message [rounds]: with the second answer it has been heard."""

_QUESTIONS_OF_A_STEP = 3
"""How many follow the clock [rounds]: with the third answer the timers that are due have fired."""

_AHEAD = 100_000_000_000
"""How far time goes ahead before it goes back for the first time [ns]: no timer waits that long."""

_PIECE = 50_000_000
"""The longest wait in one piece [ns]."""


class SteppedClock:
    """Time that passes on /clock by command. It is a `Clock`: whole nanoseconds since construction or `restart`.

    Args:
        participant: the tester's; it stays open.
        nodes: names of all nodes that use simulated time, e.g. `/follower`.
        watched: topic -> its message class; what passes there is heard, and means that the nodes are not quiet.
        step: the longest time that passes at once [ns]; timers due within a step fire late, at its end.
        hops: how many messages may follow on each other unheard, e.g. 2 for a service between nodes.
        quiet: how long all must be silent after they have answered [ns of real time]; for nodes that have
            threads of their own.
        within: how long a step may take [s of real time].
        tasks: how many coroutines may wake each other, as those of action servers are woken by timers [rounds].
        discovery: how long nodes may take to be found [s of real time].
        look: called now and then while nodes are waited for; what it raises ends the waiting.

    Raises:
        BadRequest: step is not positive.
        HostFailure: a node serves no parameters, or does not listen to /clock.
    """

    name: ClockName = "simulated"

    def __init__(self, participant: Ros2Participant, nodes: Sequence[str], watched: Mapping[str, Any] | None = None, *,
                 step: int = 50_000_000, hops: int = 2, quiet: int = 0, tasks: int = 0, within: float = 10.0,
                 discovery: float = 30.0, look: Callable[[], None] = lambda: None) -> None:  # fmt: skip
        from rcl_interfaces.srv import GetParameterTypes
        from rclpy.qos import QoSProfile, ReliabilityPolicy
        from rosgraph_msgs.msg import Clock as ClockMessage

        if step <= 0:
            raise BadRequest("stepped clock", f"a step takes time, but {step} ns was given", slug="ros2-step")
        self._participant, self._step, self._quiet, self._within = participant, step, quiet, within
        self._discovery, self._look = discovery, look
        self._rounds, self._tasks = hops + 1, tasks
        self._zero = self._instant = START
        self._message = ClockMessage()
        self._publisher = participant.node.create_publisher(ClockMessage, "/clock", 10)
        self._ask = GetParameterTypes.Request()
        self._unanswered: Counter[str] = Counter()
        self._heard = 0
        self._clients: dict[str, Any] = {}
        for node in nodes:
            answered = partial(self._answer, node)
            self._clients[node] = participant.inquire(GetParameterTypes, f"{node}/get_parameter_types", answered)
        for topic, kind in (watched or {}).items():
            quality = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)  # hears reliable ones, too
            participant.overhear(kind, topic, self._hear, quality)
        self._await_nodes()
        self._publish()

    def _answer(self, node: str, number: int, answer: object) -> None:
        self._unanswered[node] -= 1
        if self._unanswered[node] <= 0:
            del self._unanswered[node]

    def _hear(self, message: bytes) -> None:
        self._heard += 1

    def _await_nodes(self) -> None:
        deadline = time.monotonic() + self._discovery
        while True:
            absent = [node for node, client in self._clients.items() if not client.service_is_ready()]
            deaf = self._publisher.get_subscription_count() < len(self._clients)
            if not absent and not deaf:
                return
            if time.monotonic() > deadline:
                what = f"{', '.join(absent)} serve none" if absent else "not all nodes listen to /clock"
                rule = f"its nodes serve their parameters and use simulated time, but {what}"
                raise HostFailure("stepped clock", rule, "start them with use_sim_time:=true", slug="ros2-sim-time")
            self._participant.spin(time.perf_counter_ns() + 5_000_000)

    def now(self) -> int:
        """The time [ns]."""
        return self._instant - self._zero

    @property
    def instant(self) -> int:
        """What /clock shows, and what nodes stamp their messages with [ns]."""
        return self._instant

    def advance(self, until: int) -> int:
        """Step on to `until` [ns], unless it is past; return once all nodes are quiet.

        Raises HostFailure if a node does not come to rest, or answers no more.
        """
        while self.now() < until:
            self._instant += min(self._step, until - self.now())
            self._publish()
        return self.now()

    def rest(self, until: int) -> None:
        """Step on to `until` [ns]."""
        self.advance(until)

    def restart(self) -> None:
        """Count from now on; on /clock time goes on."""
        self._zero = self._instant

    def _publish(self) -> None:
        self._message.clock.sec, self._message.clock.nanosec = divmod(self._instant, 1_000_000_000)
        self._publisher.publish(self._message)
        self._settle(_QUESTIONS_OF_A_STEP)

    def begin(self) -> None:
        """Set /clock back to its first instant, and count from there: timers of nodes start their periods again.

        Time goes back each time, the first one, too, so that nodes find nothing different.
        """
        if self._instant == START:
            self._instant += _AHEAD
            self._publish()
        self._zero = self._instant = START
        self._publish()

    def stirred(self) -> None:
        """Take note that nodes are not quiet: one was heard on another way."""
        self._heard += 1

    def settle(self) -> None:
        """Return once all nodes are quiet: also after something was said to them.

        Raises HostFailure if a node does not come to rest, or answers no more.
        """
        self._settle(_QUESTIONS)

    def _settle(self, questions: int) -> None:
        deadline = time.perf_counter_ns() + int(self._within * 1e9)
        quiet_rounds = 0
        while quiet_rounds < self._rounds:
            before = self._heard
            self._question(questions + self._tasks, deadline)
            is_quiet = self._rounds == 1 or self._heard == before  # without hops nobody else listens
            quiet_rounds = quiet_rounds + 1 if is_quiet else 0
            if quiet_rounds == self._rounds and self._quiet:
                until = time.perf_counter_ns() + self._quiet
                while self._participant.spin(until):
                    pass
                quiet_rounds = quiet_rounds if self._heard == before else 0
            if time.perf_counter_ns() > deadline:
                rule = f"all nodes must be quiet within {self._within:g} s of real time, but messages go on"
                raise HostFailure("stepped clock", rule, "are there timers on the real clock?", slug="ros2-restless")

    def _question(self, questions: int, deadline: int) -> None:
        """Ask each node several times at once: an executor takes one question in a round of its callbacks."""
        self._unanswered = Counter(dict.fromkeys(self._clients, questions))
        for _ in range(questions):
            for client in self._clients.values():
                client.handle.send_request(self._ask)
        while self._unanswered:
            now = time.perf_counter_ns()
            if self._participant.spin(min(deadline, now + _PIECE)):
                continue
            self._look()
            if self._unanswered and time.perf_counter_ns() >= deadline:
                who = ", ".join(sorted(self._unanswered))
                rule = f"each node must answer within {self._within:g} s of real time, but silent is {who}"
                raise HostFailure("stepped clock", rule, "see whether it still runs", slug="ros2-restless")
        # What was said before the last answer is here by now, but may not have been looked for.
        while self._participant.spin(time.perf_counter_ns()):
            pass
