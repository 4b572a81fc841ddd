"""RAMP's channels and components -> a catalogue of what may go wrong with each, in two or three strengths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal

from parcours.errors import BadRequest
from parcours.run.faults import Fault, parse_fault

Group = Literal["topics", "services", "components"]

TOPICS = ("obstacles", "best_trajectory", "update", "imminent_collision", "pose", "cmd_vel")
"""The channels on which messages are sent unasked. Two more have fewer entries: `odometry` carries what `obstacles`
does, and on `speed_limit` only the guarded schedule sends."""

SERVICES = (
    "trajectory_request",
    "trajectory_response",
    "evaluation_request",
    "evaluation_response",
    "modification_request",
    "modification_response",
)  # The channels of the three services: the planner waits for each answer

COMPONENTS = ("Planner", "Control", "Sensing", "TrajectoryGenerator", "TrajectoryEvaluation", "PathModification")
"""What can be struck; the world and the witness cannot."""

_OF_TOPICS = (
    "drop 30 % from 2 s", "drop from 3 s to 6 s", "delay 100 ms from 2 s", "delay 500 ms from 2 s",
    "jitter 200 ms from 2 s", "duplicate 30 % from 2 s", "reorder 30 % by 200 ms from 2 s", "corrupt 5 % from 2 s",
)  # fmt: skip
_OF_OTHERS = (
    "odometry: drop from 3 s", "odometry: corrupt 5 % from 2 s", "speed_limit: drop from 2 s",
    "speed_limit: delay 500 ms from 2 s",
)  # fmt: skip
_OF_SERVICES = ("drop 1 % from 2 s", "delay 20 ms from 2 s", "duplicate 5 % from 2 s", "corrupt 1 % from 2 s")
_OF_COMPONENTS = (
    "crash at 3 s", "crash at 8 s", "freeze at 4 s for 500 ms", "freeze at 4 s for 3 s", "slow down 20 x at 2 s",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class CatalogueEntry:
    """One row of the catalogue: which group it belongs to, and the fault."""

    group: Group
    fault: Fault

    @property
    def target(self) -> str:
        """The channel or component that is struck."""
        return str(self.fault).partition(":")[0]

    def __str__(self) -> str:
        return str(self.fault)


@cache
def catalogue() -> tuple[CatalogueEntry, ...]:
    """Return all entries."""
    return tuple(_entries())


def _entries() -> Iterator[CatalogueEntry]:
    for topic in TOPICS:
        yield from (CatalogueEntry("topics", parse_fault(f"{topic}: {what}")) for what in _OF_TOPICS)
    yield from (CatalogueEntry("topics", parse_fault(line)) for line in _OF_OTHERS)
    for service in SERVICES:
        yield from (CatalogueEntry("services", parse_fault(f"{service}: {what}")) for what in _OF_SERVICES)
    for component in COMPONENTS:
        yield from (CatalogueEntry("components", parse_fault(f"{component}: {what}")) for what in _OF_COMPONENTS)


def chosen(only: str) -> tuple[CatalogueEntry, ...]:
    """Return the entries whose line contains the text; all if it is empty.

    Raises BadRequest: no entry contains it.
    """
    found = tuple(entry for entry in catalogue() if only.lower() in str(entry).lower())
    if not found:
        rule = f"no fault of the catalogue contains {only!r}"
        remedy = f"name a channel or component: {', '.join((*TOPICS, *SERVICES, *COMPONENTS))}; or a kind"
        raise BadRequest("faults, only", rule, remedy, slug="fault-only")
    return found
