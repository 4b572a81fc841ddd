"""Abstract behavioural test cases (ABTCs) of test path combinations, by a reconstructed serialization (RSA).

The paper applies RSA but does not print it. Here every path of a combination starts when the path before it
stands at one of its serialization points; each choice of points is one ABTC.

    tp41   ●──p41──●──p42──●        points 0, 1, 2: each choice of one is a case
                   │
    tp42           ●──p44──●──p45──●      started at point 1: start vector (0, 1)

For obstacles this is the authors' own public enumeration of start offsets; for components it is a
reconstruction that reproduces the paper's totals.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice, pairwise, product
from math import prod

from parcours.abtc.combining import Combination, combinations
from parcours.abtc.interactions import InteractionPath, hub, interaction_paths
from parcours.abtc.rendezvous import sends_on
from parcours.errors import BadRequest, one_of, require_known
from parcours.model.structure import Cefsm
from parcours.paths.covering import internal_paths
from parcours.paths.internal import InternalPath


def _all_states(path: InternalPath) -> tuple[int, ...]:
    return (0, *(place + 1 for place in path.changes))


def _before_return(path: InternalPath) -> tuple[int, ...]:
    marks = _all_states(path)
    return marks[:-1] if path.is_closed and path.changes else marks


def _distinct_states(path: InternalPath) -> tuple[int, ...]:
    return tuple(path.states.index(state) for state in dict.fromkeys(path.states))


def _every_transition(path: InternalPath) -> tuple[int, ...]:
    return tuple(range(len(path.transitions) + 1))


@dataclass(frozen=True, slots=True)
class Policy:
    """Which serialization points of a path count, as numbers of transitions taken.

    `marks` gives the points of a path that meets nobody, `met` (by default the same) those of one that does.
    With `hub_at_request`, the hub's paths have a single point instead: their request to the next component.
    """

    doc: str
    marks: Callable[[InternalPath], tuple[int, ...]]
    met: Callable[[InternalPath], tuple[int, ...]] | None = None
    hub_at_request: bool = False


DEFAULT = "hub"
"""The policy that yields the paper's 19 + 48 = 67 component cases and 9 obstacle start vectors."""

POLICIES: dict[str, Policy] = {
    "hub": Policy(
        "a hub's request; every state of a path that meets nobody; of others, all states but the return",
        _all_states, met=_before_return, hub_at_request=True,
    ),
    "all-states": Policy("every state the path comes to, the final one included", _all_states),
    "before-return": Policy("every state the path comes to before it returns to where it began", _before_return),
    "distinct-states": Policy("each state once, where the path first comes to it", _distinct_states),
    "every-transition": Policy("before and after every transition, loops included", _every_transition),
}  # fmt: skip
"""Point policies by name."""


@dataclass(frozen=True, slots=True)
class Start:
    """When a reference starts: once reference `after` has taken `done` transitions; at once if that is None.

    It starts while that reference still stands at the point: before it has taken more than `until`
    transitions.
    """

    after: int | None = None
    done: int = 0
    until: int | None = None


@dataclass(frozen=True, slots=True)
class AbstractCase:
    """An abstract behavioural test case: a combination, and when each of its paths starts.

    `start_vector` has one number for each reference: how many serialization points had been passed, along
    the chain of references before it, when it starts. (0, 1, 3): the second starts at point 1 of the first,
    the third at point 2 of the second. `starts` says the same in transitions, for the executing host.
    """

    id: str
    combination: Combination
    start_vector: tuple[int, ...]
    starts: tuple[Start, ...]
    policy: str = DEFAULT

    @property
    def interaction(self) -> InteractionPath:
        """The interaction test path (ITP) that the case belongs to."""
        return self.combination.interaction


def abstract_cases(
    cefsm: Cefsm,
    policy: str | None = None,
    interactions: Sequence[InteractionPath] | None = None,
    paths: Mapping[str, Sequence[InternalPath]] | None = None,
) -> Iterator[AbstractCase]:
    """Yield the ABTCs of a model one by one, ITP by ITP, last start point fastest; memory stays flat.

    Args:
        policy: the point policy, a name in `POLICIES`; by default the one the model names.
        interactions: by default all of `interaction_paths(cefsm)`.
        paths: the internal paths of each component; by default `internal_paths(cefsm)`, edge coverage.

    Raises:
        BadRequest: no policy has that name, or an interaction path has too many combinations.
    """
    name = policy or cefsm.serialisation or DEFAULT
    for combination in _all_combinations(cefsm, interactions, paths):
        places = _places(cefsm, combination, name)
        for chosen in product(*(range(len(points)) for points in places[:-1])):
            yield _case(combination, places, chosen, name)


def case_counts(cefsm: Cefsm, policy: str | None = None) -> dict[str, int]:
    """Return how many ABTCs each interaction path has, without enumerating them. Raises as `abstract_cases`."""
    counts = {interaction.name: 0 for interaction in interaction_paths(cefsm)}
    for combination in _all_combinations(cefsm):
        places = _places(cefsm, combination, policy or cefsm.serialisation or DEFAULT)
        counts[combination.interaction.name] += prod(map(len, places[:-1]))
    return counts


