"""Estimates how rarely cases of a study fail: splitting, level by level, with repeats that share nothing.

    draws of a campaign    nearer than level 1    nearer than level 2    failures
    o o o o o o o o o o -> o o        copied,  -> o o        copied,  -> o
                           moved a little,         moved a little,
                           kept if still below     kept if still below

The probability is the product of the shares that pass each level. There are most cases at first: what is moved stays
near what it comes from, so how unlike cases are deep down depends on how many were drawn. A pilot fixes the levels;
then every repeat is without bias whatever the levels are and however badly cases move, as long as moves leave the
distribution of what a campaign draws as it is (Del Moral, Feynman-Kac Formulae, 2004; the chains: Au, Beck, Prob. Eng.
Mechanics 16, 2001).

A case is a point of the unit cube, from which its blocks and values follow, and a number, on which all else depends
that is drawn. Half of the values, a quarter, ... or one are moved, if the campaign could have drawn the result. Blocks
are equally likely in a campaign, but constraints leave them unlike room: so what the campaign would have rejected
before these values is drawn along, and must be refused in the new blocks, too. Then a move is as likely as its reverse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.run.campaign import Prepares
from parcours.run.heartbeat import LostCase, RunsStrangers
from parcours.run.strangers import computed
from parcours.study.cube import Cube, Floats, UniformDraws, moved
from parcours.study.falsifying import Search, search_of, simulated
from parcours.study.protocol import Progress
from parcours.verdict.statistics import mean_of_log_normal, wilson

Integers = NDArray[np.int64]

_PURPOSE = 0x73706C6974  # of the streams from which cases are drawn and moved (ASCII for `split`)
REPEATS = 10
SHARE = 0.02  # of the pilot's cases that pass a level; a third of it at first, so that as many pass
_FEWEST = 5  # cases of the pilot that pass, however few there are
FIRST = 3  # times as many cases are drawn at first as are moved at each level
MOST_LEVELS = 40
_LEAST = 25  # cases of a repeat
_PILOT, _PILOT_BUDGET = 0.01, 0.35  # cases of the pilot, and what it may take in all, as shares of the budget
_NUMBERS = 2.0**40  # numbers of cases lie below this
_SCALES = 7  # steps of 1/2 .. 1/128 of a domain
_REDRAWN = 0.3  # share of moves that change the number
_MOST_REJECTED = 4096
FAILS = -1e-300  # no subnormal number: some libraries make processors take those for 0
"""The last level: what is at most that far from failing fails."""

_ROW = [
    ("repeat", np.int64), ("simulations", np.int64), ("probability", np.float64), ("founders", np.int64),
    ("drawn", np.int64),  # failures among the cases of a campaign
    ("levels", np.float64, (MOST_LEVELS,)), ("number", np.int64),
]  # fmt: skip


@runtime_checkable
class Sampled(Search, Protocol):
    """Cases as a campaign draws them, and those that it could have drawn as well.

    All blocks of an input are equally likely, whatever those of the others are.
    """

    @property
    def study(self) -> object:
        """What runs in a worker: it may be prepared first, and may run strangers' code."""

    @property
    def period(self) -> int:
        """By how much numbers of cases differ that differ in nothing but what is drawn beside the values."""

    def drawn(self, numbers: Integers) -> Floats:
        """Return the values that a campaign draws, shape (n, n_inputs)."""

    def settled(self, values: Floats, numbers: Integers) -> tuple[Floats, NDArray[np.bool_]]:
        """Return what cases a campaign makes of drawn values, shape (n, n_inputs), and whether it takes them."""


@dataclass(frozen=True, slots=True)
class Rarity:
    """How often cases fail, by repeats that share nothing but their levels."""

    event: str  # what it is to fail
    seed: int
    simulations: int
    probability: float  # that a case fails; without bias
    low: float  # ends of the interval, at 95 %
    high: float
    levels: tuple[float, ...]  # how near cases come to failing on the way there
    repeats: tuple[float, ...]  # what each found
    founders: int  # in the repeat with fewest: cases of a campaign from which its failures descend
    nearest: float = FAILS  # what `probability` is of, at least so near; not negative: the pilot found no failure
    number: int = -1  # of a case that fails; negative if there was none
    values: Mapping[str, float] | None = None  # its test inputs
    files: tuple[str, ...] = ()

    @property
    def reached(self) -> bool:
        """Whether the pilot found failures."""
        return self.nearest < 0.0

    def __str__(self) -> str:
        what = self.event if self.reached else f"within {self.nearest:.4g} of ({self.event})"
        said = f"seed {self.seed}: {what}: {self.probability:.3g} [{self.low:.3g}, {self.high:.3g}] at 95 %, by "
        said += f"{len(self.repeats)} repeats over {len(self.levels)} levels, {self.simulations} simulations"
        if not self.reached:
            said += "; no failure was found, so failures are rarer than that"
        if lost := sum(one == 0.0 for one in self.repeats):
            said += f"; {lost} of the repeats found none: take a larger budget"
        return said


