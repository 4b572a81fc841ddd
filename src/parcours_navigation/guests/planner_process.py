"""Asks a planner that others wrote, in a process of its own: who it is, and what becomes of cases outside a campaign.

    this process                         a worker, gone afterwards
      | introduce("mine.py:Mine") ------->|  imports it, constructs it
      |<------ Introduction --------------|
      | rows_of, track_of --------------->|  runs the cases
      |<------ facts, tracks -------------|

No line of the planner runs in this process.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from parcours.errors import BadRequest, BadResults
from parcours.run import canaries as canaries
from parcours.run.heartbeat import write_place
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours.study.loading import SourceFile
from parcours_navigation.guests.planners import load_planner, loaded, located, source_of

LOADING = 20.0
"""So long the import and the constructor of a planner may take at least [s of wall clock]."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Introduction:
    """What there is to know of a planner without a line of it in this process."""

    planner: str  # under which a worker finds it, whatever its current folder
    file: str  # its source file, "" if it belongs to a package's entry point, or is no Python file
    text: bytes = field(repr=False)  # what the file held before it was imported
    has_reset: bool
    needs: tuple[str, ...]  # some of `protocol.SENSES`
    batch_size: int = 0  # cases that it is asked for at once; 0: one at a time

    @property
    def source(self) -> SourceFile | None:
        """The source that every worker is to import, whatever the planner makes of its file; None without a file."""
        return SourceFile(Path(self.file), self.text) if self.file else None


def introduce(planner: str, patience: float = LOADING) -> Introduction:
    """Return what a planner says of itself in a process of its own, in which it may take `patience` [s].

    Raises:
        BadRequest: the name leads nowhere, the planner has not the form of one, its import or constructor raised, did
            not come to an end, ended their process, or changed what others rely on.
    """
    return _asked(planner, _meet, patience, Introduction)


def has_own_loop(planner: str) -> bool:
    """Return whether an entry point names a planner with a loop of its own. Raises BadRequest as `introduce`."""
    return _asked(planner, _looks_for_loop, LOADING, bool)


def _asked(planner: str, ask: Callable[[str], T], patience: float, kind: type[T]) -> T:
    with contextlib.closing(Crew(ask, 1, forks=True, patience=patience, strangers=True)) as crew:
        crew.pending.append((0, (planner,)))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Done) and isinstance(answer.result, kind):
        return answer.result
    where = f"planner {planner!r}"
    if isinstance(answer, Done):
        raise BadRequest(where, "it must not answer for Parcours, but did", slug="planner-ends-process")
    if not isinstance(answer, Lost):
        raise failure_of(where, answer, "planner-raised")
    what = answer.place or "its module"
    if answer.how == "hung":
        rule, remedy = f"{what} must come to an end, but did not within {patience:g} s", "look for endless loops there"
    elif answer.how == "tampered":
        rule, remedy = f"loading it must leave the process as it is, but {answer.place}", "patch nothing"
    else:
        rule = f"{what} must leave its process alone, but the process {answer.ending}"
        remedy = "look for calls of os._exit, and for crashes of compiled code"
    raise BadRequest(where, rule, remedy, slug="planner-ends-process")


def _meet(planner: str) -> Introduction:
    write_place("its module")
    found_as, source = str(located(planner)), source_of(planner)
    plugin = load_planner(planner, source)
    canaries.accept()
    file, text = (str(source.path), source.text) if source is not None else ("", b"")
    return Introduction(found_as, file, text, plugin.reset is not None, plugin.needs,
                        plugin.batch.size if plugin.batch is not None else 0)  # fmt: skip


def _looks_for_loop(planner: str) -> bool:
    write_place("its module")
    return hasattr(loaded(planner), "study_of")


def done_apart(where: str, work: Callable[[], T], *, n_words: int, patience: float, forks: bool) -> T:
    """Return what a function gives in a process of its own, in which it says where it is (`parcours.run.heartbeat`).

    Raises:
        BadResults: the process hung or died.
        HostFailure: it raised; ParcoursError: one of ours.
    """
    crew: Crew[Any] = Crew(work, 1, forks=forks, n_words=n_words, patience=patience, strangers=True)
    with contextlib.closing(crew):
        crew.pending.append((0, ()))
        [(_, answer)] = crew.answers()
    if isinstance(answer, Done):
        return answer.result  # type: ignore[no-any-return]
    if not isinstance(answer, Lost):
        raise failure_of(where, answer)
    what = {"hung": "the planner hung", "died": f"its process {answer.ending}"}.get(answer.how, answer.place)
    rule = f"there is nothing to see of it: {what}"
    raise BadResults(where, rule, "replay another case", slug="replay-lost")
