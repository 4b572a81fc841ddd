"""A path that should run -> the path as it runs in the model, in time, or nothing."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from parcours.model.configuration import Inputs, Move
from parcours.model.structure import Cefsm, Component, Machine
from parcours.paths.solving.verdicts import Path
from parcours.paths.timing.clockwork import is_timed
from parcours.paths.timing.events import events_of
from parcours.paths.timing.replaying import Replay
from parcours.paths.timing.schedules import Schedule, schedule


class Verifier:
    """Runs paths of one machine through the step relation of its component.

    Args:
        cefsm: the model of the component alone.
        component: the component.
        machine: the machine.
        finals: the states where a path may end.
    """

    def __init__(self, cefsm: Cefsm, component: Component, machine: Machine, finals: Collection[str]) -> None:
        self._cefsm, self._name, self._machine, self._finals = cefsm, component.name, machine, finals
        self._targets = {transition.id: transition.target for transition in machine.transitions}
        self._timed, self._replay = is_timed(component), Replay(cefsm)

    def runs(self, ids: Sequence[str], inputs: Sequence[Inputs]) -> bool:
        """Return whether transitions run with inputs; clock readings among these are taken to be in time."""
        return not self._replay.run(events_of(self._cefsm, ids), inputs).why_not

    def path(self, moves: Sequence[Move], *, in_time: bool = False) -> Path | None:
        """Return the path that makes these moves, with clock readings that are in time; None if it does not run.

        Args:
            moves: what to do, with inputs.
            in_time: whether the clock readings among these are known to be in time, and only may be better.
        """
        path = Path(tuple(moves))
        if not self.runs(path.ids, path.inputs):
            return None
        if self._timed:
            found = schedule(self._cefsm, path.ids, inputs=path.inputs)
            timely = self._read(moves, found) if isinstance(found, Schedule) else None
            if timely is not None and self.runs(timely.ids, timely.inputs):
                path = timely
            elif not in_time:
                return None
        return Path(path.moves, self.ends(path.ids))

    def ends(self, ids: Sequence[str]) -> bool:
        """Return whether the machine may end a test after these transitions."""
        ours = [id for id in ids if id in self._targets]
        return (self._targets[ours[-1]] if ours else self._machine.initial) in self._finals

    def _read(self, moves: Sequence[Move], found: Schedule) -> Path:
        readings, timely = iter(found.readings), []
        for move in moves:
            inputs = dict(move.inputs)
            for _ in range(2 if move.partner else 1):
                inputs |= {f"{self._name}.{name}": value for name, value in next(readings).items()}
            timely.append(Move(move.transition, move.partner, tuple(sorted(inputs.items()))))
        return Path(tuple(timely))
