"""A system case -> the nodes of others driving a simulated robot among obstacles, in real time, and the verdict."""

from __future__ import annotations

import contextlib
import time

from parcours.run.binding.passing import ENDS, Call, Message
from parcours.run.binding.relay import Relay
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.judging import SystemJudge
from parcours_navigation.foreign.tester_messages import Maker

_ONCE = 200_000_000
"""So long after the first sensor messages those are sent that are sent once [ns]."""

_GIVES_UP = 5_000_000_000
"""So long beyond its duration a case is not waited for [ns]."""


class SystemDrive:
    """Plays the world to a session.

    Args:
        session: started; its listener is the judge's `observe`.
        judge: of the case.
        maker: makes the tester's messages.
    """

    def __init__(self, session: Session, judge: SystemJudge, maker: Maker) -> None:
        system = session.host.binding.system
        assert system is not None
        self._session, self._judge, self._maker, self._system = session, judge, maker, system
        self._periods = {channel: round(period * 1e9) for channel, period in system.sense}
        self._next = dict.fromkeys(self._periods, 0)
        self._each: dict[str, int] = {}
        for channel in system.each:
            self._each[channel] = len(self._each)
        self._once = list(system.once)
        session.relay.unserved = self._serve

    def run(self) -> None:
        """Run the case to its end.

        Raises:
            HostFailure: a message of the tester's cannot be made.
        """
        session, world, relay = self._session, self._judge.world, self._session.relay
        began = session.case_began
        limit = round(self._system.duration * 1e9) + _GIVES_UP
        while True:
            now = session.now() - began
            world.advance(now)
            if world.is_over or now > limit or self._judge.watch.unreadable:
                break
            self._sense(now)
            due = min([*self._next.values(), now + 50_000_000])
            session.poll(began + due)
            self._judge.watch.quiet(session.horizon)
        relay.note(ENDS)

    def _sense(self, now: int) -> None:
        coming = [channel for channel, due in self._next.items() if due <= now]
        if self._once and now >= _ONCE:
            coming += self._once
            self._once = []
        if not coming:
            return
        values, items = self._judge.world.values(now, time.time()), self._judge.world.items(now)
        for channel in coming:
            if channel in self._periods:
                due = self._next[channel] + self._periods[channel]
                self._next[channel] = due if due > now else now + self._periods[channel]
            told = values
            if channel in self._each:
                if self._each[channel] >= len(items):
                    continue
                told = {**values, **items[self._each[channel]]}
            self._session.relay.inject(channel, self._maker.message(channel, told, items))

    def _serve(self, message: Message) -> None:
        """Answer in the place of a node that is not run."""
        relay, binding = self._session.relay, self._session.host.binding
        call = message.call
        if call is None:
            return
        answer_call(relay, self._maker, binding.channel(message.channel).address, call)


def answer_call(relay: Relay, maker: Maker, service: str, call: Call, slot_time: int = 0) -> None:
    """Let the tester answer a call, as the binding's `inject` says, or with an empty message."""
    binding = relay.binding
    responses = [one for one in binding.channels if one.part == "response" and one.address == service]
    if responses:
        data = maker.of_the_environment(responses[0].name, slot_time, time.time())
        relay.answer(call, relay.made(responses[0].name, data))
        return
    requests = [one for one in binding.channels if one.part == "request" and one.address == service]
    with contextlib.suppress(KeyError):
        relay.finish(call, maker.empty(requests[0].type + "Response"))
