"""Lets foreign nodes drive a simulated robot among obstacles, in real time."""

from __future__ import annotations

import time

from parcours.run.binding.passing import ENDS
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.judging import SystemJudge
from parcours_navigation.foreign.tester_messages import Maker

_ONCE = 200_000_000
"""How long after the first sensor messages those are sent that are sent once [ns]."""

_GIVES_UP = 5_000_000_000
"""How long beyond its duration a case is given up [ns]."""


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
        self._session, self._judge, self._maker = session, judge, maker
        self._limit = round(system.duration * 1e9) + _GIVES_UP
        self._periods = {channel: round(period * 1e9) for channel, period in system.sense}
        self._next = dict.fromkeys(self._periods, 0)
        self._each = {channel: index for index, channel in enumerate(system.each)}
        self._once = list(system.once)
        session.relay.unserved = lambda message: maker.answer(session.relay, message)

    def run(self) -> None:
        """Run the case to its end.

        Raises:
            HostFailure: a message of the tester's cannot be made.
        """
        session, world = self._session, self._judge.world
        began = session.case_began
        while True:
            now = session.now() - began
            world.advance(now)
            if world.is_over or now > self._limit or self._judge.watch.unreadable:
                break
            self._sense(now)
            due = min([*self._next.values(), now + 50_000_000])
            session.poll(began + due)
            self._judge.watch.quiet(session.horizon)
        session.relay.note(ENDS)

    def _sense(self, now: int) -> None:
        coming = [channel for channel, due in self._next.items() if due <= now]
        for channel in coming:
            due = self._next[channel] + self._periods[channel]
            self._next[channel] = due if due > now else now + self._periods[channel]
        if self._once and now >= _ONCE:
            coming += self._once
            self._once = []
        if not coming:
            return
        values, items = self._judge.world.values(now, time.time()), self._judge.world.items()
        for channel in coming:
            index = self._each.get(channel)
            if index is None or index < len(items):
                seen = values if index is None else {**values, **items[index]}
                self._session.relay.inject(channel, self._maker.message(channel, seen, items))
