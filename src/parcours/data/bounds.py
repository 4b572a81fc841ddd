"""Tells by interval arithmetic whether a condition can hold where each input has a least and a greatest value.

Interval arithmetic with the same floating-point operations as `constraints.meets`, each of which is monotone: what is
called impossible here is false for every value between the bounds. The reverse is not promised, except for points.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.data.constraints import is_condition
from parcours.model.expression import Apply, Binary, Expression, Literal, Name, Unary

Floats: TypeAlias = NDArray[np.float64]
Bounds: TypeAlias = tuple[Floats, Floats]
"""The least and the greatest value [unit of the input], arrays of one shape."""

Chance: TypeAlias = tuple[NDArray[np.bool_], NDArray[np.bool_]]
"""Whether a condition may be true, and whether it may be false."""


def may_hold(condition: Expression, bounds: Mapping[str, Bounds]) -> NDArray[np.bool_]:
    """Return where the condition can hold for values within the bounds."""
    with np.errstate(all="ignore"):
        return _chance(condition, bounds)[0]


def _chance(node: Expression, bounds: Mapping[str, Bounds]) -> Chance:
    match node:
        case Literal(value):
            return np.array(bool(value)), np.array(not value)
        case Unary("!", operand):
            true, false = _chance(operand, bounds)
            return false, true
        case Binary("&&" | "||" as operator, left, right):
            (true, false), (true_too, false_too) = _chance(left, bounds), _chance(right, bounds)
            both = operator == "&&"
            return (true & true_too, false | false_too) if both else (true | true_too, false & false_too)
        case Binary("==" | "!=" as operator, left, right) if is_condition(left):
            (true, false), (true_too, false_too) = _chance(left, bounds), _chance(right, bounds)
            same, other = (true & true_too) | (false & false_too), (true & false_too) | (false & true_too)
            return (same, other) if operator == "==" else (other, same)
        case Binary(operator, left, right):
            return _compared(operator, _range(left, bounds), _range(right, bounds))
        case _:
            raise AssertionError(f"the reader lets no {node} through as a condition")


def _compared(operator: str, left: Bounds, right: Bounds) -> Chance:
    (low, high), (low_too, high_too) = left, right
    match operator:
        case "<":
            return low < high_too, high >= low_too
        case "<=":
            return low <= high_too, high > low_too
        case ">":
            return high > low_too, low <= high_too
        case ">=":
            return high >= low_too, low < high_too
        case _:
            meet = (low <= high_too) & (low_too <= high)
            apart = ~((low == high) & (low_too == high_too) & (low == low_too))
            return (meet, apart) if operator == "==" else (apart, meet)


def _range(node: Expression, bounds: Mapping[str, Bounds]) -> Bounds:
    match node:
        case Literal(value):
            return np.array(float(value)), np.array(float(value))
        case Name(id):
            return bounds[id]
        case Unary("-", operand):
            low, high = _range(operand, bounds)
            return -high, -low
        case Binary("%", left, right):
            return _remainder(_range(left, bounds), _range(right, bounds))
        case Binary(operator, left, right):
            return _combined(operator, _range(left, bounds), _range(right, bounds))
        case Apply(function, arguments):
            return _applied(function, [_range(argument, bounds) for argument in arguments])
        case _:
            raise AssertionError(f"the reader lets no {node} through as a number")


def _combined(operator: str, left: Bounds, right: Bounds) -> Bounds:
    if operator == "+":
        return _known(left[0] + right[0], left[1] + right[1])
    if operator == "-":
        return _known(left[0] - right[1], left[1] - right[0])
    # A product or quotient is least and greatest at corners of the rectangle left x right:
    #
    #     right[1]  x---------x
    #               |         |      where right holds 0, a quotient has no bound at all
    #     right[0]  x---------x
    #            left[0]   left[1]
    work = np.multiply if operator == "*" else np.divide
    corners = np.stack(np.broadcast_arrays(*(work(a, b) for a, b in itertools.product(left, right))))
    low, high = _known(corners.min(axis=0), corners.max(axis=0))
    if operator == "*":
        return low, high
    splits = (right[0] <= 0) & (right[1] >= 0)  # dividing by what may be zero can give anything
    return np.where(splits, -np.inf, low), np.where(splits, np.inf, high)


def _remainder(left: Bounds, right: Bounds) -> Bounds:
    points = (left[0] == left[1]) & (right[0] == right[1])
    exact = np.mod(left[0], right[0])
    size = np.maximum(np.abs(right[0]), np.abs(right[1]))
    return _known(np.where(points, exact, -size), np.where(points, exact, size))


def _applied(function: str, arguments: list[Bounds]) -> Bounds:
    (low, high), *others = arguments
    match function:
        case "abs":
            return _size((low, high))
        case "floor":
            return np.floor(low), np.floor(high)
        case "sqrt":
            return _known(np.sqrt(np.maximum(low, 0.0)), np.sqrt(np.maximum(high, 0.0)))
        case "hypot":
            sizes = [_size(each) for each in arguments]
            least, most = (sizes[0][end] * sizes[0][end] for end in (0, 1))
            for size in sizes[1:]:
                least, most = least + size[0] * size[0], most + size[1] * size[1]
            return _known(np.sqrt(least), np.sqrt(most))
        case "min" | "max":
            pick = np.minimum if function == "min" else np.maximum
            for other in others:
                low, high = pick(low, other[0]), pick(high, other[1])
            return low, high
        case _:
            raise AssertionError(f"the reader lets no {function} through")


def _size(bounds: Bounds) -> Bounds:
    low, high = bounds
    least = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(np.abs(low), np.abs(high)))
    return least, np.maximum(np.abs(low), np.abs(high))


def _known(low: Floats, high: Floats) -> Bounds:
    """Return the bounds, without limit where they have no value."""
    undefined = np.isnan(low) | np.isnan(high)
    return np.where(undefined, -np.inf, low), np.where(undefined, np.inf, high)