@dataclass(frozen=True, slots=True)
class _Cases:
    """Cases, shape (n, ...) each."""

    points: Floats
    numbers: Integers
    far: Floats  # from failing
    founders: Integers  # the first cases from which they descend

    def of(self, which: NDArray[np.bool_]) -> _Cases:
        """Return some of them."""
        return _Cases(self.points[which], self.numbers[which], self.far[which], self.founders[which])


@dataclass(frozen=True, slots=True)
class Descent:
    """What workers run: repeats down given levels; or, without any, the pilot, which looks for them."""

    search: Sampled
    seed: int
    n: int  # cases at each level, but for FIRST times as many at first
    levels: tuple[float, ...] = ()  # the last one is what is asked for
    most: int = 0  # simulations of the pilot

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        return self.search.study.heartbeat_words if isinstance(self.search.study, RunsStrangers) else 0

    @property
    def patience_to_load(self) -> float:
        """How long a worker may give no sign of life while it is on no case [s]."""
        return float(getattr(self.search.study, "patience_to_load", math.inf))

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Refuse: a case without an outcome leaves no estimate. Raises BadRequest."""
        rule = f"every case must have an outcome, but in one the system {lost[0].how}: {lost[0].detail}"
        raise BadRequest("rare", rule, "run a campaign, which names such cases", slug="rare-lost")

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return what repeats `first` .. `first + count - 1` found; 0 is the pilot."""
        return np.concatenate([_Flight(self, repeat).down() for repeat in range(first, first + count)])


