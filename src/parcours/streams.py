"""Keyed random numbers: the same key gives the same bits, on any machine and in any order.

Streams are SplitMix64 (Steele, Lea, Flood, OOPSLA 2014), keyed by (campaign seed, case number, purpose), so that no
case and no component shares randomness with another, and a case replays from its numbers alone. Compiled code draws
from an array of one uint64 of state; tables of cases address word k of every stream at once. Keys that are texts
are for `parcours.hashing`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import TAU, exp, log, sin_cos
from parcours.errors import BadRequest
from parcours.kernels import kernel

Stream = NDArray[np.uint64]

VALUES = 0x76616C756573
"""Purpose of the stream that draws the values of a case (ASCII for `values`)."""

ROWS = 0x726F7773
"""Purpose of the stream that shuffles the blocks of one repetition of a criterion (ASCII for `rows`)."""

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""How far apart two words of a stream are."""
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@kernel
def mix(word: np.uint64) -> np.uint64:
    """Return the word scrambled so that near inputs give unrelated outputs (SplitMix64's finaliser)."""
    word = (word ^ (word >> _S30)) * _MIX_1
    word = (word ^ (word >> _S27)) * _MIX_2
    return word ^ (word >> _S31)


@kernel
def start(stream: Stream, seed: np.uint64, case: np.uint64, purpose: np.uint64) -> None:
    """Set the stream to its start for this seed, case and purpose."""
    stream[0] = mix(mix(mix(seed + GOLDEN) ^ (case * _MIX_2 + GOLDEN)) ^ (purpose * _MIX_1 + GOLDEN))


@kernel
def uniform(stream: Stream) -> float:
    """Return the next number of the stream, uniform on [0, 1) in steps of 2**-53."""
    stream[0] = stream[0] + GOLDEN
    return float(mix(stream[0]) >> _S11) * 1.1102230246251565e-16


@kernel
def below(stream: Stream, n: int) -> int:
    """Return the next whole number of the stream, uniform on 0 .. n-1."""
    return min(int(uniform(stream) * n), n - 1)


@kernel
def between(stream: Stream, low: float, high: float) -> float:
    """Return the next number of the stream, uniform on [low, high)."""
    return low + (high - low) * uniform(stream)


@kernel
def lognormal(stream: Stream, median: float, spread: float) -> float:
    """Return the next log-normal number: exp of a normal with mean ln(median) and standard deviation `spread`."""
    radius = np.sqrt(-2.0 * log(1.0 - uniform(stream)))
    return median * exp(spread * radius * sin_cos(TAU * uniform(stream))[1])


def starts(seed: int, cases: NDArray[np.int64], purpose: int) -> NDArray[np.uint64]:
    """Return the state in which the stream of each case begins.

    Args:
        seed: the campaign's seed, 0 <= seed < 2**64.
        cases: case numbers, shape (n_cases,).
        purpose: VALUES or ROWS.

    Raises:
        BadRequest: the seed does not fit, or a case number is negative.
    """
    if not 0 <= seed < 2**64:
        raise BadRequest("seed", f"a seed must be a whole number from 0 to 2**64 - 1, but {seed} given", slug="seed")
    if cases.size and cases.min() < 0:
        raise BadRequest("cases", f"a case number must not be negative, but {cases.min()} given", slug="case-number")
    # Arrays throughout: numpy warns when a lone number wraps around, and wrapping is meant here.
    campaign = _mixed(np.array([seed], dtype=np.uint64) + GOLDEN)
    aim = np.array([purpose], dtype=np.uint64) * _MIX_1 + GOLDEN
    return _mixed(_mixed(campaign ^ (cases.astype(np.uint64) * _MIX_2 + GOLDEN)) ^ aim)


def uniforms(start: NDArray[np.uint64], first: int, n: int) -> NDArray[np.float64]:
    """Return numbers first .. first + n - 1 of each stream, uniform on [0, 1) in steps of 2**-53.

    Args:
        start: where the streams begin, shape (n_cases,).
        first: number of the first word wanted, from 0.
        n: how many words of each stream.

    Returns:
        Shape (n_cases, n).

    >>> beginnings = starts(7, np.array([0, 1]), VALUES)
    >>> bool((uniforms(beginnings, 0, 3)[:, 2] == uniforms(beginnings, 2, 1)[:, 0]).all())
    True
    """
    steps = np.arange(first + 1, first + n + 1, dtype=np.uint64) * GOLDEN
    words = _mixed(start[:, np.newaxis] + steps)
    return (words >> _S11).astype(np.float64) * 2.0**-53


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return `mix` of every word, uncompiled: numpy wraps arrays around without a warning."""
    plain: Any = getattr(mix, "py_func", mix)
    mixed: NDArray[np.uint64] = plain(words)
    return mixed
