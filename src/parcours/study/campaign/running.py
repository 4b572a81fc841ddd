"""Runs a campaign in a folder: numbered cases in shards, by any number of workers; all, or chosen ones.

A campaign of chosen cases keeps their numbers in its parameters: its k-th row is the k-th chosen case.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadResults
from parcours.run.campaign import Prepares, run_campaign
from parcours.run.heartbeat import LostCase, RunsStrangers
from parcours.run.store import MANIFEST, Campaign, Store
from parcours.study.journal import write_question
from parcours.study.protocol import Progress, Request, Run
from parcours.study.stopping import Rates, Watch, pairs_wanted, parse_rule

CHOSEN = "chosen"  # the parameter of a campaign that holds the numbers of its cases, where they are not 0, 1, 2, ...
_SPOKEN = 1.0  # for how long [s] what a run has said of its rates holds

Wanted = Callable[[str], bool]
"""Says of a field of facts, by its name, whether it is to be read."""


class Numbered(Protocol):
    """What simulates numbered cases."""

    def run(self, numbers: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the facts of the cases of these numbers."""

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """The same cases, counted from 0 in the order in which they were chosen."""

    study: Numbered
    numbers: tuple[int, ...]

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the facts of the chosen cases from the `first` on."""
        return self.study.run(np.array(self.numbers[first : first + count], np.int64))

    def prepare(self) -> bool:
        """Load or compile what every case needs; return whether all of it is ours."""
        return self.study.prepare() if isinstance(self.study, Prepares) else False

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent: none if nothing in it may hang or die."""
        return self.study.heartbeat_words if isinstance(self.study, RunsStrangers) else 0

    @property
    def patience_to_load(self) -> float:
        """How long a worker may give no sign of life while it is on no case [s]."""
        return float(getattr(self.study, "patience_to_load", math.inf))

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same without the lost cases."""
        assert isinstance(self.study, RunsStrangers)
        return dataclasses.replace(self, study=self.study.without(lost))


def run_numbered(
    name: str, where: str, numbered: Numbered, n_cases: int, chosen: tuple[int, ...], question: Mapping[str, object],
    workers: int, request: Request, progress: Progress, label: str, rates: Rates,
    units: Mapping[str, str],
) -> Run:  # fmt: skip
    """Compute what is missing of a campaign in the request's folder.

    Args:
        name: of the study.
        where: how a command line names it.
        numbered: what simulates the cases.
        n_cases: how many, if none are chosen.
        chosen: numbers of the only cases; all if empty.
        question: what decides the results.
        workers: processes.
        request: says the folder.
        progress: reports how far it is.
        label: what runs, in a word or two.
        rates: what the cases count for each rate that rules may ask for; `failed` is among them.
        units: of what is kept of a case, as columns of the shards are called.

    Raises BadRequest, BadResults, HostFailure: as `run_campaign`.
    """
    campaign = dataclasses.replace(numbered.campaign(len(chosen) or n_cases), units=units)
    simulate: object = numbered
    if chosen:
        campaign = dataclasses.replace(campaign, parameters={**campaign.parameters, CHOSEN: list(chosen)})
        simulate = Chosen(numbered, chosen)
    folder = request.out.absolute()  # a guest may change the current folder
    until = request.until if pairs_wanted(request.until) is None else ()  # those cases are chosen
    fields = [name for name in _fields(campaign.dtype) if name in rates.reads]
    watch = Watch([parse_rule(text) for text in until], rates, np.zeros(0, campaign.dtype), fields)
    words, spoken = "", -math.inf

    def tell(done: int, total: int) -> None:
        nonlocal words, spoken
        if done == total or time.monotonic() - spoken > _SPOKEN:  # intervals take milliseconds
            words, spoken = watch.so_far, time.monotonic()
        progress(f"{name}, {label}\n{words}", done, total)

    if not (folder / MANIFEST).exists():
        write_question(folder, name, where, question)  # first: whatever ends this process, it says what was asked
    outcome = run_campaign(
        simulate, campaign, folder, workers=workers,  # type: ignore[arg-type]
        progress=tell,
        # on a cluster nothing is read here that need not be: results are written faster than one process reads them
        enough=None if request.address and not until else watch, rules=until, max_time=request.max_time,
        address=request.address,
    )  # fmt: skip
    write_question(folder, name, where, question)
    closed = f"\n{request.until[0]}: by {len(chosen)} cases" if until != request.until else ""
    return Run(outcome.interrupted, f"{outcome}{closed}")


@dataclass(frozen=True, slots=True)
class GivenFacts:
    """Facts that were just computed, as those that are read from a folder."""

    whole: NDArray[np.void]

    def parts(self, wanted: Wanted = lambda name: True) -> Iterator[NDArray[np.void]]:
        """Yield all facts at once."""
        yield self.whole


class KeptFacts:
    """The facts of the finished cases in a folder, read when they are asked for: all in one array, or part by part.

    Raises BadResults, then: a shard is damaged, or holds other cases than its number says.
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    @functools.cached_property
    def whole(self) -> NDArray[np.void]:
        """The facts, shape (n_cases,)."""
        facts = self._store.load(partial=True)
        self._require(facts, self._numbers())
        return facts

    def parts(self, wanted: Wanted = lambda name: True) -> Iterator[NDArray[np.void]]:
        """Yield the facts some thousand cases at a time: a million cases need little memory.

        Args:
            wanted: whether a field is; `inner.x` is the field x of the record `inner`. `number` always is.
        """
        if "whole" in self.__dict__ or not self._store.in_order():
            yield self.whole
            return
        numbers, at = self._numbers(), 0
        names = _fields(self._store.campaign.dtype)
        for part in self._store.parts([name for name in names if name == "number" or wanted(name)]):
            self._require(part, numbers[at : at + len(part)])
            at += len(part)
            yield part

    def _numbers(self) -> NDArray[np.int64]:
        """Return the numbers that the finished cases must have."""
        campaign = self._store.campaign
        there = [campaign.cases(shard) for shard in self._store.in_order()]
        rows = np.concatenate([np.arange(0), *(np.arange(one.start, one.stop) for one in there)])
        chosen = campaign.parameters.get(CHOSEN)
        return np.array(chosen)[rows] if isinstance(chosen, list) else rows

    def _require(self, facts: NDArray[np.void], numbers: NDArray[np.int64]) -> None:
        if not np.array_equal(facts["number"], numbers):
            rule = "shards must hold the cases that their numbers say, but do not"
            raise BadResults(str(self._store.folder), rule, "run the campaign again with --fresh", slug="results-order")


def _fields(dtype: np.dtype[Any], name: str = "") -> Iterator[str]:
    """Yield the fields of a record, those of a record within it by themselves."""
    if dtype.names is None:
        yield name
    for inner in dtype.names or ():
        yield from _fields(dtype[inner], f"{name}.{inner}" if name else inner)
