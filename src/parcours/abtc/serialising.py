"""Test path combinations -> abstract behavioural test cases (ABTCs), by a reconstructed serialization (RSA).

The paper applies RSA but does not print it. Here every path of a combination starts when the path before it
stands at one of its serialization points; each choice of points is one ABTC. For obstacles this is the
authors' own public enumeration of start offsets; for components it is a reconstruction that reproduces the
paper's totals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice, pairwise, product
from math import prod

from parcours.abtc.combining import Combination, combinations
from parcours.abtc.interactions import InteractionPath, hub, interaction_paths
from parcours.abtc.points import DEFAULT, POLICIES, policy
from parcours.abtc.rendezvous import sends_on
from parcours.errors import BadRequest, one_of
from parcours.model.structure import Cefsm
from parcours.paths.covering import internal_paths
from parcours.paths.internal import InternalPath


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
    the chain of references before it, when it starts. (0, 1, 3) reads: the second starts at point 1 of the
    first, the third at point 2 of the second. `starts` says the same in transitions, for whoever executes
    the case.
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


@dataclass(frozen=True, slots=True)
class _Place:
    """A reference with its points, each as the start of the next reference that this point stands for."""

    visit: int
    path: InternalPath
    points: tuple[Start, ...]


def abstract_cases(
    cefsm: Cefsm,
    policy: str | None = None,
    interactions: Sequence[InteractionPath] | None = None,
    paths: Mapping[str, Sequence[InternalPath]] | None = None,
) -> Iterator[AbstractCase]:
    """Yield the ABTCs of a model one by one, ITP by ITP, last start point fastest; memory stays flat.

    Args:
        cefsm: the model.
        policy: the point policy, a name in `parcours.abtc.points.POLICIES`; by default the one the model names.
        interactions: the interaction paths to serialise; by default all of `interaction_paths(cefsm)`.
        paths: the internal paths of each component; by default `internal_paths(cefsm)`, edge coverage.

    Raises:
        BadRequest: no policy has that name, or an interaction path has too many combinations.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> next(abstract_cases(ramp)).id
    'ITP1-tp12.tp21.tp12-0.0.0'
    """
    for combination in _all_combinations(cefsm, interactions, paths):
        yield from serialisations(cefsm, combination, policy or cefsm.serialisation or DEFAULT)


def case_counts(cefsm: Cefsm, policy: str | None = None) -> dict[str, int]:
    """Return how many ABTCs each interaction path has, without enumerating them.

    Args:
        cefsm: the model.
        policy: the point policy, a name in `parcours.abtc.points.POLICIES`.

    Raises:
        BadRequest: no policy has that name, or an interaction path has too many combinations.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> case_counts(ramp)
    {'ITP1': 3, 'ITP2': 3, 'ITP3': 3, 'ITP4': 10, 'ITP5': 18, 'ITP6': 30}
    """
    counts = {interaction.name: 0 for interaction in interaction_paths(cefsm)}
    for combination in _all_combinations(cefsm):
        places = _places(cefsm, combination, policy or cefsm.serialisation or DEFAULT)
        counts[combination.interaction.name] += prod(len(place.points) for place in places[:-1])
    return counts


def serialisations(cefsm: Cefsm, combination: Combination, policy: str = DEFAULT) -> Iterator[AbstractCase]:
    """Yield the ABTCs of one combination, in lexicographic order of their start vectors.

    Args:
        cefsm: the model, which says which component is the hub.
        combination: an RCC combination.
        policy: the point policy, a name in `parcours.abtc.points.POLICIES`.

    Raises:
        BadRequest: no policy has that name.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> from parcours.abtc.interactions import interaction_paths
    >>> (combination,) = combinations(ramp, interaction_paths(ramp)[0]).kept
    >>> [case.start_vector for case in serialisations(ramp, combination)]
    [(0, 0, 0), (0, 0, 1), (0, 0, 2)]
    """
    places = _places(cefsm, combination, policy)
    for chosen in product(*(range(len(place.points)) for place in places[:-1])):
        yield _case(combination, places, chosen, policy)


def find_case(cefsm: Cefsm, id: str) -> AbstractCase:
    """Return the ABTC that has an id, without making the others. The id says its policy, too.

    Args:
        cefsm: the model.
        id: as `case_id` spells it.

    Raises:
        BadRequest: no case of the model has that id.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> find_case(ramp, "ITP4-tp11.tp41+tp42.tp11-0.0+3.4").start_vector
    (0, 0, 3, 4)
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
                if all(0 <= point < len(place.points) for place, point in zip(places, chosen, strict=False)):
                    found = _case(combination, places, chosen, name)
                    if found.id == id:
                        return found
    near = [case.id for case in islice(abstract_cases(cefsm), 5)]
    raise BadRequest("abtc", f"no case is called {id!r}", one_of(id, near), slug="unknown-abstract")


