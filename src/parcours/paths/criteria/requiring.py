"""Test requirements that a coverage criterion asks of a machine, a graph or a model.

The criteria are those of Ammann & Offutt, Introduction to Software Testing, 2008, chapter 2. Only what the graph can
reach from its start is required; guards are not solved here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, pairwise

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Cefsm, Machine, Variable
from parcours.paths.criteria.bounded import complete_paths, switches
from parcours.paths.criteria.communication import communications
from parcours.paths.criteria.dataflow import DATA_ASKS, Dataflow, dataflow
from parcours.paths.criteria.grammar import CoverageCriterion, parse_criterion
from parcours.paths.criteria.primes import prime_paths, round_trips, shortest_round_trips
from parcours.paths.criteria.requirement import CoverageRequirement, Goal, RequirementLimits
from parcours.paths.graph import Graph, Walk, graph_of


@dataclass(frozen=True, slots=True)
class CoverageSubject:
    """What is covered or measured by itself: a graph, and the machine that it is of, with its component's variables.

    `label` is its name in requirements.
    """

    label: str
    graph: Graph
    machine: Machine | None = None
    variables: tuple[Variable, ...] = ()


@dataclass(frozen=True, slots=True)
class Demand:
    """What a criterion asks of one subject.

    Attributes:
        subject: what is asked.
        graph: what the walks of the goals run on; for data criteria the subject's with an edge before its start.
        goals: the requirements, each once.
        flow: for data criteria, where variables are defined and used.
    """

    subject: CoverageSubject
    graph: Graph
    goals: tuple[Goal, ...]
    flow: Dataflow | None = None


def requirements(
    of: Machine | Graph | Cefsm, criterion: str | CoverageCriterion = "edge", *, variables: Sequence[Variable] = (),
    limits: RequirementLimits | None = None,
) -> tuple[CoverageRequirement, ...]:  # fmt: skip
    """Return what a criterion requires, each once, in the order of the graph.

    Args:
        of: a machine, the graph of a composition, or a model with all its machines.
        variables: for data criteria on a machine: those of the component that runs it.
        limits: how many requirements are too many.

    Raises BadRequest: no criterion is written like that; there are too many requirements, and how many had been found;
    or the criterion does not fit what it is asked of.
    """
    chosen = parse_criterion(criterion) if isinstance(criterion, str) else criterion
    if chosen.family == "communication":
        return communications(model_of(of, chosen), chosen.name, limits)
    return tuple(goal.requirement for each in demands(of, chosen, variables, limits) for goal in each.goals)


def demands(
    of: Machine | Graph | Cefsm,
    criterion: CoverageCriterion,
    variables: Sequence[Variable] = (),
    limits: RequirementLimits | None = None,
) -> list[Demand]:
    """Return what a criterion over graphs or over variables asks, machine by machine, as `requirements`.

    Of a model, specified walks go to the machine that has their first transition.
    """
    asked = subjects(of, variables)
    if criterion.name != "specified":
        return [_demand(subject, criterion, limits) for subject in asked]
    owner = {name: at for at, subject in enumerate(asked) for name in edge_names(subject.graph)}
    given: list[list[tuple[str, ...]]] = [[] for _ in asked]
    for walk in dict.fromkeys(criterion.walks):
        if not walk:
            rule = "each walk must have a transition, but one has none"
            raise BadRequest("coverage criterion 'specified'", rule, "leave that walk out", slug="no-walks")
        given[_owner(walk, walk[0], owner)].append(walk)
    return [
        Demand(subject, subject.graph, tuple(_specified(subject, walks)))
        for subject, walks in zip(asked, given, strict=True)
    ]


def subjects(of: Machine | Graph | Cefsm, variables: Sequence[Variable] = ()) -> list[CoverageSubject]:
    """Return what is to be covered, machine by machine; those of a model are called `Component.machine`."""
    if isinstance(of, Graph):
        return [CoverageSubject(of.name, of)]
    if isinstance(of, Machine):
        return [CoverageSubject(of.name, graph_of(of), of, tuple(variables))]
    return [
        CoverageSubject(f"{component.name}.{machine.name}", graph_of(machine), machine, component.variables)
        for component in of.components
        for machine in component.machines
    ]


def model_of(of: Machine | Graph | Cefsm, criterion: CoverageCriterion) -> Cefsm:
    """Return what was given if it is a model, which criteria over channels need. Raises BadRequest otherwise."""
    if not isinstance(of, Cefsm):
        rule = f"it looks at the channels of a model, but a {type(of).__name__.lower()} was given"
        raise BadRequest(f"coverage criterion '{criterion}'", rule, "give the model", slug="criterion-subject")
    return of


def edge_names(graph: Graph) -> tuple[str, ...]:
    """Return a name for each edge that no other edge has: where several have one, the state it leaves is added.

    >>> import numpy as np
    >>> ends = np.array([0, 1]), np.array([1, 0])
    >>> edge_names(Graph("g", ("idle", "busy"), ("tick", "tick"), *ends, (0,)))
    ('tick at idle', 'tick at busy')
    """
    often = Counter(graph.edges)
    if len(often) == len(graph.edges):
        return graph.edges
    taken = {name for name, times in often.items() if times == 1}
    found = []
    for name, source in zip(graph.edges, graph.sources.tolist(), strict=True):
        longer = name if often[name] == 1 else f"{name} at {graph.states[source]}"
        if often[name] > 1 and longer in taken:
            longer = next(each for each in (f"{longer} ({n})" for n in count(2)) if each not in taken)
        taken.add(longer)
        found.append(longer)
    return tuple(found)


def _graph_goals(
    subject: CoverageSubject, criterion: CoverageCriterion, limits: RequirementLimits | None
) -> Iterator[Goal]:
    graph = subject.graph
    match criterion.name:
        case "edge":
            yield from _walks(subject, ((edge,) for edge in range(len(graph.edges))))
        case "edge-pair" | "switch":
            yield from _walks(subject, switches(graph, criterion.number or int(criterion.name == "edge-pair"), limits))
        case "complete":
            yield from _walks(subject, complete_paths(graph, criterion.number, limits))
        case "prime" if graph.edges:
            yield from _walks(subject, prime_paths(graph, limits))
        case "complete-round-trip":
            yield from _walks(subject, round_trips(graph, limits))
        case "simple-round-trip":
            for walk in shortest_round_trips(graph, limits):
                yield Goal(
                    CoverageRequirement(subject.label, "round trip", (graph.states[graph.sources[walk[0]]],)), walk
                )
        case "tag":
            yield from _tagged(subject)
        case _:  # node; or prime without an edge, where the state by itself is the one prime path
            for state in graph.states:
                yield Goal(CoverageRequirement(subject.label, "state", (state,)), ())


def _tagged(subject: CoverageSubject) -> Iterator[Goal]:
    graph, machine = subject.graph, subject.machine
    if machine is None:
        rule = f"it looks at the tags of machines, but {graph.name!r} is a graph"
        raise BadRequest(
            "coverage criterion 'tag'", rule, "ask it of a machine, or of the model", slug="criterion-subject"
        )
    for state, tag in machine.tags:
        if state in graph.states:
            yield Goal(CoverageRequirement(subject.label, "state", (state,), tag), ())
    tags = {each.id: each.tags for each in machine.transitions}
    for edge, name in enumerate(graph.edges):
        for tag in tags[name]:
            yield Goal(CoverageRequirement(subject.label, "transitions", (name,), tag), (edge,))


def _walks(subject: CoverageSubject, walks: Iterable[Walk]) -> Iterator[Goal]:
    names = edge_names(subject.graph)
    for walk in walks:
        yield Goal(CoverageRequirement(subject.label, "transitions", tuple(names[edge] for edge in walk)), walk)


def _specified(subject: CoverageSubject, walks: Iterable[tuple[str, ...]]) -> Iterator[Goal]:
    graph = subject.graph
    number = {name: edge for edge, name in enumerate(edge_names(graph))}
    for names in walks:
        walk = tuple(_owner(names, name, number) for name in names)
        for before, after in pairwise(walk):
            if graph.targets[before] != graph.sources[after]:
                ends = graph.states[graph.targets[before]], graph.states[graph.sources[after]]
                rule = f"each transition must begin where the one before it ends, but '{graph.edges[before]}' ends in "
                rule += f"{ends[0]!r} and '{graph.edges[after]}' begins in {ends[1]!r}"
                raise BadRequest(f"walk '{' '.join(names)}'", rule, "give the transitions between", slug="broken-walk")
        yield Goal(CoverageRequirement(subject.label, "transitions", names), walk)


def _owner(walk: tuple[str, ...], name: str, owner: Mapping[str, int]) -> int:
    if name not in owner:
        rule = f"it must be made of transitions that can be reached, but {name!r} is not one"
        raise BadRequest(f"walk '{' '.join(walk)}'", rule, one_of(name, list(owner)), slug="foreign-transition")
    return owner[name]


def _demand(subject: CoverageSubject, criterion: CoverageCriterion, limits: RequirementLimits | None) -> Demand:
    if criterion.family == "graph":
        return Demand(subject, subject.graph, tuple(_graph_goals(subject, criterion, limits)))
    if criterion.family == "communication":
        rule = "it looks at the channels between machines, but one machine was given"
        raise BadRequest(f"coverage criterion '{criterion}'", rule, "cover the composition", slug="criterion-subject")
    if subject.machine is None:
        rule = f"it looks at the variables of machines, but {subject.graph.name!r} is a graph"
        remedy = "ask it of a machine, or of the model"
        raise BadRequest(f"coverage criterion '{criterion}'", rule, remedy, slug="criterion-subject")
    flow = dataflow(subject.label, subject.machine, subject.graph, subject.variables)
    return Demand(subject, flow.graph, tuple(DATA_ASKS[criterion.name](flow, limits)), flow)
