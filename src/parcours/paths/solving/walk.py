"""Walks of symbolic events: constraints on what is open at each, and from a solution the inputs.

A guard and the bounds of time are constraints; an assignment gives its variable a new symbol; inputs, and fields
of messages that no earlier event sent, are symbols of their own at every event; a value that leaves the range of
its variable is not executable.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from fractions import Fraction
from math import inf

import z3

from parcours.model.configuration import Inputs
from parcours.model.expression import Assignment, Expression, Type, names
from parcours.model.scope import is_local, variable_type
from parcours.model.structure import Transition, Variable
from parcours.paths.solving.reading import Begin, IntegerBound, ModelTables, Snapshot, WalkReading, domain_text, time_of
from parcours.paths.solving.terms import NoTerm, Translator, Value, is_constant, rational, variable
from parcours.paths.solving.verdicts import SOLVER_STEPS, Work
from parcours.paths.timing.clocks import ClockConstraint, NoBound, ways
from parcours.paths.timing.events import Place, TimedEvent
from parcours.paths.timing.time_constraints import Clockwork, Facts, set_when


class SymbolicWalk:
    """A sequence of events taken symbolically, one longer by `push` and one shorter by `pop`."""

    def __init__(
        self, ground: ModelTables, places: Sequence[Place], *, exact: bool = True, explain: bool = False,
        begin: Begin = "initial", unsteady: frozenset[str] = frozenset(), bounds: frozenset[IntegerBound] = frozenset(),
        taken: frozenset[tuple[int, str]] = frozenset(), timed: bool = True, seed: int = 0, work: Work | None = None,
    ) -> None:  # fmt: skip
        self.work = work or Work(inf)
        self.ground, self._places, self._explain, self._taken = ground, tuple(places), explain, taken
        self._timed = timed and ground.timed
        self._solver = z3.Solver()
        self._solver.set("random_seed", seed % 2**31)
        if explain:
            self._solver.set("core.minimize", True)
        self._reading = WalkReading(ground, begin, exact, unsteady, bounds, self._solver.add, self._demand)
        self._why: dict[str, str] = {}
        self._levels = [Snapshot({}, {})]
        self._limit = 0

    def __len__(self) -> int:
        return len(self._levels) - 1

    @property
    def rounds(self) -> bool:
        """Whether floating point may round something on the way."""
        return any(level.rounds for level in self._levels)

    def key(self) -> object | None:
        """Return the values of all variables, or None if some depend on what is open, or time passes."""
        values = self._levels[-1].values
        if self._timed or not all(map(is_constant, values.values())):
            return None
        # Variables that nobody looked at yet are missing; so are those that stand as they began.
        begun = {slot: self.ground.initial(self.ground.variables[slot[1]][slot[2]]) for slot in values}
        return frozenset((slot, str(value)) for slot, value in values.items() if str(value) != str(begun[slot]))

    def push(self, event: TimedEvent) -> None:
        """Take an event. Raises NoTerm, with nothing changed, if it has no faithful translation."""
        self._solver.push()
        self._levels.append(self._levels[-1].following(event))
        try:
            self._take(event, self._levels[-1])
        except NoBound as reason:
            self.pop()
            raise NoTerm(str(reason)) from None
        except BaseException:
            self.pop()
            raise

    def pop(self, n: int = 1) -> None:
        """Take the last `n` events back."""
        if n:
            self._solver.pop(n)
            del self._levels[-n:]

    def finish(self) -> None:
        """Add what the machines that stand still by now demand of the time of the last event."""
        level = self._levels[-1]
        if level.clockwork is not None and level.event is not None:
            self._keep(level.clockwork.finish(level.event.number), level.event)

    def values(self, event: TimedEvent) -> dict[str, Value]:
        """Return the terms of the variables that were read or set so far, of the component of an event."""
        top = self._levels[-1].values.items()
        return {slot[2]: value for slot, value in top if slot[:2] == (event.instance, event.component)}

    def check(self, units: float, *also: Value) -> bool | None:
        """Return whether the events can happen, and more hold; None if that takes more units of work."""
        if self.work.mark is None:
            self.work.mark = self._count()
        # The limit counts the solver's own steps (0 would be no limit); a time limit would depend on the machine.
        limit = int(min(max(1, units * SOLVER_STEPS), 2**32 - 1))
        if limit != self._limit:  # to set it takes as long as a small question
            self._solver.set("rlimit", limit)
            self._limit = limit
        answer = self._solver.check(*also)
        count = self._count()
        self.work.spent += 1 + (count - self.work.mark) // SOLVER_STEPS
        self.work.mark = count
        return None if answer == z3.unknown else bool(answer == z3.sat)

    def _count(self) -> int:
        # From the back, where the count stands: looking it up by name reads some twenty names before it.
        found = self._solver.statistics()
        return next(int(found[at][1]) for at in reversed(range(len(found))) if found[at][0] == "rlimit count")

    def core(self) -> tuple[str, ...]:
        """Return what cannot hold together, after `check` said no; needs `explain`."""
        labels = sorted((str(each) for each in self._solver.unsat_core()), key=lambda label: int(label[3:]))
        return tuple(dict.fromkeys(self._why[label] for label in labels))

    def inputs(self) -> tuple[Inputs, ...]:
        """Return what to choose at each event, after `check` said yes."""
        model = self._solver.model()
        return tuple(self._inputs(level, model) for level in self._levels[1:])

    def settled(self) -> tuple[Inputs, ...]:
        """Return other choices, where reals are 64-bit floats exactly, as far as they can be."""
        model, scopes = self._solver.model(), self._solver.num_scopes()
        for level in self._levels[1:]:
            for value, type_ in level.opens.values():
                if type_.name == "real":
                    nearest = Fraction(_float(model.eval(value, model_completion=True)))
                    self._solver.push()
                    self._solver.add(value == rational(nearest))
                    if self._solver.check() == z3.sat:
                        model = self._solver.model()
                    else:
                        self._solver.pop()
        found = tuple(self._inputs(level, model) for level in self._levels[1:])
        self._solver.pop(self._solver.num_scopes() - scopes)
        return found

    def _take(self, event: TimedEvent, level: Snapshot) -> None:
        transition, at = event.transition, f"{event.transition.id!r}"
        if self._timed:
            self._tick(event, level)
        else:
            level.clocks = dict.fromkeys(self.ground.clocks[event.component], (0, Fraction(0)))
        translator = self._reading.translator(event, level)
        if transition.guard is not None:
            guard = translator.term(transition.guard)
            self._demand(
                z3.And(guard.defined, guard.value),
                f"guard of {at}: {transition.guard}{set_when(transition.guard, level.clocks)}",
            )
        self._refuse_clocks_read_late(transition, level)
        for action in transition.actions:
            if isinstance(action, Assignment):
                declared = self.ground.variables[event.component].get(action.target)
                if declared is not None and is_local(declared):
                    why = f"action of {at}: {action}"
                    value = self._assigned(translator, action.value, declared, why)
                    level.values[event.instance, event.component, declared.name] = value
        site = self.ground.layout.sites[transition.id]
        for send, content in zip(transition.sends, site.contents, strict=True):
            if (event.number, send.channel) in self._taken:
                said = {}
                for name, expression in content.fields:
                    term = translator.term(expression)
                    self._demand(term.defined, f"message of {at}: {expression}")
                    said[name] = term.value
                level.messages[event.number, send.channel] = said
        for side in translator.sides:
            self._solver.add(side)
        level.rounds = translator.rounds

    def _tick(self, event: TimedEvent, level: Snapshot) -> None:
        if level.clockwork is None:  # time begins with the first event
            stands = None if self._reading.begin == "initial" else {event.place: event.transition.source}
            level.clockwork = Clockwork(self.ground.cefsm, self._places, stands)
            self._keep(level.clockwork.begin(), event)
        level.clocks = dict(level.clockwork.clocks(event))
        self._solver.add(time_of(event.number) >= 0)
        self._keep(level.clockwork.advance(event), event)

    def _keep(self, facts: Facts, event: TimedEvent) -> None:
        limits, conditions = facts
        for limit in limits:
            apart, most = time_of(limit.later) - time_of(limit.earlier), rational(limit.most)
            self._demand(apart < most if limit.strict else apart <= most, limit.why)
        for condition in conditions:
            if not condition.guards:  # a guard is a constraint already, with its data
                if len(ways(condition, {})) > 1:
                    raise NoTerm(f"{condition.why} holds at times that are not one interval")
                self._demand(self._invariant(condition, event), condition.why)

    def _invariant(self, condition: ClockConstraint, event: TimedEvent) -> Value:
        def reads(node: Expression, type_: Type) -> Value:
            return self._reading.clock(event, str(node), condition.at, condition.clocks[str(node)])

        symbols, fresh = self.ground.symbols, self._reading.fresh
        real = Type("real")
        reader = Translator(lambda node: real, reads, symbols, condition.clocks, fresh, exact=True)
        return reader.term(condition.expression).value

    def _assigned(self, translator: Translator, expression: Expression, declared: Variable, why: str) -> Value:
        # A symbol for the value, unless it is a constant and nobody asks for reasons.
        term = translator.term(expression)
        self._demand(term.defined, why)
        value = z3.simplify(translator.stored(term.value, variable_type(declared)))
        if self._explain or not is_constant(value):
            symbol = variable(self._reading.fresh(), variable_type(declared))
            self._demand(symbol == value, why)
            value = symbol
        self._demand(self.ground.within(value, declared), f"range of {declared.name!r}: {domain_text(declared)}")
        return value

    def _refuse_clocks_read_late(self, transition: Transition, level: Snapshot) -> None:
        late: set[str] = set()
        parts = [each for each in transition.actions if isinstance(each, Assignment)]
        read = [(each.target, names(each.value)) for each in parts]
        read += [("", names(value)) for send in transition.sends for value in send.payload]
        for target, used in read:
            if not used.isdisjoint(late):
                raise NoTerm(f"{transition.id!r} reads a clock after setting it")
            late |= {target} & set(level.clocks)

    def _demand(self, condition: Value, why: str) -> None:
        condition = z3.simplify(condition)
        if z3.is_true(condition):
            return
        if not self._explain:
            self._solver.add(condition)
            return
        label = f"why{len(self._why)}"
        self._why[label] = why
        self._solver.assert_and_track(condition, label)

    def _inputs(self, level: Snapshot, model: z3.ModelRef) -> Inputs:
        found = {
            term: self._constant(model.eval(value, model_completion=True), type_)
            for term, (value, type_) in level.opens.items()
        }
        if (event := level.event) is not None:
            for name, setting in level.clocks.items():
                reading = self._reading.clock(event, name, event.number, setting)
                found[f"{event.component}.{name}"] = _float(model.eval(reading, model_completion=True))
        return tuple(sorted(found.items()))

    def _constant(self, value: Value, type_: Type) -> object:
        match type_.name:
            case "bool":
                return z3.is_true(value)
            case "int":
                return value.as_long()
            case "real":
                return _float(value)
        return self.ground.symbols.text(value.as_long())


def _float(value: Value) -> float:
    if z3.is_algebraic_value(value):
        value = value.approx(30)
    try:
        return float(value.as_fraction())
    except OverflowError:
        return sys.float_info.max if value.as_fraction() > 0 else -sys.float_info.max
