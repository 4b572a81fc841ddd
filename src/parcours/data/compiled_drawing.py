"""Draws the values that `drawing` draws, with the same bits, compiled: for models that are drawn from again and again.

The constraints become a flat program in postfix order, which is run on each row as soon as it is drawn. What such a
program does not say, or what no row meets, is left to `drawing`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.data.drawing import TRIES, checked, draw, ends_of
from parcours.data.inputs import InputModel
from parcours.data.selecting import Rows
from parcours.kernels import is_compiled, kernel
from parcours.model.expression import Apply, Binary, Expression, Literal, Name, Unary
from parcours.streams import GOLDEN, VALUES, mix, starts

Floats = NDArray[np.float64]
Code = NDArray[np.int64]

_NUMBER, _INPUT, _DEMAND = 0, 1, 2  # push a number, push an input's value; draw again unless the top is true
_BINARY = {"+": 3, "-": 4, "*": 5, "<": 6, "<=": 7, ">": 8, ">=": 9, "==": 10, "!=": 11, "&&": 12, "||": 13,
           "min": 14, "max": 15, "square": 16}  # fmt: skip
"""`square` adds the square of the top to the number below it, as `hypot` does."""
_UNARY = {"-": 17, "!": 18, "abs": 19, "floor": 20, "sqrt": 21}
_ADD, _SUBTRACT, _TIMES, _LESS, _UP_TO, _ABOVE, _FROM, _SAME, _OTHER, _AND, _OR, _MIN, _MAX, _SQUARE = _BINARY.values()
_NEGATIVE, _NOT, _ABS, _FLOOR, _ROOT = _UNARY.values()
_REAL, _WHOLE, _ANGLE = range(3)
_TURN = 2.0 * math.pi
_MET, _UNDEFINED = -1, -2
_S11 = np.uint64(11)


class _NoProgramError(Exception):
    """The expression has a part that may be undefined, or is unknown here."""


class Drawer:
    """Draws from one model."""

    def __init__(self, model: InputModel) -> None:
        self._model = model
        ends = [np.array(ends_of(domain)) for domain in model.domains]
        self._ends = np.zeros((len(ends), max(map(len, ends), default=0), 4))
        for column, table in enumerate(ends):
            self._ends[column, : len(table)] = table
        kinds = {"integer": _WHOLE, "enumeration": _WHOLE, "angle": _ANGLE}
        self._kinds = np.array([kinds.get(domain.kind, _REAL) for domain in model.domains], np.int64)
        self._code: Code | None = None
        numbers: list[float] = []
        try:
            code = [step for one in model.constraints if one.over == "values"
                    for step in (*_program(one.expression, model.names, numbers), (_DEMAND, 0))]  # fmt: skip
        except _NoProgramError:
            return
        if is_compiled():
            self._code, self._numbers = np.array(code, np.int64).reshape(len(code), 2), np.array(numbers)
            self._stack = np.zeros(len(code) + 1)

    def draw(self, rows: Rows, cases: NDArray[np.int64], *, seed: int = 0, tries: int = TRIES) -> Floats:
        """Return what `drawing.draw` does, for the same arguments; raises as it does."""
        if self._code is None:
            return draw(self._model, rows, cases, seed=seed, tries=tries)
        checked(self._model, rows, cases)
        values = np.empty(rows.shape)
        status = _draw_rows(
            self._code, self._numbers, self._ends, self._kinds, rows, starts(seed, cases, VALUES), tries, self._stack,
            values,
        )  # fmt: skip
        return values if status == _MET else draw(self._model, rows, cases, seed=seed, tries=tries)


def _program(node: Expression, names: Sequence[str], numbers: list[float]) -> Iterator[tuple[int, int]]:
    """Yield the steps that leave an expression's value on top of the stack; what they push is added to the numbers."""
    match node:
        case Literal(value) if not isinstance(value, str):
            numbers.append(float(value))
            yield _NUMBER, len(numbers) - 1
        case Name(id):
            yield _INPUT, names.index(id)
        case Unary(operator, operand):
            yield from _program(operand, names, numbers)
            yield _UNARY[operator], 0
        case Binary(operator, left, right) if operator in _BINARY:
            yield from _program(left, names, numbers)
            yield from _program(right, names, numbers)
            yield _BINARY[operator], 0
        case Apply("abs" | "floor" as function, arguments):
            yield from _program(arguments[0], names, numbers)
            yield _UNARY[function], 0
        case Apply("min" | "max" | "hypot" as function, arguments):
            if function == "hypot":
                numbers.append(0.0)
                yield _NUMBER, len(numbers) - 1
            for k, argument in enumerate(arguments):
                yield from _program(argument, names, numbers)
                if function == "hypot" or k > 0:
                    yield _BINARY["square" if function == "hypot" else function], 0
            if function == "hypot":
                yield _UNARY["sqrt"], 0
        case _:  # a quotient, a remainder, a root: they may have no value
            raise _NoProgramError


