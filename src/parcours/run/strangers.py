"""Computes rows with code that may hang, die or change its process, so that each case costs its own row only.

        one span of cases: a piece             a loss is believed when nothing ran before the case in its worker, since
   ┌──────────────────────────────────┐        an earlier case may have left a thread, a timer or worse; else the case
   0  1  2  3  4  5  6  7  8  9 10 11          is computed again, the first of another worker. A death that may have
                  ╳ lost in case 5             come from outside is believed the second time
   ┌──────────────┬──┬────────────────┐
   0  1  2  3  4   5   6  7  8  9 10 11        what is found at the end of a piece only, or in a worker that does
                                               not say where it is: each case becomes a piece of its own

What follows a loss is computed in another worker. The rows come back to this process, which alone writes.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import signal
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.heartbeat import LostCase, Renumbered, RunsStrangers
from parcours.run.workers import Crew, Done, Lost, failure_of

Rows = NDArray[np.void]
Simulate = Callable[[int, int], Rows]
"""(first case, how many) -> their results, shape (how many,)."""

_ATTEMPTS = 2
_FROM_OUTSIDE = (-signal.SIGKILL, -signal.SIGTERM)
"""Status of a process that something else has ended: for want of memory, say."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """Consecutive cases of a span, and those of them that are lost."""

    span: int
    first: int
    count: int
    lost: tuple[LostCase, ...] = ()

    def parts(self, *, at: int) -> tuple[_Piece, ...]:
        """Return what lies before a place of it, the place alone, and what lies behind it."""
        before, behind = at - self.first, self.first + self.count - at - 1
        cut = (replace(self, count=before), replace(self, first=at, count=1))
        return tuple(one for one in (*cut, replace(self, first=at + 1, count=behind)) if one.count)

    def singles(self) -> tuple[_Piece, ...]:
        """Return each of its cases as a piece."""
        return tuple(replace(self, first=k, count=1) for k in range(self.first, self.first + self.count))


@dataclass(frozen=True, slots=True)
class _Compute:
    """Computes a piece in a worker."""

    simulate: Simulate | str

    def __call__(self, first: int, count: int, lost: tuple[LostCase, ...]) -> Rows:
        function: object = resolve(self.simulate) if isinstance(self.simulate, str) else self.simulate
        if lost and isinstance(function, RunsStrangers):
            function = function.without(lost)
        return cast(Simulate, function)(first, count)


class _Work:
    """What is still to be computed of some spans, and what is known of it."""

    def __init__(self, function: object, spans: Sequence[range], crew: Crew[Rows]) -> None:
        self._function, self._spans, self._crew = function, spans, crew
        self._pieces: list[_Piece] = []
        self._rows: list[dict[int, Rows]] = [{} for _ in spans]
        self._deaths, self._tries = Counter[int](), Counter[tuple[int, int, int]]()
        self._add([_Piece(k, span.start, len(span)) for k, span in enumerate(spans)], first=False)

    def _add(self, pieces: Sequence[_Piece], *, first: bool = True) -> None:
        items = []
        for piece in pieces:
            items.append((len(self._pieces), (piece.first, piece.count, piece.lost)))
            self._pieces.append(piece)
        if first:
            self._crew.pending.extendleft(reversed(items))
        else:
            self._crew.pending.extend(items)

    def span_of(self, key: int) -> int:
        """Return the span of a piece."""
        return self._pieces[key].span

    def keep(self, key: int, rows: Rows) -> Rows | None:
        """Keep the rows of a piece; return those of its span if that is complete."""
        piece = self._pieces[key]
        kept, span = self._rows[piece.span], self._spans[piece.span]
        if np.shape(rows) != (piece.count,):
            return rows  # of the wrong form: complained about where they are written
        kept[piece.first] = rows
        if sum(map(len, kept.values())) < len(span):
            return None
        parts = [kept.pop(first) for first in sorted(kept)]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def lose(self, key: int, answer: Lost) -> str:
        """Order what is to be computed instead of a piece that was lost; or say why there is nothing to be done."""
        piece = self._pieces[key]
        numbers = self._numbers(piece)
        case = answer.case if answer.case is not None and answer.case.number in numbers else None
        if case is None and answer.entered and piece.count == 1:
            case = LostCase(numbers[0], None, answer.how, answer.place if answer.how == "tampered" else answer.ending,
                            answer.place)  # fmt: skip
        if case is not None:
            at = piece.first + numbers.index(case.number)
            alone = answer.fresh and at == piece.first
            self._deaths[case.number] += alone
            from_outside = answer.how == "died" and not answer.silent and answer.status in _FROM_OUTSIDE
            case = replace(case, time=None) if from_outside else case
            sure = alone and (not from_outside or self._deaths[case.number] >= _ATTEMPTS)
            parts = piece.parts(at=at)
            self._add([replace(one, lost=(case,)) if sure and one.first == at else one for one in parts])
            if not sure:
                self._crew.apart.add(len(self._pieces) - len(parts) + (at > piece.first))
            return ""
        if answer.entered and piece.count > 1:
            self._add(piece.singles())
            return ""
        tried = (piece.span, piece.first, piece.count)
        self._tries[tried] += 1
        if self._tries[tried] < _ATTEMPTS and (answer.how == "died" or not answer.fresh):
            self._crew.apart.add(len(self._pieces))
            self._add([piece])
            return ""
        if answer.how == "tampered":
            return answer.place
        what = "gave no sign of life" if answer.how == "hung" else answer.ending
        return f"{what}, in {answer.place}" if answer.place else what

    def _numbers(self, piece: _Piece) -> list[int]:
        span = range(piece.first, piece.first + piece.count)
        if isinstance(self._function, Renumbered):
            return [self._function.numbers[k] for k in span]
        return list(span)


def computed(
    simulate: Simulate | str,
    spans: Sequence[range],
    workers: int,
    name: Callable[[int], str],
    *,
    forks: bool,
    crew: Crew[Rows] | None = None,
) -> Generator[tuple[int, Rows], None, None]:
    """Yield (span, its rows) as they are complete: where strangers' code costs a case, as the function says of it.

    After a failure no further piece is started, those in progress are finished, and then it is raised. Leaving the
    iterator early stops the workers.

    Args:
        simulate: a function that runs strangers' code (`parcours.run.heartbeat.RunsStrangers`), or its name; picklable,
            unless workers are forked.
        spans: consecutive cases each.
        workers: how many processes.
        name: what to call a span in a message.
        forks: whether workers are forked of this process; see `Crew`.
        crew: that `crew_for` made of the same function, and that is kept by the caller; by default one that ends here.

    Raises:
        HostFailure: the function raised, or a worker died or hung before it had reached a case.
        ParcoursError: an error of ours that it raised.
    """
    function: object = resolve(simulate) if isinstance(simulate, str) else simulate
    failure: ParcoursError | None = None
    kept, crew = crew is not None, crew or crew_for(simulate, workers, forks=forks)
    with contextlib.nullcontext() if kept else contextlib.closing(crew):
        work = _Work(function, spans, crew)
        for key, answer in crew.answers():
            span = work.span_of(key)
            if isinstance(answer, Done):
                rows = work.keep(key, answer.result)
                if rows is not None:
                    yield span, rows
            elif isinstance(answer, Lost):
                why = work.lose(key, answer)
                failure = failure or (lost_before(name(span), why) if why else None)
            else:
                failure = failure or failure_of(name(span), answer)
            if failure is not None:
                crew.pending.clear()
    if failure is not None:
        raise failure


def crew_for(simulate: Simulate | str, workers: int, *, forks: bool) -> Crew[Rows]:
    """Return processes that compute cases of a function that runs strangers' code. Close them in the end."""
    function: object = resolve(simulate) if isinstance(simulate, str) else simulate
    assert isinstance(function, RunsStrangers)
    patience = float(getattr(function, "patience_to_load", math.inf))
    return Crew(
        _Compute(simulate), workers, forks=forks, n_words=function.heartbeat_words, patience=patience, strangers=True
    )


def lost_before(name: str, why: str) -> HostFailure:
    """Return the complaint that a worker was lost before it had reached a case."""
    remedy = "run these cases with one worker to see why; all other shards are kept"
    return HostFailure(name, f"must be computed, but its worker {why}", remedy, slug="worker-died")


def resolve(dotted: str) -> Simulate:
    """Return the function of a name `module:function`. Raises BadRequest if there is none."""
    module, _, attribute = dotted.partition(":")
    try:
        function: Simulate = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        rule = f"must be 'module:function' of something importable, but: {error}"
        raise BadRequest(f"simulate {dotted!r}", rule, slug="simulate-name") from error
    return function
