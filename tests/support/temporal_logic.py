"""Random formulas and traces, a naive recursive twin of their semantics, and their translation for rtamt."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.requirements.syntax import (
    Arithmetic,
    Comparison,
    Constant,
    Formula,
    Function,
    Interval,
    Junction,
    Negative,
    Not,
    Number,
    Signal,
    Timed,
    Until,
    signals,
)

NAMES = ("a", "b", "c")
Traces = Mapping[str, Sequence[float]]


def draw_number(rng: np.random.Generator, depth: int = 2) -> Number:
    """Return a random number; `min`, `max` and `hypot` are left out, which rtamt does not have."""
    kind = int(rng.integers(0, 8 if depth else 3))
    if kind < 2:
        return Signal(str(rng.choice(NAMES)))
    if kind == 2:
        return Constant(float(np.round(rng.uniform(0.0, 2.0), 3)))
    if kind == 3:
        return Function("abs", (draw_number(rng, depth - 1),))
    operator = "+-*/"[int(rng.integers(0, 4))]
    right = Constant(float(np.round(rng.uniform(0.5, 2.0), 3))) if operator == "/" else draw_number(rng, depth - 1)
    return Arithmetic(operator, draw_number(rng, depth - 1), right)


def draw_interval(rng: np.random.Generator, most: int) -> Interval:
    """Return a random interval; some begin or end beyond a trace of `most` samples."""
    first = int(rng.integers(0, 4) if rng.random() < 0.6 else rng.integers(0, most + 4))
    kind = rng.random()
    if kind < 0.25:
        return Interval(first if rng.random() < 0.5 else 0, None)
    return Interval(first, first + int(rng.integers(0, 6 if kind < 0.7 else most + 4)))


def draw_formula(rng: np.random.Generator, depth: int = 4, most: int = 30) -> Formula:
    """Return a random formula."""
    if depth == 0 or rng.random() < 0.12:
        operator = ("<", "<=", ">", ">=")[int(rng.integers(0, 4))]
        return Comparison(operator, draw_number(rng), draw_number(rng))
    kind = int(rng.integers(0, 8))
    inner = functools.partial(draw_formula, rng, depth - 1, most)
    if kind == 0:
        return Not(inner())
    if kind <= 3:
        return Junction(("and", "or", "->")[kind - 1], inner(), inner())
    if kind <= 5:
        return Timed(("always", "eventually")[kind - 4], draw_interval(rng, most), inner())
    return Until(inner(), draw_interval(rng, most), inner())


def draw_traces(rng: np.random.Generator, n: int) -> dict[str, list[float]]:
    """Return random signals of n samples; some are steps, so that values are equal."""
    found = {}
    for name in NAMES:
        values = rng.normal(0.0, 1.0, n) if rng.random() < 0.6 else np.round(rng.normal(0.0, 1.0, n))
        found[name] = (values if rng.random() < 0.5 else np.repeat(values, 3)[:n]).tolist()
    return found


def number(node: Number, traces: Traces, i: int) -> float:
    """Return the value of a number at a sample."""
    match node:
        case Constant(value):
            return value
        case Signal(name):
            return float(traces[name][i])
        case Negative(operand):
            return -number(operand, traces, i)
        case Function(name, arguments):
            values = [np.float64(number(one, traces, i)) for one in arguments]
            with np.errstate(all="ignore"):
                compute: Any = {"abs": abs, "sqrt": np.sqrt, "min": np.minimum, "max": np.maximum,
                                "hypot": lambda x, y: np.sqrt(x * x + y * y)}[name]  # fmt: skip
                return float(compute(*values))
        case Arithmetic(operator, left, right):
            x, y = np.float64(number(left, traces, i)), np.float64(number(right, traces, i))
            with np.errstate(all="ignore"):
                return float({"+": x + y, "-": x - y, "*": x * y, "/": x / y}[operator])


def robustness(node: Formula, traces: Traces, i: int = 0) -> float:
    """Return the robustness of a formula at a sample by its definition, one case a line."""
    n = len(next(iter(traces.values())))

    def span(interval: Interval) -> range:
        return range(i + interval.first, n if interval.last is None else min(i + interval.last + 1, n))

    def of(part: Formula, at: int = i) -> float:
        return robustness(part, traces, at)

    match node:
        case Comparison(operator, left, right):
            gap = number(left, traces, i) - number(right, traces, i)
            return gap if operator in (">", ">=") else -gap
        case Signal(name):
            return float(traces[name][i])
        case Not(operand):
            return -of(operand)
        case Junction("and", left, right):
            return min(of(left), of(right))
        case Junction("or", left, right):
            return max(of(left), of(right))
        case Junction(_, left, right):
            return max(-of(left), of(right))
        case Timed("always", interval, operand):
            return min((of(operand, t) for t in span(interval)), default=math.inf)
        case Timed(_, interval, operand):
            return max((of(operand, t) for t in span(interval)), default=-math.inf)
        case Until(left, interval, right):
            reached = (min([of(right, t), *(of(left, s) for s in range(i, t))]) for t in span(interval))
            return max(reached, default=-math.inf)


def to_rtamt(node: Formula | Number, n: int) -> str:
    """Return the formula in rtamt's syntax, its sampling period 1 s, for traces of n samples."""

    def of(part: Formula | Number) -> str:
        return to_rtamt(part, n)

    def within(interval: Interval) -> str:
        last = interval.first + n if interval.last is None else interval.last
        return f"[{interval.first}:{last}]"

    match node:
        case Constant(value):
            return f"({value:.17f})" if value < 1e15 else f"({value!r})"
        case Signal(name):
            return name
        case Negative(operand):
            return f"(0.0 - {of(operand)})"
        case Function(name, arguments):
            return f"{name}({', '.join(map(of, arguments))})"
        case Arithmetic(operator, left, right) | Comparison(operator, left, right):
            return f"({of(left)} {operator} {of(right)})"
        case Not(operand):
            return f"(not({of(operand)}))"
        case Junction(operator, left, right):
            return f"({of(left)} {operator} {of(right)})"
        case Timed(operator, interval, operand):
            return f"({operator}{within(interval)} ({of(operand)}))"
        case Until(left, interval, right):
            return f"(({of(left)}) until{within(interval)} ({of(right)}))"


def by_rtamt(node: Formula, traces: Traces) -> float:
    """Return the robustness that rtamt computes offline, in discrete time, at the first sample."""
    from rtamt import StlDiscreteTimeOfflineSpecification

    n = len(next(iter(traces.values())))
    read = signals(node)
    spec = StlDiscreteTimeOfflineSpecification()
    for name in sorted(read):
        spec.declare_var(name, "float")
    spec.spec = to_rtamt(node, n)
    spec.parse()
    data: dict[str, list[float]] = {"time": [float(k) for k in range(n)]}
    data |= {name: list(traces[name]) for name in read}
    return float(spec.evaluate(data)[0][1])


def ours(formulas: Sequence[Formula], traces: Traces) -> NDArray[np.float64]:
    """Return the robustness that the kernel computes."""
    from parcours_navigation.requirements.requirement import robustness_of

    return robustness_of(formulas, traces)[0]
