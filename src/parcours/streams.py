"""Random streams inside compiled code: SplitMix64 (Steele, Lea, Flood, OOPSLA 2014), one 64-bit word of state each.

A stream is an array of one uint64. It is seeded from (campaign seed, case number, purpose), so that no case and no
component shares randomness with another, and a case replays from its numbers alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import TAU, exp, log, sin_cos
from parcours.kernels import kernel

Stream = NDArray[np.uint64]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
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
    stream[0] = mix(mix(mix(seed + _GOLDEN) ^ (case * _MIX_2 + _GOLDEN)) ^ (purpose * _MIX_1 + _GOLDEN))


@kernel
def uniform(stream: Stream) -> float:
    """Return the next number of the stream, uniform on [0, 1) in steps of 2**-53."""
    stream[0] = stream[0] + _GOLDEN
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
