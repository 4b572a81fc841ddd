"""The random streams of `parcours.streams` (SplitMix64) for whole tables: word k of any case's stream.

A stream is fixed by (campaign seed, case number, purpose), and its words are addressed by number, so the bits
of one case do not depend on which cases are drawn with it, in which order, or on which machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest

VALUES = 0x76616C756573
"""Purpose of the stream that draws the values of a case (ASCII for `values`)."""

ROWS = 0x726F7773
"""Purpose of the stream that shuffles the blocks of one repetition of a criterion (ASCII for `rows`)."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


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
    campaign = _mixed(np.array([seed], dtype=np.uint64) + _GOLDEN)
    aim = np.array([purpose], dtype=np.uint64) * _MIX_1 + _GOLDEN
    return _mixed(_mixed(campaign ^ (cases.astype(np.uint64) * _MIX_2 + _GOLDEN)) ^ aim)


def uniforms(start: NDArray[np.uint64], first: int, n: int) -> NDArray[np.float64]:
    """Return numbers first .. first + n - 1 of each stream, uniform on [0, 1) in steps of 2**-53.

    >>> beginnings = starts(7, np.array([0, 1]), VALUES)
    >>> bool((uniforms(beginnings, 0, 3)[:, 2] == uniforms(beginnings, 2, 1)[:, 0]).all())
    True
    """
    steps = np.arange(first + 1, first + n + 1, dtype=np.uint64) * _GOLDEN
    words = _mixed(start[:, np.newaxis] + steps)
    return (words >> _S11).astype(np.float64) * 2.0**-53


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the words scrambled so that near inputs give unrelated outputs (SplitMix64's finaliser)."""
    words = (words ^ (words >> _S30)) * _MIX_1
    words = (words ^ (words >> _S27)) * _MIX_2
    return words ^ (words >> _S31)
