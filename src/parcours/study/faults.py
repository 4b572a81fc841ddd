"""What `parcours faults STUDY` asks, and what a study that can be struck answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from parcours.report.pieces import Page, Table
from parcours.study.parameters import Settings
from parcours.study.protocol import Progress


@dataclass(frozen=True, slots=True)
class FaultRequest:
    """What is to be struck."""

    settings: Settings  # a value for each parameter of the study
    given: frozenset[str]  # names of the parameters that the user set
    seed: int  # campaign seed
    cases: int  # how many cases a fault
    only: str  # faults whose line contains this
    workers: int  # processes
    listed: bool = False  # only list the catalogue


@dataclass(frozen=True, slots=True)
class FaultReport:
    """What became of the faults: the catalogue as lines, tables, a page, JSON values."""

    catalogue: Sequence[str]
    tables: Sequence[Table] = ()
    page: Page | None = None
    document: Mapping[str, object] = field(default_factory=dict)


@runtime_checkable
class Strikeable(Protocol):
    """A study that can be put under faults."""

    def faults(self, request: FaultRequest, progress: Progress) -> FaultReport:
        """Strike, one fault at a time, and say what became of the cases."""
