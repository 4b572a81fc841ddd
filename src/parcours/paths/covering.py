"""Few short paths that meet every requirement of a criterion (paper, section IV-B, Table III)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from parcours.errors import BadRequest, require_known
from parcours.model.structure import Cefsm, Component, Machine, Variable
from parcours.paths.criteria import CoverageCriterion, Demand, RequirementLimits, demands, parse_criterion
from parcours.paths.internal import InternalPath
from parcours.paths.visiting import Cover, Shape, cover_sequences


@dataclass(frozen=True, slots=True)
class MachineCover:
    """Paths that cover one machine of a model, and what is known of the optimum.

    Attributes:
        component, machine: whose paths.
        required: how many requirements they meet.
        paths: from the initial state of the machine.
        fewest: no cover of the same shape has fewer paths.
        shortest: no cover with as few paths as `fewest` has fewer transitions in all.
    """

    component: str
    machine: str
    required: int
    paths: tuple[InternalPath, ...]
    fewest: int
    shortest: int

    @property
    def length(self) -> int:
        """The transitions of all paths together."""
        return sum(len(path.transitions) for path in self.paths)


def cover(
    machine: Machine,
    criterion: str | CoverageCriterion = "edge",
    component: str = "",
    variables: Sequence[Variable] = (),
) -> tuple[InternalPath, ...]:
    """Return paths from the initial state that together meet the criterion.

    Args:
        component: the name of the component that runs the machine; the paths carry it.
        variables: for criteria over variables: those of the component.

    Raises BadRequest: no criterion is written like that, it requires too much, or the machine has no transition to
    walk.
    """
    alone = Cefsm(machine.name, (Component(component, (machine,), tuple(variables)),))
    (found,) = machine_covers(alone, criterion)
    return tuple(replace(path, name=f"tp{place}") for place, path in enumerate(found.paths, start=1))


def internal_paths(cefsm: Cefsm, criterion: str | CoverageCriterion = "edge") -> dict[str, tuple[InternalPath, ...]]:
    """Return for each component the paths that cover its machines, named tp<component><path> as in Table III.

    Components and paths are counted from 1 in file order. With ten or more of either, an underscore keeps the two
    numbers apart. Raises BadRequest: no criterion is written like that, it requires too much, or a machine has no
    transition to walk.
    """
    found: dict[str, list[InternalPath]] = {component.name: [] for component in cefsm.components}
    for each in machine_covers(cefsm, criterion):
        found[each.component] += each.paths
    return {name: tuple(paths) for name, paths in found.items()}


def machine_covers(
    cefsm: Cefsm, criterion: str | CoverageCriterion = "edge", *, component: str = "", machine: str = "",
    limits: RequirementLimits | None = None, shape: Shape = "tests", max_length: int | None = None,
) -> tuple[MachineCover, ...]:  # fmt: skip
    """Return a cover of each machine of a model, its paths named as `internal_paths` does.

    Args:
        component: only its machines; all if empty.
        machine: only machines of this name; all if empty.
        limits: how many requirements of one machine are too many.
        shape: tests that end in final states, or one walk a machine.
        max_length: most transitions of a path.

    Raises BadRequest: no component or machine has that name, no criterion is written like that, it requires too much, a
    machine has no transition to walk, or what is asked for is impossible.
    """
    chosen = parse_criterion(criterion) if isinstance(criterion, str) else criterion
    kept = only(cefsm, component, machine)
    owners = [(owner, each) for owner in kept.components for each in owner.machines]
    covers: list[MachineCover] = []
    for (owner, each), asked in zip(owners, demands(kept, chosen, (), limits), strict=True):
        found = cover_demand(asked, shape=shape, max_length=max_length)
        transition = {taken.id: taken for taken in each.transitions}
        edges = asked.subject.graph.edges
        paths = (tuple(transition[edges[edge]] for edge in path) for path in found.paths)
        covers.append(
            MachineCover(
                owner.name, each.name, len(asked.goals),
                tuple(InternalPath("", owner.name, each.name, path) for path in paths), found.fewest, found.shortest,
            )
        )  # fmt: skip
    return _named(cefsm, covers)


def cover_demand(demand: Demand, *, shape: Shape = "tests", max_length: int | None = None) -> Cover:
    """Return few short paths of the demand's subject that meet all its goals, as edges of the subject's graph.

    Where a requirement can be met in several ways (a round trip, a definition, a use), a shortest one was chosen
    beforehand; the optimum is then that of the chosen walks.

    Args:
        demand: what a criterion asks of a machine or of a composition.
        shape: tests that end in final states, or one walk.
        max_length: most edges of a path.

    Raises BadRequest: there is no transition to walk, or what is asked for is impossible.
    """
    graph = demand.subject.graph
    if not graph.edges:
        rule = f"must have a transition to cover, but none leaves its initial state '{graph.states[0]}'"
        remedy = "give that state a transition, or leave the machine out"
        raise BadRequest(f"machine '{graph.name}'", rule, remedy, slug="nothing-to-cover")
    number = {name: state for state, name in enumerate(demand.graph.states)}
    walks = [goal.walk for goal in demand.goals if goal.walk]
    states = [number[goal.requirement.steps[0]] for goal in demand.goals if not goal.walk]
    if demand.flow is None:
        return cover_sequences(graph, walks, states, shape=shape, max_length=max_length)
    if shape == "closed":
        rule = "a walk over variables begins with their initial values, which do not come back, but it was to be closed"
        raise BadRequest(f"machine '{graph.name}'", rule, "ask for tests or an open walk", slug="one-walk")
    # Each path begins with the edge before the start, which is no step of the machine.
    most = None if max_length is None else max_length + 1
    found = cover_sequences(demand.graph, walks, states, shape=shape, max_length=most)
    paths = tuple(tuple(edge - 1 for edge in path[1:]) for path in found.paths)
    return Cover(paths, found.fewest, max(0, found.shortest - found.fewest))


def only(cefsm: Cefsm, component: str, machine: str) -> Cefsm:
    """Return a model with the components and machines of these names only, all where a name is empty.

    Raises BadRequest: no component or machine has that name.
    """
    if component:
        require_known(component, [each.name for each in cefsm.components], "component", slug="unknown-component")
    owners = [each for each in cefsm.components if component in ("", each.name)]
    if machine:
        known = [each.name for owner in owners for each in owner.machines]
        require_known(machine, known, "machine", slug="unknown-machine")
    kept = (replace(each, machines=tuple(m for m in each.machines if machine in ("", m.name))) for each in owners)
    return replace(cefsm, components=tuple(kept))


def _named(cefsm: Cefsm, covers: Sequence[MachineCover]) -> tuple[MachineCover, ...]:
    """Return the covers with a name for each path: the number of its component in the model, and its own there."""
    first = {component.name: place for place, component in enumerate(cefsm.components, start=1)}
    count = dict.fromkeys(first, 0)
    for each in covers:
        count[each.component] += len(each.paths)
    apart = "_" if len(first) > 9 or max(count.values(), default=0) > 9 else ""
    done = dict.fromkeys(first, 0)
    named = []
    for each in covers:
        before = done[each.component]
        paths = (
            replace(path, name=f"tp{first[each.component]}{apart}{place}")
            for place, path in enumerate(each.paths, start=before + 1)
        )
        named.append(replace(each, paths=tuple(paths)))
        done[each.component] += len(each.paths)
    return tuple(named)
