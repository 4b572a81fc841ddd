"""Arrays that mathematics knows for given block counts: no search, and often few rows.

- Orthogonal arrays over a finite field: polynomials evaluated at its points (Bush, Ann. Math. Stat. 23, 1952).
- Two blocks a parameter: sets of equal size, any two of which meet (Katona, 1973; Kleitman & Spencer, 1973); optimal.
- Starter vectors: one row, turned round and shifted (Meagher & Stevens, J. Combin. Des. 13, 2005).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from random import Random

import numpy as np

from parcours.data.arrays.goals import Ints

_LARGEST_FIELD = 49
_MOST_ROWS = 100_000
_TRIALS = 30_000


def constructions(
    sizes: Sequence[int], strength: int, seed: int = 0, most: int = _MOST_ROWS
) -> Iterator[tuple[str, Ints]]:
    """Yield name and rows of each construction that fits; blocks are those of `sizes`."""
    active = [column for column, size in enumerate(sizes) if size > 1]
    k, v = len(active), max(sizes)
    if not 2 <= strength <= k:
        return
    found: list[tuple[str, Ints]] = []
    q = next((q for q in range(v, _LARGEST_FIELD + 1) if is_prime_power(q) and q + 1 >= k and q >= strength), 0)
    if q and q**strength < most:
        found.append(("orthogonal", orthogonal(q, strength)[:, :k]))
    if strength == 2 and v == 2:
        found = [("halves", halves(k))]
    if strength == 2 and v > 2 and k > v + 1 and k * (v - 1) + 1 < most:
        starter = starter_vector(k, v, seed)
        if starter is not None:
            found.append(("starter vector", turned(starter, v)))
    random = np.random.default_rng(seed)
    for name, table in found:
        rows = np.zeros((len(table), len(sizes)), dtype=np.int64)
        limits = np.array([sizes[c] for c in active])
        rows[:, active] = np.where(table < limits, table, random.integers(0, limits, size=table.shape))
        yield name, rows


def is_prime_power(n: int) -> bool:
    """Return whether there is a field of n elements.

    >>> [n for n in range(2, 14) if is_prime_power(n)]
    [2, 3, 4, 5, 7, 8, 9, 11, 13]
    """
    return n > 1 and _power_of(n)[0] ** _power_of(n)[1] == n


def _power_of(n: int) -> tuple[int, int]:
    """Return the least prime factor of n, and how often it divides n."""
    p = next(d for d in range(2, n + 1) if n % d == 0)
    m = 0
    while n % p == 0:
        n, m = n // p, m + 1
    return p, m


def field(q: int) -> tuple[Ints, Ints]:
    """Return the tables of addition and multiplication of the field of q elements, shape (q, q); 0 and 1 are its own.

    Element e stands for the polynomial whose coefficients are the digits of e to the base p, q = p**m.

    >>> plus, times = field(4)
    >>> plus[2, 3], times[2, 3]
    (np.int64(1), np.int64(1))
    """
    p, m = _power_of(q)
    digits = np.array([[e // p**i % p for i in range(m)] for e in range(q)])
    weights = p ** np.arange(m)
    plus = ((digits[:, np.newaxis] + digits) % p) @ weights
    for tail in itertools.product(range(p), repeat=m):
        times = _products(digits, tail, p) @ weights
        if all(len(set(row)) == q for row in times[1:].tolist()):  # x**m = tail is irreducible: no divisors of zero
            return plus, times
    raise AssertionError(f"there is a field of {q} elements")


def _products(digits: Ints, tail: Sequence[int], p: int) -> Ints:
    """Return the digits of all products, where x**m is replaced by the polynomial `tail`."""
    q, m = digits.shape
    long = np.zeros((q, q, 2 * m - 1), dtype=np.int64)
    for i in range(m):
        for j in range(m):
            long[:, :, i + j] += digits[:, np.newaxis, i] * digits[np.newaxis, :, j]
    for power in range(2 * m - 2, m - 1, -1):
        for i in range(m):
            long[:, :, power - m + i] += long[:, :, power] * tail[i]
        long %= p
    return long[:, :, :m] % p


def orthogonal(q: int, strength: int) -> Ints:
    """Return an array of q**strength rows and q + 1 columns in which any `strength` columns hold each tuple once."""
    plus, times = field(q)
    coefficients = np.array(list(itertools.product(range(q), repeat=strength)), dtype=np.int64)
    columns = []
    for x in range(q):
        value = np.zeros(len(coefficients), dtype=np.int64)
        for place in range(strength):  # Horner's rule
            value = plus[times[value, x], coefficients[:, place]]
        columns.append(value)
    return np.stack([*columns, coefficients[:, 0]], axis=1)


def halves(k: int) -> Ints:
    """Return the smallest array of k two-block columns: a row of zeros; below it each column has ceil(n / 2) ones."""
    n = fewest_halves(k)
    sets = itertools.islice(itertools.combinations(range(1, n), (n + 1) // 2), k)
    rows = np.zeros((n, k), dtype=np.int64)
    for column, ones in enumerate(sets):
        rows[list(ones), column] = 1
    return rows


def fewest_halves(k: int) -> int:
    """Return the fewest rows in which any two of k two-block columns hold all four pairs, k >= 2.

    >>> fewest_halves(2), fewest_halves(3), fewest_halves(100)
    (4, 4, 10)
    """
    return next(n for n in itertools.count(4) if math.comb(n - 1, (n + 1) // 2) >= k)


def starter_vector(k: int, v: int, seed: int) -> list[int] | None:
    """Return a vector of length k over 0 .. v - 2 and one entry v - 1, whose differences at each distance are all.

    None where none was found in a few tries.
    """
    group, random, half = v - 1, Random(seed), k // 2
    vector = [group, *(random.randrange(group) for _ in range(k - 1))]
    counts = [[0] * group for _ in range(half + 1)]

    def note(i: int, change: int) -> int:
        """Add or take the differences that entry i makes; return how many residues are new or gone."""
        turned_ = 0
        for d in range(1, half + 1):
            ends = {(i, (i + d) % k), ((i - d) % k, i)}
            if 2 * d == k:
                ends |= {(b, a) for a, b in ends}
            for a, b in ends:
                if a and b:  # entry 0 is the fixed one
                    residue = (vector[b] - vector[a]) % group
                    counts[d][residue] += change
                    turned_ += counts[d][residue] == (change + 1) // 2
        return turned_

    for d in range(1, half + 1):
        for i in range(k):
            if i and (i + d) % k:
                counts[d][(vector[(i + d) % k] - vector[i]) % group] += 1
    lacking = sum(count == 0 for row in counts[1:] for count in row)
    for _ in range(_TRIALS):
        if not lacking:
            return vector
        i = random.randrange(1, k)
        old = vector[i]
        gone = note(i, -1)
        vector[i] = random.randrange(group)
        new = note(i, +1)
        if new < gone:
            note(i, -1)
            vector[i] = old
            note(i, +1)
        else:
            lacking += gone - new
    return None


def turned(starter: Sequence[int], v: int) -> Ints:
    """Return all rotations of a starter vector, shifted by each element of the group, and the row of the fixed one."""
    group, k = v - 1, len(starter)
    cells = np.array(starter)
    # Pairs at distance d in the vector meet all differences, so their shifts are all pairs of the group:
    #
    #     (v-1  a  b  c)  ->  (c  v-1  a  b)  ->  ...        k rotations, each shifted v - 1 times
    rotations = np.stack([np.roll(cells, shift) for shift in range(k)])
    rows = [np.where(rotations == group, group, (rotations + shift) % group) for shift in range(group)]
    return np.concatenate([*rows, np.full((1, k), group)])
