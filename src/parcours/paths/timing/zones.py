"""The zones of a timed component: all readings that its clocks may have together after a run, in exact bounds.

A zone is a matrix of differences (Dill, Timing assumptions and verification of finite-state concurrent systems, 1989):
entry [i][j] bounds clock i minus clock j, clock 0 being the constant 0. A machine whose transitions have durations has
a clock of its own, set when it moves. Zones allow at least what time allows: conditions that are no bound are left
out, and beyond the largest constant that a clock is compared with, its reading does not count, so that there are
finitely many zones. What is found along them is scheduled exactly afterwards.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from math import ceil, inf, lcm

from parcours.model.expression import Assignment, Binary, Expression, Literal, names
from parcours.model.expression.syntax import walk
from parcours.model.structure import CLOCK, Component, Transition
from parcours.paths.timing.clocks import ClockConstraint, NoBound, Way, decimal, ways
from parcours.paths.timing.network import TimeLimit
from parcours.paths.timing.time_constraints import settings_of

Zone = tuple[int, ...]
"""The matrix row by row; a bound of c units is 2 c + 1, or 2 c where it is strict."""

_FREE = 1 << 62
_ZERO = 1


class Zones:
    """The zones of one component; its machines stand in `states`, in their order."""

    def __init__(self, component: Component) -> None:
        self._machines = component.machines
        clocks = [each.name for each in component.variables if each.type == CLOCK]
        self._clocks = {name: (place, Fraction(0)) for place, name in enumerate(clocks, start=1)}
        timed = [any(each.duration for each in machine.transitions) for machine in component.machines]
        self._entered = {at: len(clocks) + 1 + sum(timed[:at]) for at, is_timed in enumerate(timed) if is_timed}
        self._size = 1 + len(clocks) + sum(timed)
        self._invariants = [
            [(state, part) for state, each in machine.invariants for part in _conjuncts(each)]
            for machine in component.machines
        ]
        self._waits = [{each.source for each in machine.transitions if each.duration} for machine in component.machines]
        self._domains = {each.name: each.domain for each in component.variables if isinstance(each.domain, range)}
        steps = list(component.transitions())
        said = [part for each in steps if each.guard is not None for part in _conjuncts(each.guard)]
        said += [part for found in self._invariants for _, part in found]
        said = [each for each in said if not names(each).isdisjoint(self._clocks)]
        durations = [decimal(end) for each in steps for end in each.duration or () if end < inf]
        settings = [each.value for step in steps for each in step.actions if isinstance(each, Assignment)]
        numbers = [number for each in (*said, *settings) for number in _numbers(each)]
        self._scale = lcm(*(number.denominator for number in (*numbers, *durations)))
        self._most = self._largest(said, durations)

    def start(self, states: Sequence[str]) -> Zone | None:
        """Return the readings with which a run begins, and as long as it may wait then; None if it cannot begin."""
        zone = self._kept([_ZERO] * self._size**2, states)
        return None if zone is None else self._waited(zone, states)

    def after(
        self, zone: Zone, states: Sequence[str], moving: Iterable[tuple[int, Transition, Mapping[str, object]]]
    ) -> list[Zone]:
        """Return the readings after transitions taken at one time, one zone for each way in which guards may hold.

        Args:
            zone: the readings before.
            states: where the machines stand before.
            moving: for each transition, the place of its machine, and the data that its guard reads.
        """
        here, found = list(states), [list(zone)]
        for machine, transition, known in moving:
            for options in (self._timely(machine, transition), *self._guarded(transition, known)):
                found = [cut for each in found for way in options if (cut := self._cut(each, way)) is not None]
            here[machine] = transition.target
            for each in found:
                self._set(each, machine, transition)
            found = [kept for each in found if (kept := self._kept(each, here)) is not None]
        return list(dict.fromkeys(waited for each in found if (waited := self._waited(each, here)) is not None))

    def _timely(self, machine: int, transition: Transition) -> list[Way]:
        if transition.duration is None:
            return [()]
        (least, most), clock = transition.duration, self._entered[machine]
        way = [TimeLimit(0, clock, -decimal(least))] if least < inf else []
        return [(*way, TimeLimit(clock, 0, decimal(most)))] if most < inf else [tuple(way)]

    def _guarded(self, transition: Transition, known: Mapping[str, object]) -> Iterable[list[Way]]:
        for part in _conjuncts(transition.guard) if transition.guard is not None else ():
            if not names(part).isdisjoint(self._clocks):
                yield self._ways(part, known)

    def _ways(self, part: Expression, known: Mapping[str, object] | None) -> list[Way]:
        try:
            return ways(ClockConstraint(part, 0, self._clocks, ""), known)
        except NoBound:
            return [()]

    def _cut(self, zone: list[int], way: Way) -> list[int] | None:
        """Return the part of a zone within some bounds; None if nothing is left."""
        found, size = list(zone), self._size
        for limit in way:
            one, other = limit.earlier, limit.later
            units = limit.most * self._scale
            if units.denominator != 1:
                continue
            bound = 2 * int(units) + (not limit.strict)
            if bound >= found[one * size + other]:
                continue
            if _sum(found[other * size + one], bound) < _ZERO:
                return None
            found[one * size + other] = bound
            onward = [(to, found[other * size + to]) for to in range(size)]
            for start in range(size):
                first = _sum(found[start * size + one], bound)
                if first < _FREE:
                    for to, second in onward:
                        if (through := _sum(first, second)) < found[start * size + to]:
                            found[start * size + to] = through
        return found

    def _set(self, zone: list[int], machine: int, transition: Transition) -> None:
        size, clocks = self._size, dict(settings_of(transition, self._clocks))
        values = {self._clocks[name][0]: value for name, value in clocks.items()}
        if machine in self._entered:
            values[self._entered[machine]] = Fraction(0)
        for clock, value in values.items():
            units = 2 * int(value * self._scale) + 1
            for other in range(size):
                if other != clock:
                    zone[clock * size + other] = _sum(zone[other], units)
                    zone[other * size + clock] = _sum(zone[other * size], 2 - units)

    def _kept(self, zone: list[int], states: Sequence[str]) -> list[int] | None:
        """Return the part of a zone in which the invariants hold."""
        found: list[int] | None = zone
        held = (
            part for said, now in zip(self._invariants, states, strict=True) for state, part in said if state == now
        )
        for part in held:
            options = self._ways(part, {})
            if found is None or not options:
                return None
            if len(options) == 1:
                found = self._cut(found, options[0])
        return found

    def _waited(self, zone: list[int], states: Sequence[str]) -> Zone | None:
        """Return the readings while the machines stand, up to what no condition tells apart."""
        size = self._size
        for clock in range(1, size):
            zone[clock * size] = _FREE
        for machine, clock in self._entered.items():
            if states[machine] not in self._waits[machine]:  # nobody asks since when
                for other in range(size):
                    zone[clock * size + other] = _FREE
                    zone[other * size + clock] = zone[other * size]
                zone[clock * size + clock] = _ZERO
        found = self._kept(zone, states)
        if found is None:
            return None
        most, is_changed = self._most, False
        for one in range(size):
            for other in range(size):
                bound = found[one * size + other]
                if one != other and one and bound < _FREE and bound > 2 * most[one] + 1:
                    found[one * size + other], is_changed = _FREE, True
                elif one != other and bound < -2 * most[other]:
                    found[one * size + other], is_changed = -2 * most[other], True
        if is_changed:
            _close(found, size)
        return tuple(found)

    def _largest(self, said: Sequence[Expression], durations: Sequence[Fraction]) -> list[int]:
        """Return for each clock the largest number of units that its reading is compared with."""
        most = [Fraction(0)] * self._size
        for clock in self._entered.values():
            most[clock] = max(durations)
        for part in said:
            try:
                limits = [limit for way in ways(ClockConstraint(part, 0, self._clocks, "")) for limit in way]
                number = max((abs(limit.most) for limit in limits), default=Fraction(0))
            except NoBound:  # it is compared with data, which lies in its range
                ranges = [self._domains[name] for name in names(part) & self._domains.keys()]
                ends = [Fraction(abs(end)) for each in ranges for end in (each[0], each[-1])]
                number = max((*ends, *map(abs, _numbers(part))), default=Fraction(0))
            for name in names(part) & self._clocks.keys():
                place = self._clocks[name][0]
                most[place] = max(most[place], number)
        return [ceil(each * self._scale) for each in most]


def _conjuncts(node: Expression) -> Iterator[Expression]:
    if isinstance(node, Binary) and node.operator == "&&":
        yield from _conjuncts(node.left)
        yield from _conjuncts(node.right)
    else:
        yield node


def _numbers(node: Expression) -> list[Fraction]:
    found = [each.value for each in walk(node) if isinstance(each, Literal)]
    return [decimal(each) for each in found if isinstance(each, int | float) and not isinstance(each, bool)]


def _sum(one: int, other: int) -> int:
    if one >= _FREE or other >= _FREE:
        return _FREE
    return one + other - ((one & 1) | (other & 1))


def _close(zone: list[int], size: int) -> None:
    for middle in range(size):
        for start in range(size):
            first = zone[start * size + middle]
            if first < _FREE:
                for end in range(size):
                    if (through := _sum(first, zone[middle * size + end])) < zone[start * size + end]:
                        zone[start * size + end] = through