@kernel
def _holds(code: Code, numbers: Floats, row: Floats, stack: Floats) -> int:
    """Return 1 if a row meets all demands, 0 if not, _UNDEFINED if a number on the way is not finite."""
    top = -1
    for i in range(code.shape[0]):
        step = code[i, 0]
        if step in (_NUMBER, _INPUT):
            top += 1
            stack[top] = numbers[code[i, 1]] if step == _NUMBER else row[code[i, 1]]
            continue
        if step == _DEMAND:
            if stack[top] == 0.0:
                return 0
            top -= 1
            continue
        b = stack[top]
        if step >= _NEGATIVE:
            if step == _NEGATIVE:
                b = -b
            elif step == _NOT:
                b = 1.0 if b == 0.0 else 0.0
            elif step == _ABS:
                b = abs(b)
            elif step == _FLOOR:
                b = np.floor(b)
            else:
                b = np.sqrt(b)
            stack[top] = b
            continue
        top -= 1
        a = stack[top]
        if step == _ADD:
            a = a + b
        elif step == _SUBTRACT:
            a = a - b
        elif step == _TIMES:
            a = a * b
        elif step == _SQUARE:
            a = a + b * b
        elif step in (_MIN, _MAX):
            a = b if (b < a) == (step == _MIN) else a
        else:
            true = a <= b if step == _UP_TO else a < b
            if step in (_ABOVE, _FROM):
                true = a > b if step == _ABOVE else a >= b
            elif step in (_SAME, _OTHER):
                true = (a == b) == (step == _SAME)
            elif step == _AND:
                true = a != 0.0 and b != 0.0
            elif step == _OR:
                true = a != 0.0 or b != 0.0
            a = 1.0 if true else 0.0
        if not np.isfinite(a):
            return _UNDEFINED
        stack[top] = a
    return 1


@kernel
def _draw_rows(
    code: Code, numbers: Floats, ends: Floats, kinds: Code, rows: Rows, start: NDArray[np.uint64], tries: int,
    stack: Floats, values: Floats,
) -> int:  # fmt: skip
    """Fill in the first draw of each row that meets all demands; return _MET, _UNDEFINED, or the row that has none."""
    n = values.shape[1]
    for r in range(values.shape[0]):
        word, held = start[r], 0
        for _ in range(tries):
            for c in range(n):
                word = word + GOLDEN
                end = ends[c, rows[r, c]]
                value = end[0] + (end[1] - end[0]) * (float(mix(word) >> _S11) * 1.1102230246251565e-16)
                if kinds[c] == _WHOLE:
                    value = np.floor(value)
                value = min(max(value, end[2]), end[3])
                if kinds[c] == _ANGLE:
                    value = value - _TURN if value > math.pi else value
                    value = value + _TURN if value <= -math.pi else value
                values[r, c] = value
            held = _holds(code, numbers, values[r], stack)
            if held != 0:
                break
        if held != 1:
            return _UNDEFINED if held == _UNDEFINED else r
    return _MET