def case_id(combination: Combination, start_vector: Sequence[int], policy: str = DEFAULT) -> str:
    """Return the stable id of an ABTC, fit for a file name: interaction, combination, start vector.

    A policy other than the default is named at the end. The vector is grouped like the combination: dots
    part visits, plus signs part the paths of one visit. So ITP4-tp11.tp41+tp42.tp11-0.0+3.4 is ITP4 with
    tp42 three points after tp41, and the last tp11 one point later.
    """
    numbers = iter(start_vector)
    vector = ".".join("+".join(str(next(numbers)) for _ in visit) for visit in combination.visits)
    tail = "" if policy == DEFAULT else f"-{policy}"
    return f"{_spelled(combination)}{vector}{tail}"


def _spelled(combination: Combination) -> str:
    # How the ids of all cases of a combination begin.
    paths = ".".join("+".join(path.name for path in visit) for visit in combination.visits)
    return f"{combination.interaction.name}-{paths}-"


def _case(combination: Combination, places: Sequence[_Place], chosen: Sequence[int], policy: str) -> AbstractCase:
    vector = (0, *accumulate(chosen))
    starts = (Start(), *(place.points[point] for place, point in zip(places, chosen, strict=False)))
    return AbstractCase(case_id(combination, vector, policy), combination, vector, starts, policy)


def _all_combinations(
    cefsm: Cefsm,
    interactions: Sequence[InteractionPath] | None = None,
    paths: Mapping[str, Sequence[InternalPath]] | None = None,
) -> Iterator[Combination]:
    found = internal_paths(cefsm) if paths is None else paths
    for interaction in interaction_paths(cefsm) if interactions is None else interactions:
        yield from combinations(cefsm, interaction, found).kept


def _places(cefsm: Cefsm, combination: Combination, name: str) -> list[_Place]:
    """Return the references with their points.

    The paths of the last visit, and those of a hub that waits at its request, start together: one point each.
    """
    rule, centre = policy(name), hub(cefsm) if combination.meetings else None
    last = len(combination.visits) - 1
    places: list[_Place] = []
    for reference, (visit, path) in enumerate(combination.references):
        at_hub = rule.hub_at_request and path.component == centre
        closing = path is combination.visits[visit][-1]
        if visit == last or (at_hub and not closing):
            points: tuple[Start, ...] = (Start(reference, 0),)
        elif at_hub:
            points = (_request(combination, visit, reference),)
        else:
            points = _stands(reference, path, rule.marks(path, bool(combination.meetings)))
        places.append(_Place(visit, path, points))
    return places


def _stands(reference: int, path: InternalPath, marks: Sequence[int]) -> tuple[Start, ...]:
    """Return the points as starts; a point lasts until the path leaves its state or comes to the next point.

    Point 0 means together: both set off at once, and neither waits for the other.
    """
    starts = []
    for number, done in enumerate(marks):
        ends = [place for place in path.changes if place >= done] + [mark - 1 for mark in marks[number + 1 :]]
        starts.append(Start(reference, done, min(ends) if done and ends else None))
    return tuple(starts)


def _request(combination: Combination, visit: int, closing: int) -> Start:
    """Return the start of the next visit: straight after this visit's first send to it."""
    group = combination.visits[visit]
    first = closing - len(group) + 1
    done, sender = min(
        (place + 1, group.index(meeting.sender))
        for meeting in combination.meetings[visit]
        for place, transition in enumerate(meeting.sender.transitions)
        if sends_on(transition, meeting.channel)
    )
    return Start(first + sender, done)
