"""Judges repeated durations against a bound, the noise of the machine considered: pass, fail, or why neither.

A measured duration is the true one and what the machine added. Two things can thus make a verdict wrong: that the
repeats happened to be fast or slow ones, which the ranks of `ranks.py` bound, and noise. A fail must stand
though noise is charged with all that it may have done: no miss counts that is nearer to the limit than noise, and
of the others a share is written off (`ALLOWANCE`), since noise may exceed even its own quantile. A pass is refused if
the limit is nearer than noise; where a beginning is stamped before and an end after what it marks, noise only
lengthens, and a pass could not be wrong for it anyway. So a verdict is wrong with at most the bound's error, however
durations and noise are distributed, if repeats and samples of noise meet the same machine. Repeats that depend on each
other, since slow ones come in spells, count as fewer (`dependence.py`); noise, measured between them, likewise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.run.noise import Noise
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing.bounds import Bound, amount
from parcours.verdict.timing.dependence import Dependence, dependence
from parcours.verdict.timing.durations import NEVER, checked, ordered_quantile
from parcours.verdict.timing.ranks import chance_of_largest, greatest_miss_rate, quantile_ranks, repeats_needed

ALLOWANCE = 0.2
"""The share of the misses a quantile bound allows (1 % for p99) that is put down to noise beyond its own quantile."""


def judge(durations: ArrayLike, bound: Bound, noise: Noise | None = None) -> Judgement:
    """Judge the durations of one interaction against a bound.

    The reason of a verdict that is neither pass nor fail ends in `[few-repeats]`, `[undecided]` or `[noise]`.

    Args:
        durations: [ns], shape (n_repeats,), in the order in which they were measured; warm-up left out, a repeat that
            did not end given as `NEVER`. Their number must have been fixed before: to go on until it passes voids the
            confidence.
        bound: what must hold.
        noise: of the same run, measured between its repeats; without it the judgement says so.

    Raises:
        BadRequest: there is no duration, or one is negative or not a number.

    >>> from parcours.verdict.timing.bounds import parse_bound
    >>> judge([4_000_000] * 298 + [6_000_000], parse_bound("p95 < 5 ms")).why
    'p95 of 299 repeats is 4 ms, with 95 % confidence at most 4 ms, limit 5 ms; noise was not measured'
    >>> judge([4_000_000] * 200, parse_bound("p99 < 5 ms")).why
    'none of 200 repeats missed 5 ms, which shows p98.5 with 95 % confidence, not p99: that needs 299 repeats \
[few-repeats]'
    """
    times = checked(durations)
    found = dependence(times, bound.last)
    worth = _Worth(found, max(found.spell, float(bound.spell)))
    ordered = np.sort(times)
    return _every(ordered, bound, noise, worth) if bound.hard else _quantile(ordered, bound, noise, worth)


def quantile_interval(durations: ArrayLike, quantile: float = 0.99, error: float = 0.05) -> tuple[int, int, float]:
    """Return what a quantile is at least and at most, each with confidence, and how many repeats count as one.

    Args:
        durations: [ns], shape (n_repeats,), in the order in which they were measured.
        quantile: in (0, 1).
        error: how likely each of the two is wrong, in (0, 0.5].

    Returns:
        low [ns], 0 if nothing bounds it from below; high [ns], `NEVER` if nothing bounds it from above; the longest
        spell of slow repeats, 1 where they seem independent.

    Raises:
        BadRequest: there is no duration, or one is negative or not a number.

    >>> apart, together = [617 * k % 1000 for k in range(1000)], range(1000)
    >>> quantile_interval(apart), quantile_interval(together) == (899, NEVER, 100.0)
    ((984, 995, 1.0), True)
    """
    times = checked(durations)
    ordered = np.sort(times)
    found = dependence(times, ordered_quantile(ordered, 0.9))
    low, high = _Worth(found, found.spell).ranks(len(times), quantile, error)
    return int(ordered[low - 1]) if low else 0, int(ordered[high - 1]) if high <= len(times) else NEVER, found.spell


@dataclass(frozen=True, slots=True)
class _Worth:
    """What repeats are worth: the dependence that was seen, and how many of them count as one draw."""

    seen: Dependence
    spell: float

    def draws(self, n: int) -> int:
        """As how many independent draws n repeats count."""
        return max(1, int(n / self.spell))

    def needed(self, n: int) -> int:
        """How many repeats are worth n draws."""
        return math.ceil(n * self.spell)

    def ranks(self, n: int, quantile: float, error: float) -> tuple[int, int]:
        """Return the ranks among n ordered times that bound a quantile, as `quantile_ranks` does among draws."""
        draws = self.draws(n)
        low, high = quantile_ranks(draws, quantile, error)
        return low * n // draws, n + 1 if high > draws else -(-high * n // draws)

    def said(self, n: int) -> str:
        """What the order of n repeats says, as the end of a reason; empty if none is slow enough to tell."""
        p_value = f"(p {self.seen.p_value:.2g})"
        if self.spell > self.seen.spell:
            return f"; in spells of up to {self.spell:g} repeats they count as {self.draws(n)}"
        if self.seen.is_seen:
            spell = f"{self.seen.spell:.1f}"
            return f"; slow repeats come in spells of about {spell} {p_value}, so {n} count as {self.draws(n)}"
        return f"; repeats seem independent {p_value}" if self.seen.p_value < 1.0 else ""


def _every(ordered: NDArray[np.int64], bound: Bound, noise: Noise | None, worth: _Worth) -> Judgement:
    n, misses, worst = len(ordered), _beyond(ordered, bound.last), int(ordered[-1])
    sure, limit = _sure(bound), amount(bound.limit)
    if misses == 0:
        if few := _few(n, bound):
            return few
        if noise is not None and worst + noise.max > bound.last:
            margin = _shown(bound.last - worst)
            return _refused(
                f"all {n} repeats kept {limit}, the longest by {margin}, but noise reached {_shown(noise.max)}"
            )
        rate = greatest_miss_rate(0, worth.draws(n), bound.error)
        least = f"{sure}at most {math.ceil(100.0 * (100.0 * rate)) / 100.0:.3g} % of repeats miss it{worth.said(n)}"
        return _said(Verdict.PASS, f"all {n} repeats kept {limit}, the longest took {_shown(worst)}; {least}", noise)
    missed = f"{misses} of {n} repeats missed {limit}, the longest took {_shown(worst)}"
    if noise is not None and worst != NEVER:
        clear = _beyond(ordered, bound.last + noise.max)
        if clear == 0:
            return _refused(f"{missed}, but noise reached {_shown(noise.max)}")
        # Spells are as long in the noise between the repeats: all three numbers are counted in draws.
        spells = math.ceil(clear / worth.spell)
        if chance_of_largest(spells, max(spells, worth.draws(n)), worth.draws(noise.samples)) > bound.error:
            enough = math.ceil(n * (1.0 - bound.error) / bound.error)
            return _refused(
                f"{missed}, but {noise.samples} samples of noise are too few to exclude it as the cause: "
                f"{enough} are enough"
            )
    return _said(Verdict.FAIL, missed, noise)


def _quantile(ordered: NDArray[np.int64], bound: Bound, noise: Noise | None, worth: _Worth) -> Judgement:
    n, misses, last = len(ordered), _beyond(ordered, bound.last), bound.last
    low, high = worth.ranks(n, bound.quantile, bound.error)
    limit, name, sure = amount(bound.limit), str(bound).split(maxsplit=1)[0], _sure(bound)
    measured = f"{name} of {n} repeats is {_shown(ordered_quantile(ordered, bound.quantile))}"
    if high <= n - misses:
        upper = int(ordered[high - 1])
        if few := _few(n, bound):
            return few
        said = f"{measured}, {sure}at most {_shown(upper)}, limit {limit}{worth.said(n)}"
        # Spells that did not occur cannot be seen: say how long they may be for the same repeats to pass.
        longest = n // repeats_needed(bound.quantile, bound.error) if misses == 0 else 1
        if longest > worth.spell:
            said += f"; misses in spells of up to {longest} would have shown"
        refusal = _too_noisy(said, last - upper, 1.0 - bound.quantile, bound, noise, worth)
        return refusal or _said(Verdict.PASS, said, noise)
    if low > n - misses:
        said = f"{measured}, {sure}at least {_shown(int(ordered[low - 1]))}, limit {limit}{worth.said(n)}"
        # what noise beyond its quantile may have made miss is no miss of the interaction's own
        share = ALLOWANCE * (1.0 - bound.quantile)
        charged = worth.ranks(n, bound.quantile - share, bound.error / 2)[0]
        margin = int(ordered[charged - 1]) - last - 1 if charged else -1
        if charged and ordered[charged - 1] == NEVER:  # noise delays, but it does not keep a repeat from ending
            return _said(Verdict.FAIL, said, noise)
        return _too_noisy(said, margin, share, bound, noise, worth) or _said(Verdict.FAIL, said, noise)
    draws, spells = worth.draws(n), round(misses / worth.spell)
    needed = max(bound.repeats, worth.needed(repeats_needed(bound.quantile, bound.error, max(spells, min(misses, 1)))))
    if misses == 0:
        shown = math.floor(1000.0 * (1.0 - greatest_miss_rate(0, draws, bound.error)) + 1e-9) / 10.0
        return _inconclusive(
            f"none of {n} repeats missed {limit}, which shows p{shown:g} {sure.rstrip()}, not {name}{worth.said(n)}: "
            f"that needs {needed} repeats",
            "few-repeats",
        )
    sides = [f"at least {_shown(int(ordered[low - 1]))}"] if low else []
    sides += [f"at most {_shown(int(ordered[high - 1]))}"] if high <= n else []
    return _inconclusive(
        f"{measured}, {sure}{' and '.join(sides) or 'anything'}, limit {limit}{worth.said(n)}: {misses} missed it, and "
        f"with no more misses {needed} repeats would pass",
        "undecided",
    )


def _too_noisy(
    said: str, margin: int, share: float, bound: Bound, noise: Noise | None, worth: _Worth
) -> Judgement | None:
    """Refuse a verdict unless noise exceeds its margin [ns] in at most a share of samples, with confidence."""
    if noise is None:
        return None
    error = bound.error / 2
    rank = worth.ranks(noise.samples, 1.0 - share, error)[1]
    if rank > noise.samples:
        enough = worth.needed(repeats_needed(1.0 - share, error))
        return _refused(f"{said}, but {noise.samples} samples of noise are too few for it: {enough} are needed")
    if margin < 0:
        return _refused(f"{said}, but so few misses may be due to noise: more repeats would tell")
    if noise.times[rank - 1] > margin:
        return _refused(f"{said}, but that is within the noise of {_shown(noise.times[rank - 1])}")
    return None


def _few(n: int, bound: Bound) -> Judgement | None:
    if n >= bound.repeats:
        return None
    return _inconclusive(f"the bound is over {bound.repeats} repeats, but {n} were made", "few-repeats")


def _refused(why: str) -> Judgement:
    return _inconclusive(why, "noise")


def _inconclusive(why: str, slug: str) -> Judgement:
    return Judgement(Verdict.INCONCLUSIVE, f"{why} [{slug}]")


def _said(verdict: Verdict, why: str, noise: Noise | None) -> Judgement:
    if noise is None:
        return Judgement(verdict, f"{why}; noise was not measured")
    return Judgement(verdict, f"{why}; noise p99 {_shown(noise.p99)}, at most {_shown(noise.max)}")


def _beyond(ordered: NDArray[np.int64], time: int) -> int:
    return len(ordered) - int(np.searchsorted(ordered, min(time, NEVER - 1), side="right"))


def _sure(bound: Bound) -> str:
    return f"with {bound.confidence:.12g} % confidence "


def _shown(time: int) -> str:
    """A time to four digits."""
    if time == NEVER:
        return "never"
    digits = max(0, len(str(time)) - 4)
    return amount(round(time, -digits)) if time else "0 ns"
