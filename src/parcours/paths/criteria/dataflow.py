"""Where a machine defines and uses the values of variables, and the ways from definitions to uses.

The criteria are those of Ammann & Offutt, 2008, section 2.3.2, with definitions and uses on transitions. Within one
transition the order is: the message and the inputs arrive, the guard, the actions in order, what is sent. Guards are
p-uses; right-hand sides, arguments of operations and what is sent are c-uses. A path is def-clear for a variable if
none of its transitions defines it; a du-path visits no state twice between the definition and the use.

A received message and an input live for one transition: defined at its beginning, and only used there. Other machines
that set the same variable are not seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.errors import BadRequest
from parcours.model.expression import Call, Expression, names
from parcours.model.structure import Machine, Transition, Variable
from parcours.paths.criteria.primes import simple_paths
from parcours.paths.criteria.requirement import START, CoverageRequirement, Goal, RequirementCounter, RequirementLimits
from parcours.paths.graph import Came, Graph, breadth_first, way_to


@dataclass(frozen=True, slots=True)
class VariableUse:
    """What one transition does with variables.

    Attributes:
        reads: those whose value from before it uses.
        within: those of which it uses a value that it defines itself.
        defines: those that have a new value after it.
        confirms: those of `defines` whose new value it uses itself.
    """

    reads: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    defines: tuple[str, ...] = ()
    confirms: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Dataflow:
    """The graph of a machine, with an edge START before its start, and what each edge does with variables.

    Attributes:
        label: the name of the machine in requirements.
        graph: edge 0 is START, which leads from state 0 to the machine's start; all other numbers are one higher.
        accesses: for each edge.
    """

    label: str
    graph: Graph
    accesses: tuple[VariableUse, ...]


def dataflow(label: str, machine: Machine, graph: Graph, variables: Sequence[Variable]) -> Dataflow:
    """Return where a machine defines and uses the variables of its component."""
    roles = {variable.name: variable.role for variable in variables}
    begin = VariableUse(defines=tuple(variable.name for variable in variables if variable.role == "local"))
    by_id = {transition.id: transition for transition in machine.transitions}
    accesses = (begin, *(access(by_id[edge], roles) for edge in graph.edges))
    begun = Graph(
        graph.name, (START, *graph.states), (START, *graph.edges), np.concatenate(([0], graph.sources + 1)),
        np.concatenate(([1], graph.targets + 1)), tuple(state + 1 for state in graph.finals),
    )  # fmt: skip
    return Dataflow(label, begun, accesses)


def access(transition: Transition, roles: Mapping[str, str]) -> VariableUse:
    """Return what a transition does with variables, given each one's role, local or input."""
    bound = transition.event.name if transition.event is not None else ""
    reads: dict[str, None] = {}
    within: dict[str, None] = {}
    defined: dict[str, bool] = {}

    def use(expression: Expression, *, known: bool = True) -> None:
        for name in sorted(names(expression)):
            if name == bound or roles.get(name) == "input":
                within[name] = None
            elif name in defined:
                within[name] = None
                defined[name] = True
            elif name in roles:
                reads[name] = None
            elif known:
                rule = f"data criteria need the declaration of each variable, but {name!r} has none"
                remedy = "give the variables of the component that runs the machine"
                raise BadRequest(f"transition '{transition.id}'", rule, remedy, slug="undeclared-variable")

    if transition.guard is not None:
        use(transition.guard)
    for action in transition.actions:
        if isinstance(action, Call):
            for argument in action.arguments:
                use(argument, known=False)
        else:
            use(action.value)
            defined[action.target] = False
    for send in transition.sends:
        for value in send.payload:
            use(value, known=False)
    return VariableUse(
        tuple(reads), tuple(within), tuple(defined), tuple(name for name, used in defined.items() if used)
    )


def definitions(flow: Dataflow, limits: RequirementLimits | None = None) -> Iterator[Goal]:
    """Yield, for all-defs, each definition that reaches a use, with the shortest way to the nearest one.

    Where a transition uses a value and then overwrites it, or uses what it received, that is required as a du-path.
    """
    tally = RequirementCounter(limits or RequirementLimits(), f"definitions in '{flow.graph.name}'")
    yield from _within(flow, tally, confirmed=False)
    for variable, ways in _ways(flow):
        for edge in ways.definitions:
            walk = (edge,) if variable in flow.accesses[edge].confirms else next(ways.shortest(edge, tally), None)
            if walk:
                tally.add(len(walk))
                yield Goal(CoverageRequirement(flow.label, "definition", (flow.graph.edges[edge],), variable), walk)


