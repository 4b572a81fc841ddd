"""The window of time in which each transition of a sequence can happen, or the bounds that contradict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from parcours.errors import BadRequest
from parcours.model.configuration import Inputs
from parcours.model.structure import Cefsm
from parcours.paths.timing.clocks import NoBound, Way, ways
from parcours.paths.timing.events import events_of, places_of
from parcours.paths.timing.network import TimeLimit, TimeWindow, Windows, windows_of
from parcours.paths.timing.replaying import StepReplay
from parcours.paths.timing.time_constraints import Clockwork, Facts

EFFORT = 400
"""Most networks solved for one sequence, where conditions can hold in several ways."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """When each transition can be taken, counted from the start [s].

    Attributes:
        windows: for each transition, the earliest and latest time over all schedules.
        gaps: for each transition, how long after the one before it; the first counts from the start. A tester who
            keeps to these while he goes along, and to nothing else, may still come into a contradiction later.
        times: one schedule that keeps every bound, as early as it can be.
        readings: what the clocks of its component read at each transition then, by name.
    """

    windows: tuple[TimeWindow, ...]
    gaps: tuple[TimeWindow, ...]
    times: tuple[Fraction, ...]
    readings: tuple[Mapping[str, float], ...] = ()

    @property
    def earliest(self) -> tuple[float, ...]:
        """The earliest time of each transition [s]."""
        return tuple(float(window.earliest) for window in self.windows)

    @property
    def latest(self) -> tuple[float, ...]:
        """The latest time of each transition [s]: its deadline, infinite without one."""
        return tuple(float("inf") if each.latest is None else float(each.latest) for each in self.windows)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """The sequence cannot be taken in time: these bounds exclude each other."""

    bounds: tuple[str, ...]

    def __str__(self) -> str:
        return "; ".join(self.bounds)


@dataclass(frozen=True, slots=True)
class Unscheduled:
    """Times were not computed, for a reason."""

    reason: str


def schedule(
    cefsm: Cefsm, transition_ids: Sequence[str], instances: Sequence[int] = (), sends: Sequence[int | None] = (),
    inputs: Sequence[Inputs] | None = None,
) -> Schedule | Contradiction | Unscheduled:  # fmt: skip
    """Return when each transition of a sequence can be taken.

    Guards over data alone are taken to hold (`parcours.paths.solving` decides that). Where clocks are compared
    with data, `inputs` say what the data is; `parcours.paths.solving.solved_schedule` finds some. A condition that can
    hold in several ways is met in the first way that fits.

    Args:
        transition_ids: what is taken, in order, from the initial state of each machine on.
        instances: for each transition which copy of its component takes it; empty if there is one of each.
        sends: for each transition the position of the one whose message it takes; empty for first in, first out.
        inputs: for each transition the values of what is open there.

    Raises BadRequest: an id is unknown, a machine would go on from where it does not stand, or the inputs do not make
    the sequence run.
    """
    events = events_of(cefsm, transition_ids, instances, sends)
    if not events:
        return Schedule((), (), ())
    known: Sequence[Mapping[str, object]] | None = None
    if inputs is not None:
        replayed = StepReplay(cefsm).run(events, inputs)
        if replayed.why_not:
            rule = f"must make the sequence run, but {replayed.why_not}"
            raise BadRequest("inputs", rule, "let solved_schedule find some", slug="inputs-fail")
        known = replayed.known
    try:
        clockwork, facts = Clockwork(cefsm, places_of(cefsm, events)), []
        facts.append(clockwork.begin())
        settings = []
        for event in events:
            settings.append(dict(clockwork.clocks(event)))
            facts.append(clockwork.advance(event))
        facts.append(clockwork.finish(len(events)))
        found = _decided(len(events) + 1, facts, known)
    except NoBound as reason:
        return Unscheduled(str(reason))
    if not isinstance(found, Schedule):
        return found
    times = (Fraction(0), *found.times)
    readings = (
        {name: float(now - times[since] + value) for name, (since, value) in clocks.items()}
        for now, clocks in zip(found.times, settings, strict=True)
    )
    return replace(found, readings=tuple(readings))


def _decided(
    n_events: int, facts: Sequence[Facts], known: Sequence[Mapping[str, object]] | None
) -> Schedule | Contradiction | Unscheduled:
    limits = [limit for found, _ in facts for limit in found]
    conditions = [condition for _, found in facts for condition in found]
    choices: list[list[Way]] = []
    for condition in conditions:
        read = {} if not condition.guards else known[condition.guards - 1] if known is not None else None
        found = ways(condition, read)
        if not found:
            return Contradiction((f"{condition.why} never holds",))
        if len(found) > 1 and not condition.guards:
            raise NoBound(f"{condition.why} holds at times that are not one interval")
        if len(found) == 1:
            limits = [*limits, *found[0]]
        else:
            choices.append(found)
    result, tried = _first(n_events, limits, choices, 0)
    if isinstance(result, Windows):
        return Schedule(result.windows[1:], result.gaps, result.times[1:])
    if tried > EFFORT:
        return Unscheduled(f"conditions can hold in too many ways: {EFFORT} of them were tried")
    return Contradiction(tuple(dict.fromkeys(limit.why for limit in result)))


def _first(
    n_events: int, limits: list[TimeLimit], choices: Sequence[Sequence[Way]], tried: int
) -> tuple[Windows | tuple[TimeLimit, ...], int]:
    """Return the windows of the first choice of ways that fits, or the last contradiction; and the effort."""
    result = windows_of(n_events, limits)
    tried += 1
    if not isinstance(result, Windows) or not choices:
        return result, tried
    for way in choices[0]:
        result, tried = _first(n_events, [*limits, *way], choices[1:], tried)
        if isinstance(result, Windows) or tried > EFFORT:
            break
    return result, tried