class _Flight:
    """The cases of one repeat on their way down."""

    def __init__(self, descent: Descent, repeat: int) -> None:
        self._descent, self._search, self._repeat = descent, descent.search, repeat
        self._cube = Cube(descent.search.inputs)
        self._draws = UniformDraws(descent.seed, repeat, _PURPOSE)
        self._simulated = 0

    def down(self) -> NDArray[np.void]:
        """Go down all levels; return what was found on the way, shape (1,)."""
        n, levels = self._descent.n, list(self._descent.levels)
        numbers = int(self._draws.uniform(1)[0] * _NUMBERS) + np.arange(FIRST * n)
        values = self._search.drawn(numbers)
        points = self._cube.points(values, self._draws.uniform(*values.shape))
        cases = _Cases(points, numbers, self._far(values, numbers), np.arange(FIRST * n))
        probability, at, drawn = 1.0, 0, int((cases.far <= (levels or [FAILS])[-1]).sum())
        while True:
            if at == len(levels):
                if self._descent.levels or not self._find(levels, cases.far):
                    break
                if at == len(levels):  # nothing lies below that level yet
                    cases = self._moved(cases, levels[-1])
                    continue
            passed = cases.far <= levels[at]
            probability *= passed.mean()
            cases, at = cases.of(passed), at + 1
            if not passed.any() or levels[at - 1] == FAILS:
                break
            if at < len(self._descent.levels) or not self._descent.levels:
                cases = self._spread(cases, levels[at - 1])
        row = np.zeros(1, [*_ROW, ("values", np.float64, (self._cube.n,))])
        row["repeat"], row["simulations"], row["probability"] = self._repeat, self._simulated, probability
        row["levels"], row["levels"][0, : len(levels)] = np.nan, levels
        row["founders"], row["number"], row["drawn"] = len(np.unique(cases.founders)), -1, drawn
        if len(cases.far) and cases.far[0] < 0.0:
            row["number"] = cases.numbers[0]
            row["values"] = self._search.settled(self._cube.values(cases.points[:1]), cases.numbers[:1])[0]
        return row

    def _find(self, levels: list[float], far: Floats) -> bool:
        """Add the next level of the pilot if there are cases below the last one; return whether to go on."""
        above = levels[-1] if levels else math.inf
        level = float(np.sort(far)[max(math.ceil(SHARE * self._descent.n), _FEWEST) - 1])
        if level >= above:  # many are equally near
            level = float(far[far < above].max(initial=-math.inf))
        if self._simulated >= self._descent.most or len(levels) == MOST_LEVELS - 1:  # this is as far as it goes
            if far.min() >= 0.0:
                return False
            level = FAILS
        if level > -math.inf:
            levels.append(level if level >= 0.0 else FAILS)
        return True

    def _spread(self, cases: _Cases, level: float) -> _Cases:
        """Return as many cases as there were, by chains of moves that stay below the level."""
        n, n_chains = self._descent.n, len(cases.far)
        lengths = np.full(n_chains, n // n_chains)
        lengths[np.argsort(self._draws.uniform(n_chains), kind="stable")[: n % n_chains]] += 1
        found = [cases]
        for step in range(1, int(lengths.max())):
            cases = cases.of(lengths > step)
            lengths = lengths[lengths > step]
            cases = self._moved(cases, level)
            found.append(cases)
        return _Cases(*(np.concatenate([getattr(one, name) for one in found]) for name in _Cases.__slots__))

    def _moved(self, cases: _Cases, level: float) -> _Cases:
        """Return the cases after a move each, or where they were if that leads out of the level."""
        again = self._draws.uniform(len(cases.far)) < _REDRAWN  # values or the rest: both at once would seldom stay
        numbers = np.where(again, self._renumbered(cases.numbers), cases.numbers)
        points = np.where(again[:, np.newaxis], cases.points, self._proposed(cases.points, cases.numbers))
        values, _ = self._search.settled(self._cube.values(points), numbers)
        other, far = again | (points != cases.points).any(axis=1), cases.far.copy()
        far[other] = self._far(values[other], numbers[other])
        stays = far <= level
        return _Cases(
            np.where(stays[:, np.newaxis], points, cases.points), np.where(stays, numbers, cases.numbers),
            np.where(stays, far, cases.far), cases.founders,
        )  # fmt: skip

    def _renumbered(self, numbers: Integers) -> Integers:
        """Return other numbers of the same kind of case."""
        period = self._search.period
        word = self._draws.uniform(len(numbers))
        return (word * (_NUMBERS / period)).astype(np.int64) * period + numbers % period

    def _proposed(self, points: Floats, numbers: Integers) -> Floats:
        """Return points near by, from which the way back is as likely, among those that a campaign may draw."""
        owners, rejected = self._rejected(points, numbers)
        new = moved(points, self._draws, _SCALES)
        good = self._search.settled(self._cube.values(new), numbers)[1]
        blocks = self._cube.blocks(new)
        changed = good & (blocks != self._cube.blocks(points)).any(axis=1)
        asked = np.flatnonzero(changed[owners])
        if len(asked):
            drawn = (blocks[owners[asked]] + rejected[asked]) / self._cube.sizes
            taken = self._search.settled(self._cube.values(drawn), numbers[owners[asked]])[1]
            good[owners[asked[taken]]] = False
        return np.where(good[:, np.newaxis], new, points)

    def _rejected(self, points: Floats, numbers: Integers) -> tuple[Integers, Floats]:
        """Return what a campaign may have rejected before these points: whose it is, and places within blocks."""
        owners, places = [np.zeros(0, np.int64)], [np.zeros((0, self._cube.n))]
        blocks, left, n = self._cube.blocks(points), np.arange(len(points)), 1
        while len(left) and n <= _MOST_REJECTED:
            within = self._draws.uniform(len(left), n, self._cube.n)
            drawn = ((blocks[left, np.newaxis] + within) / self._cube.sizes).reshape(-1, self._cube.n)
            taken = self._search.settled(self._cube.values(drawn), np.repeat(numbers[left], n))[1].reshape(-1, n)
            before = np.cumsum(taken, axis=1) == 0
            owners.append(np.repeat(left, n)[before.ravel()])
            places.append(within[before])
            left, n = left[~taken.any(axis=1)], 2 * n
        return np.concatenate(owners), np.concatenate(places)

    def _far(self, values: Floats, numbers: Integers) -> Floats:
        """Return how far cases are from failing."""
        self._simulated += len(numbers)
        return simulated(self._search, values, numbers)[0]


def estimate(
    search: Search, *, seed: int, budget: int, repeats: int = REPEATS, workers: int, progress: Progress
) -> Rarity:  # fmt: skip
    """Estimate the probability with which a case of a campaign fails.

    Args:
        search: the cases.
        seed: of all that is drawn here; the same seed gives the same answer, however many workers there are.
        budget: most simulations, the pilot's included.
        repeats: how many share it.
        workers: processes.
        progress: reports which are done.

    Raises BadRequest: there are no test inputs, the study cannot say how its cases are drawn, the budget is too small,
    or a system hangs or dies.
    """
    cube = Cube(search.inputs)
    if not cube.n or not isinstance(search, Sampled):
        rule = "there must be test inputs whose draws can be moved, but there are none"
        raise BadRequest("rare", rule, "give the world `data`, or run a campaign", slug="falsify-inputs")
    forks = search.study.prepare() if isinstance(search.study, Prepares) else False
    pilot = Descent(search, seed, max(int(_PILOT * budget), 2 * _LEAST), most=int(_PILOT_BUDGET * budget))
    [(_, found)] = computed(pilot, [range(1)], 1, lambda k: "the pilot", forks=forks)
    levels = tuple(found["levels"][0][~np.isnan(found["levels"][0])].tolist())
    n = (budget - int(found["simulations"][0])) // (repeats * (FIRST + len(levels) - 1)) if levels else 0
    if n < _LEAST:
        rule = f"each of {repeats} repeats needs {_LEAST} cases at each of {len(levels)} levels, but has {max(n, 0)}"
        raise BadRequest("--max-runs", rule, "raise it", slug="rare-budget")
    descent = Descent(search, seed, n, levels)
    rows: dict[int, NDArray[np.void]] = {}
    spans = [range(repeat, repeat + 1) for repeat in range(1, repeats + 1)]
    for span, row in computed(descent, spans, workers, lambda k: f"repeat {k + 1}", forks=forks):
        rows[span] = row
        so_far = np.mean([one["probability"][0] for one in rows.values()])
        progress(f"repeats\nprobability {so_far:.3g}", len(rows), repeats)
    return rarity(descent, int(found["simulations"][0]), np.concatenate([rows[k] for k in range(repeats)]))


def rarity(descent: Descent, piloted: int, rows: NDArray[np.void]) -> Rarity:
    """Return what repeats found together.

    Args:
        descent: what they were.
        piloted: how many simulations went before them.
        rows: of each repeat, as `Descent` gives them.
    """
    found, levels, n = rows["probability"], descent.levels, FIRST * descent.n * len(rows)
    failed_at_first = int(rows["drawn"].sum())  # of a campaign
    if len(levels) == 1 or not found.any():
        known = wilson(failed_at_first, n)
        low, high = known.low, known.high
    else:
        low, high = mean_of_log_normal(found)
        high = min(high, wilson(failed_at_first, n, 0.99).high)  # seldom too low: of two bounds one is taken
        low = min(low, high)
    reached = levels[-1] < 0.0
    failed = rows[rows["number"] >= 0][:1] if reached else rows[:0]
    named = dict(zip(descent.search.inputs.names, failed["values"][0].tolist(), strict=True)) if len(failed) else None
    return Rarity(
        descent.search.event, descent.seed, piloted + int(rows["simulations"].sum()), float(found.mean()), low, high,
        levels[:-1] if reached else levels, tuple(found.tolist()), int(rows["founders"].min()),
        levels[-1], int(failed["number"][0]) if len(failed) else -1, named,
    )  # fmt: skip


def estimate_and_keep(
    given: str, settings: Sequence[str], out: Path | None, progress: Progress, *, seed: int, budget: int, repeats: int,
    workers: int,
) -> Rarity:  # fmt: skip
    """Estimate how often cases of the study that a user names fail, and write one that does if there is a folder.

    Raises BadRequest: as `search_of` and `estimate`.
    """
    search = search_of(given, settings, seed)
    found = estimate(search, seed=seed, budget=budget, repeats=repeats, workers=workers, progress=progress)
    if out is None or found.values is None:
        return found
    values = np.array([*found.values.values()])
    _, [causes] = search.simulate(values[np.newaxis], np.array([found.number]))
    return replace(found, files=tuple(map(str, search.keep(values, found.number, next(iter(causes), ""), out))))
