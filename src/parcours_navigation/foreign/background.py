"""An abstract case -> what the tester says all the while to nodes that need it to work: where the robot is."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from parcours.abtc import Event
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.tester_messages import Maker


@dataclass(slots=True)
class _Told:
    channel: str
    slot: str | None
    period: int
    due: int = 0


class Background:
    """Says what `sense` of the binding names, to every process whose part of the case does not receive just that.

    Args:
        session: started.
        maker: makes the tester's messages.
        events: of the case.
    """

    def __init__(self, session: Session, maker: Maker, events: Sequence[Event]) -> None:
        self._session, self._maker = session, maker
        system = session.host.binding.system
        references = {slot.name: slot.reference for slot in session.slot_plan.slots}
        self._told: list[_Told] = []
        for channel, period in system.sense if system else ():
            given = {one.reference for one in events if one.receives is not None and one.receives.channel == channel}
            for spoke in session.slot_plan.speaking(channel):
                if references.get(spoke.slot, -1) not in given:
                    self._told.append(_Told(channel, spoke.slot or None, round(period * 1e9)))

    def tell(self, now: int) -> None:
        """Say what is due [ns since the run began]."""
        for one in self._told:
            if now >= one.due:
                one.due = now + one.period
                began = now - self._session.case_began
                data = self._maker.of_the_environment(one.channel, began, time.time())
                self._session.relay.inject(one.channel, data, one.slot)