def find_case(cefsm: Cefsm, id: str) -> AbstractCase:
    """Return the ABTC that has an id, which says its policy too, without making the others.

    Raises:
        BadRequest: no case of the model has that id.
    """
    for combination in _all_combinations(cefsm):
        head = _spelled(combination)
        if id.startswith(head):
            spelled, _, named = id.removeprefix(head).partition("-")
            name = named or DEFAULT
            numbers = [int(part) for part in re.split("[.+]", spelled) if part.isascii() and part.isdigit()]
            if name in POLICIES and len(numbers) == len(combination.references):
                places = _places(cefsm, combination, name)
                chosen = tuple(later - earlier for earlier, later in pairwise(numbers))
                if all(0 <= point < len(points) for points, point in zip(places, chosen, strict=False)):
                    found = _case(combination, places, chosen, name)
                    if found.id == id:
                        return found
    near = [case.id for case in islice(abstract_cases(cefsm), 5)]
    raise BadRequest("abtc", f"no case is called {id!r}", one_of(id, near), slug="unknown-abstract")


def _spelled(combination: Combination) -> str:
    # How the ids of all cases of a combination begin.
    paths = ".".join("+".join(path.name for path in visit) for visit in combination.visits)
    return f"{combination.interaction.name}-{paths}-"


def _case(
    combination: Combination, places: Sequence[tuple[Start, ...]], chosen: Sequence[int], policy: str
) -> AbstractCase:
    # The id is stable and fit for a file name: interaction, combination, start vector, policy unless the default.
    # The vector is grouped like the combination: ITP4-tp11.tp41+tp42.tp11-0.0+3.4 is ITP4 with tp42 three points
    # after tp41, and the last tp11 one point later.
    vector = (0, *accumulate(chosen))
    numbers = iter(vector)
    shown = ".".join("+".join(str(next(numbers)) for _ in visit) for visit in combination.visits)
    id = f"{_spelled(combination)}{shown}{'' if policy == DEFAULT else f'-{policy}'}"
    starts = (Start(), *(points[point] for points, point in zip(places, chosen, strict=False)))
    return AbstractCase(id, combination, vector, starts, policy)


def _all_combinations(
    cefsm: Cefsm,
    interactions: Sequence[InteractionPath] | None = None,
    paths: Mapping[str, Sequence[InternalPath]] | None = None,
) -> Iterator[Combination]:
    found = internal_paths(cefsm) if paths is None else paths
    for interaction in interaction_paths(cefsm) if interactions is None else interactions:
        yield from combinations(cefsm, interaction, found).kept


def _places(cefsm: Cefsm, combination: Combination, name: str) -> list[tuple[Start, ...]]:
    # The points of each reference, as starts of the next one. The paths of the last visit, and those of a hub that
    # waits at its request, start together: one point each.
    require_known(name, list(POLICIES), "serialization policy", slug="unknown-policy")
    rule, centre = POLICIES[name], hub(cefsm) if combination.meetings else None
    marks = rule.met if rule.met and combination.meetings else rule.marks
    last = len(combination.visits) - 1
    places: list[tuple[Start, ...]] = []
    for reference, (visit, path) in enumerate(combination.references):
        at_hub = rule.hub_at_request and path.component == centre
        closing = path is combination.visits[visit][-1]
        if visit == last or (at_hub and not closing):
            places.append((Start(reference, 0),))
        elif at_hub:
            places.append((_request(combination, visit, reference),))
        else:
            places.append(_stands(reference, path, marks(path)))
    return places


def _stands(reference: int, path: InternalPath, marks: Sequence[int]) -> tuple[Start, ...]:
    # A point lasts until the path leaves its state or comes to the next point. Point 0 means together: both set
    # off at once, and neither waits for the other.
    starts = []
    for number, done in enumerate(marks):
        ends = [place for place in path.changes if place >= done] + [mark - 1 for mark in marks[number + 1 :]]
        starts.append(Start(reference, done, min(ends) if done and ends else None))
    return tuple(starts)


def _request(combination: Combination, visit: int, closing: int) -> Start:
    # The next visit starts straight after this visit's first send to it.
    group = combination.visits[visit]
    first = closing - len(group) + 1
    done, sender = min(
        (place + 1, group.index(meeting.sender))
        for meeting in combination.meetings[visit]
        for place, transition in enumerate(meeting.sender.transitions)
        if sends_on(transition, meeting.channel)
    )
    return Start(first + sender, done)


def _drawn(path: InternalPath) -> str:
    arrows = "".join(f" -{transition.id}-> {transition.target}" for transition in path.transitions)
    return f"{path.name}[{path.states[0] if path.states else ''}{arrows}]"


def notation(of: AbstractCase | Combination, title: str = "") -> str:
    """Return a combination in the notation of Table V, one visit per line.

    The paper draws the double bar above the arrow between two references: they run concurrently, in this order.
    Here that arrow is `-||->`; paths that share a visit stand in braces. Of a case the start vector is added where
    it is not all zero. `title` is what the paper calls the case, such as ABTC1.
    """
    combination = of.combination if isinstance(of, AbstractCase) else of
    head = f"Combination {combination.interaction.name} {combination}{f' = {title}' if title else ''}:"
    between = "\n || " if not combination.meetings else "\n -||-> "
    visits = [" || ".join(map(_drawn, paths)) for paths in combination.visits]
    grouped = [
        f"{{{text}}}" if len(paths) > 1 else text for text, paths in zip(visits, combination.visits, strict=True)
    ]
    body = f"({between.join(grouped)})"
    if isinstance(of, AbstractCase) and any(of.start_vector):
        return f"{head}\n{body}\nstarting at ({', '.join(map(str, of.start_vector))})"
    return f"{head}\n{body}"
