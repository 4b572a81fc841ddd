"""Judges all formulas of a program over the signals of one case, compiled: n samples and windows of w take n log w.

Robustness is the one of A. Donze and O. Maler (Robust Satisfaction of Temporal Logic over Real-Valued Signals, FORMATS
2010) over samples. Beyond the end of a track `always` asks for nothing, and `eventually` and `until` find nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import kernel
from parcours_navigation.requirements.programs import (
    ABOVE,
    ABS,
    ADD,
    BELOW,
    COMPARE,
    DIVIDE,
    FIRST,
    FROM,
    GREATEST,
    HYPOT,
    IMPLY,
    IS_ROOT,
    LAST,
    LEAST,
    LEFT,
    MAX,
    MIN,
    MULTIPLY,
    NEGATE,
    NEGATED_WINDOW,
    OPERATION,
    OUT,
    RIGHT,
    SQRT,
    SUBTRACT,
    TO,
    UNTIL,
    WINDOW,
)
from parcours_navigation.requirements.signals import take

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def _least(values: Floats) -> float:
    """Return the least of the values; infinite if there are none."""
    # Eight at a time: each minimum waits for the one before it.
    a = b = c = d = e = f = g = h = np.inf
    n = len(values) // 8 * 8
    for i in range(0, n, 8):
        a = values[i] if values[i] < a else a
        b = values[i + 1] if values[i + 1] < b else b
        c = values[i + 2] if values[i + 2] < c else c
        d = values[i + 3] if values[i + 3] < d else d
        e = values[i + 4] if values[i + 4] < e else e
        f = values[i + 5] if values[i + 5] < f else f
        g = values[i + 6] if values[i + 6] < g else g
        h = values[i + 7] if values[i + 7] < h else h
    for i in range(n, len(values)):
        a = values[i] if values[i] < a else a
    return min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))


@kernel
def _lesser(values: Floats, step: int, out: Floats) -> None:
    """Fill out[i] with the lesser of values[i] and values[i + step], which is infinite beyond the end."""
    n = max(len(values) - step, 0)
    later = values[step:]
    for i in range(n):
        out[i] = later[i] if later[i] < values[i] else values[i]
    for i in range(n, len(values)):
        out[i] = values[i]


@kernel
def _windows(
    values: Floats, out: Floats, aside: Floats, low: int, high: int, first: int, last: int, end: int
) -> None:  # fmt: skip
    """Fill out[i], low <= i <= high, with the least of values[i + first .. i + last]; `end` is the last sample.

    Windows double until two of them overlap to one that is as wide as asked, in passes that take many samples at once:

        width 1  |.|
        width 2  |. .|
        width 4  |. . . .|
        width 6  |. . . .|
                     |. . . .|

    Args:
        aside: working memory, shape (at least n_samples,).
    """
    stop = min(high + last, end)  # last value that is read
    if low + first > stop:
        out[low : high + 1] = np.inf
        return
    given = values[low + first : stop + 1]
    if low == high:
        out[low] = _least(given)
        return
    n = len(given)
    width = min(last - first + 1, n)
    for i in range(low + n, high + 1):
        out[i] = np.inf
    passes, wide = 1, 2
    while wide < width:
        passes, wide = passes + 1, 2 * wide
    found, spare = out[low : low + n], aside[:n]
    source, wide = given, 1
    for k in range(passes):  # the last one ends in `found`
        step = min(wide, width - wide)
        if (passes - k) % 2:
            _lesser(source, step, found)
            source = found
        else:
            _lesser(source, step, spare)
            source = spare
        wide += step


@kernel
def _until(held: Floats, wanted: Floats, out: Floats, low: int, stop: int) -> None:
    """Fill out[low .. stop]: `wanted` comes at or after a sample, by `stop`, and `held` holds up to it."""
    found = -np.inf
    for i in range(stop, low - 1, -1):
        found = held[i] if held[i] < found else found
        found = wanted[i] if wanted[i] > found else found
        out[i] = found


@kernel
def _arithmetic(operation: int, a: Floats, b: Floats, out: Floats, n: int) -> None:
    """Fill out[0 .. n - 1] with what is computed of two numbers."""
    if operation == ADD:
        for i in range(n):
            out[i] = a[i] + b[i]
    elif operation == SUBTRACT:
        for i in range(n):
            out[i] = a[i] - b[i]
    elif operation == MULTIPLY:
        for i in range(n):
            out[i] = a[i] * b[i]
    elif operation == DIVIDE:
        for i in range(n):
            out[i] = a[i] / b[i]
    elif operation == ABS:
        for i in range(n):
            out[i] = abs(a[i])
    elif operation == SQRT:
        for i in range(n):
            out[i] = np.sqrt(a[i])
    elif operation == HYPOT:
        for i in range(n):
            out[i] = np.sqrt(a[i] * a[i] + b[i] * b[i])
    elif operation == MIN:
        for i in range(n):
            out[i] = np.minimum(a[i], b[i])
    elif operation == MAX:
        for i in range(n):
            out[i] = np.maximum(a[i], b[i])


@kernel
def _choose(operation: int, a: Floats, b: Floats, out: Floats) -> None:
    """Fill out with the one or the other."""
    n = len(out)
    if operation == NEGATE:
        for i in range(n):
            out[i] = -a[i]
    elif operation == LEAST:
        for i in range(n):
            out[i] = b[i] if b[i] < a[i] else a[i]
    elif operation == GREATEST:
        for i in range(n):
            out[i] = b[i] if b[i] > a[i] else a[i]
    elif operation == IMPLY:
        for i in range(n):
            out[i] = b[i] if b[i] > -a[i] else -a[i]


@kernel
def _compare(operation: int, a: Floats, b: Floats, out: Floats, n: int) -> int:
    """Fill out[0 .. n - 1] with a - b; return how many are not a number."""
    absent = 0
    if operation == ABOVE:
        least = b[0]
        for i in range(n):
            out[i] = a[i] - least
            absent += 1 if out[i] != out[i] else 0
    elif operation == BELOW:
        most = a[0]
        for i in range(n):
            out[i] = most - b[i]
            absent += 1 if out[i] != out[i] else 0
    else:
        for i in range(n):
            out[i] = a[i] - b[i]
            absent += 1 if out[i] != out[i] else 0
    return absent


@kernel
def evaluate(code: Ints, roots: Ints, memory: Floats, absent: Ints, n: int, robustness: Floats, when: Floats) -> None:
    """Fill the robustness of each formula, and at which sample it is decided where it is negative.

    Args:
        code, roots: of a Program.
        memory: of that program, its signals filled for n samples; shape (n_rows, at least n).
        absent: working memory, shape (n_rows,).
        n: samples, at least 1.
        robustness: NaN where a comparison has no value at some sample; shape (n_formulas,).
        when: index of the sample, NaN where robustness is not negative; shape (n_formulas,).
    """
    aside = memory[-1]
    absent[:] = 0
    for k in range(len(code)):
        operation, left, right = code[k, OPERATION], code[k, LEFT], code[k, RIGHT]
        low, high = code[k, FROM], min(code[k, TO], n - 1)
        a, b, out = memory[left], memory[right], memory[code[k, OUT]]
        lacking = absent[left] + absent[right]
        if COMPARE <= operation <= BELOW:
            lacking += _compare(operation, a, b, out, n)
        elif operation in (WINDOW, NEGATED_WINDOW):
            _windows(a, out, aside, low, high, code[k, FIRST], code[k, LAST], n - 1)
            if operation == NEGATED_WINDOW:
                for i in range(low, high + 1):
                    out[i] = -out[i]
        elif operation == UNTIL:
            _until(a, b, out, low, min(high + code[k, LAST], n - 1))
        elif operation >= NEGATE:
            _choose(operation, a[low : high + 1], b[low : high + 1], out[low : high + 1])
        else:
            _arithmetic(operation, a, b, out, n)
        absent[code[k, OUT]] = lacking
        if code[k, IS_ROOT]:
            value = out[0] if lacking == 0 else np.nan
            sample = float(_decided(code, memory, k, n)) if value < 0.0 else np.nan
            for j in range(len(roots)):
                if roots[j] == k:
                    robustness[j], when[j] = value, sample


@kernel
def _decided(code: Ints, memory: Floats, k: int, n: int) -> int:
    """Return the sample of the comparison that gives a formula its value; the last one if it lies beyond the track.

    Args:
        k: the instruction that ends the formula, and the last one that has run.
    """
    i = 0
    row = code[k, OUT]
    value = memory[row, 0]
    while True:
        while code[k, OUT] != row:
            k -= 1
        operation, left, right = code[k, OPERATION], code[k, LEFT], code[k, RIGHT]
        if COMPARE <= operation <= BELOW or i >= n:
            return min(i, n - 1)
        if operation in (NEGATE, NEGATED_WINDOW):
            value = -value
        if operation == NEGATE:
            row = left
        elif operation in (WINDOW, NEGATED_WINDOW):
            i += code[k, FIRST]
            last = min(i + code[k, LAST] - code[k, FIRST], n - 1)
            while i < last and memory[left, i] != value:
                i += 1
            row = left
        elif operation == UNTIL:
            last = min(i + code[k, LAST], n - 1)
            while i < last and memory[right, i] != value and memory[left, i] != value:
                i += 1
            row = right if memory[right, i] == value else left
        elif operation == IMPLY:
            row, value = (left, -value) if -memory[left, i] == value else (right, value)
        else:
            row = left if memory[left, i] == value else right


@kernel
def judge(
    entries: Floats, last: Floats, radii: Floats, robot_radius: float, goal_x: float, goal_y: float, code: Ints,
    roots: Ints, wanted: Ints, memory: Floats, absent: Ints, robustness: Floats, when: Floats,
) -> None:  # fmt: skip
    """Judge all formulas over one case, and fill their robustness, and when it is decided [s] where it is negative.

    Args as in `signals.take` and `evaluate`.
    """
    n = take(entries, last, radii, robot_radius, goal_x, goal_y, wanted, memory)
    evaluate(code, roots, memory, absent, n, robustness, when)
    for k in range(len(when)):
        if when[k] == when[k]:
            i = int(when[k])
            when[k] = (entries[i, 0] if i < len(entries) else last[0]) * 1e-9