def uses(flow: Dataflow, limits: RequirementLimits | None = None) -> Iterator[Goal]:
    """Yield, for all-uses, each use that a definition reaches, with the shortest way."""
    tally = RequirementCounter(limits or RequirementLimits(), f"uses in '{flow.graph.name}'")
    yield from _within(flow, tally, confirmed=True)
    for variable, ways in _ways(flow):
        for edge in ways.definitions:
            for walk in ways.shortest(edge, tally):
                ends = flow.graph.edges[edge], flow.graph.edges[walk[-1]]
                tally.add(len(walk))
                yield Goal(CoverageRequirement(flow.label, "use", ends, variable), walk)


def du_paths(flow: Dataflow, limits: RequirementLimits | None = None) -> Iterator[Goal]:
    """Yield, for all-du-paths, each du-path.

    Raises BadRequest: there are too many; the message tells how many had been found.
    """
    tally = RequirementCounter(limits or RequirementLimits(), f"du-paths of '{flow.graph.name}'")
    yield from _within(flow, tally, confirmed=True)
    for variable, ways in _ways(flow):
        for edge in ways.definitions:
            begin = ways.targets[edge]
            for rest in simple_paths(begin, ways.targets, (ways.clear, ways.clear), ways.uses, None, tally):
                yield _du_path(flow, (edge, *rest), variable)


DATA_ASKS = {"all-defs": definitions, "all-uses": uses, "all-du-paths": du_paths}
"""Criteria over variables by name: each is a function from data flow to goals."""


@dataclass(frozen=True, slots=True)
class _Ways:
    """How one variable's values travel: for each state the edges that leave them be, and those that use them."""

    targets: list[int]
    definitions: list[int]
    clear: list[list[int]]
    uses: dict[int, list[int]]

    def shortest(self, definition: int, tally: RequirementCounter) -> Iterator[tuple[int, ...]]:
        """Yield the shortest way from a definition to each use that it reaches, nearest first."""
        came: Came[int, int] = {}

        def onward(state: int) -> Iterator[tuple[int, int]]:
            for edge in self.clear[state]:
                tally.tick()
                yield edge, self.targets[edge]

        for state in breadth_first([self.targets[definition]], onward, came):
            for use in self.uses.get(state, ()):
                yield (definition, *way_to(state, came), use)


def _ways(flow: Dataflow) -> Iterator[tuple[str, _Ways]]:
    """Yield each variable that is defined anywhere, by its first definition, with the ways of its values."""
    leaving, sources, targets = flow.graph.leaving(), flow.graph.sources.tolist(), flow.graph.targets.tolist()
    defining: dict[str, list[int]] = {}
    reading: dict[str, dict[int, list[int]]] = {}
    for edge, done in enumerate(flow.accesses):
        for variable in done.defines:
            defining.setdefault(variable, []).append(edge)
        for variable in done.reads:
            reading.setdefault(variable, {}).setdefault(sources[edge], []).append(edge)
    for variable, definitions in defining.items():
        clear, dirty = leaving.copy(), set(definitions)
        for edge in definitions:
            clear[sources[edge]] = [way for way in clear[sources[edge]] if way not in dirty]
        yield variable, _Ways(targets, definitions, clear, reading.get(variable, {}))


def _within(flow: Dataflow, tally: RequirementCounter, *, confirmed: bool) -> Iterator[Goal]:
    """Yield the du-paths of one transition, those of a definition that outlives it only if `confirmed`."""
    for edge, done in enumerate(flow.accesses):
        for variable in done.within:
            if confirmed or variable not in done.confirms:
                tally.add(1)
                yield _du_path(flow, (edge,), variable)


def _du_path(flow: Dataflow, walk: tuple[int, ...], variable: str) -> Goal:
    steps = tuple(flow.graph.edges[edge] for edge in walk)
    return Goal(CoverageRequirement(flow.label, "du-path", steps, variable), walk)
