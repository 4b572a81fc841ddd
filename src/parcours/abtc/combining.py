"""Test path combinations: internal paths along an interaction path, with a rendezvous at every hop (RCC).

A combination names for each visit the internal paths that run there. The rendezvous coverage criterion
(RCC) drops a combination in which two neighbours have nothing to say to each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from parcours.abtc.interactions import InteractionPath
from parcours.abtc.rendezvous import Meeting, meetings
from parcours.errors import BadRequest
from parcours.model.structure import Cefsm
from parcours.paths.covering import internal_paths
from parcours.paths.internal import InternalPath

_Choice = Mapping[str, tuple[InternalPath, ...]]  # for each component the internal paths that its visits run
_ByHop = Mapping[tuple[str, str], Sequence[Meeting]]
_Visits = tuple[tuple[InternalPath, ...], ...]

MOST_CANDIDATES = 100_000
"""How many candidate combinations of one interaction path are looked at before it is refused."""


@dataclass(frozen=True, slots=True)
class Combination:
    """Internal paths grouped by visit, with the meetings of each hop; as text (tp12, tp21, tp12), as in the paper."""

    interaction: InteractionPath
    visits: _Visits
    meetings: tuple[tuple[Meeting, ...], ...] = ()

    @property
    def references(self) -> tuple[tuple[int, InternalPath], ...]:
        """The references in order, each with the position of its visit."""
        return tuple((visit, path) for visit, paths in enumerate(self.visits) for path in paths)

    def __str__(self) -> str:
        return _spelled(self.visits)


@dataclass(frozen=True, slots=True)
class DroppedCombination:
    """A candidate that the criterion drops, and the missing rendezvous as a sentence."""

    interaction: InteractionPath
    visits: _Visits
    reason: str

    def __str__(self) -> str:
        return f"{self.interaction.name} {_spelled(self.visits)}: {self.reason}"


@dataclass(frozen=True, slots=True)
class Combinations:
    """What RCC keeps of an interaction path, and which candidates of one path per component it drops."""

    kept: tuple[Combination, ...]
    dropped: tuple[DroppedCombination, ...]


def combinations(
    cefsm: Cefsm, interaction: InteractionPath, paths: Mapping[str, Sequence[InternalPath]] | None = None
) -> Combinations:
    """Return the combinations of an interaction path that have a rendezvous at every hop, and those dropped.

    A component runs the same internal paths at each of its visits. Where no single path of a component
    serves all its hops (it receives in one and sends in another), its visits run the smallest set of paths
    that does. Components that only run side by side need no rendezvous: each choice of one path each is kept.

    Args:
        paths: for each component its internal paths; edge coverage by default.

    Raises:
        BadRequest: there are more than `MOST_CANDIDATES` candidates, or a component has no internal path.
    """
    paths = internal_paths(cefsm) if paths is None else paths
    components = list(dict.fromkeys(interaction.components))
    met = meetings(cefsm, paths)
    by_hop = {
        hop: [m for m in met if (m.sender.component, m.receiver.component) == hop]
        for hop in dict.fromkeys(interaction.hops)
    }
    sizes = prod(len(paths[name]) for name in components), prod(len(found) for found in by_hop.values())
    if (candidates := next((size for size in sizes if size > MOST_CANDIDATES), 0)) > 0:
        rule = f"may have at most {MOST_CANDIDATES} candidate combinations, but has {candidates}"
        remedy = "shorten the interaction path, or cover its components with fewer internal paths"
        raise BadRequest(f"interaction path {interaction.name}", rule, remedy, slug="too-many-combinations")
    kept: list[_Choice] = []
    dropped: list[DroppedCombination] = []
    for single in product(*(paths[name] for name in components)):
        choice: _Choice = {path.component: (path,) for path in single}
        missing = [_missing(hop, choice, found) for hop, found in by_hop.items() if not _meet(choice, found)]
        if missing:
            dropped.append(DroppedCombination(interaction, _visits(interaction, choice), "; ".join(missing)))
        else:
            kept.append(choice)
    if by_hop:
        kept += _joined(paths, by_hop, kept)
    held = [tuple(tuple(_meet(choice, by_hop[hop])) for hop in interaction.hops) for choice in kept]
    visits = [_visits(interaction, choice) for choice in kept]
    return Combinations(
        tuple(Combination(interaction, *each) for each in zip(visits, held, strict=True)), tuple(dropped)
    )


def _joined(paths: Mapping[str, Sequence[InternalPath]], by_hop: _ByHop, kept: Sequence[_Choice]) -> list[_Choice]:
    # The smallest choices of several paths a component that serve every hop.
    found: dict[frozenset[str], _Choice] = {}
    for chosen in product(*by_hop.values()):
        ends = [path for meeting in chosen for path in (meeting.sender, meeting.receiver)]
        names = frozenset(path.name for path in ends)
        owners = sorted({path.component for path in ends})
        found.setdefault(names, {owner: tuple(p for p in paths[owner] if p.name in names) for owner in owners})
    smaller = [frozenset(path.name for group in choice.values() for path in group) for choice in kept]
    joined: list[_Choice] = []
    for names in sorted(found, key=lambda names: (len(names), sorted(names))):
        if not any(least <= names for least in smaller):
            smaller.append(names)
            joined.append(found[names])
    return joined


def _meet(choice: _Choice, found: Sequence[Meeting]) -> list[Meeting]:
    # Those meetings of a hop that the chosen paths hold.
    chosen = {path.name for group in choice.values() for path in group}
    return [meeting for meeting in found if meeting.sender.name in chosen and meeting.receiver.name in chosen]


def _missing(hop: tuple[str, str], choice: _Choice, found: Sequence[Meeting]) -> str:
    (sender,), (receiver,) = choice[hop[0]], choice[hop[1]]
    lacking = f"{hop[0]} -> {hop[1]}: {sender.name} and {receiver.name} have no rendezvous"
    if not found:
        return f"{lacking}, nor have any other paths of the two"
    channels = ", ".join(dict.fromkeys(meeting.channel for meeting in found))
    others = ", ".join(dict.fromkeys(f"{m.sender.name} and {m.receiver.name}" for m in found))
    return f"{lacking} on {channels} ({others} have)"


def _visits(interaction: InteractionPath, choice: _Choice) -> _Visits:
    return tuple(choice[name] for name in interaction.components)


def _spelled(visits: _Visits) -> str:
    return f"({', '.join('+'.join(path.name for path in paths) for paths in visits)})"
