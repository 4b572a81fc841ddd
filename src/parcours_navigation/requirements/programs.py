"""Formulas become a flat program: one row of memory and one instruction a sub-formula, shared where they are equal.

`eventually` is `not always not`. A bounded `until` is what A. Donze, T. Ferrere and O. Maler (Efficient Robust
Monitoring for STL, CAV 2013) split it into; minima and maxima only choose among values, so no bit is lost:

    left until[a, b] right  =  eventually[a, b] right  and  always[0, a) left  and  (left until right) a samples later

An instruction computes only the samples that some formula asks for: the root needs the first one alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
    Node,
    Not,
    Number,
    Signal,
    Timed,
    Until,
)
from parcours_navigation.requirements.vocabulary import SIGNALS

(ADD, SUBTRACT, MULTIPLY, DIVIDE, ABS, SQRT, HYPOT, MIN, MAX,
 COMPARE, NEGATE, LEAST, GREATEST, IMPLY, WINDOW, UNTIL) = range(16)  # fmt: skip
"""Instructions: of numbers; COMPARE, a subtraction; of robustness, where WINDOW takes the least of many."""

OPERATION, LEFT, RIGHT, FROM, TO, FIRST, LAST, WIDTH = range(8)
"""Columns of an instruction: rows read, samples computed, samples of the window."""

END = 1 << 40
"""A sample beyond every track."""

_OF_OPERATOR = {"+": ADD, "-": SUBTRACT, "*": MULTIPLY, "/": DIVIDE}
_OF_FUNCTION = {"abs": ABS, "sqrt": SQRT, "hypot": HYPOT, "min": MIN, "max": MAX}

_SIGNAL, _CONSTANT = -1, -2  # what is no instruction
_Part = tuple[int, int | str, int, int, int]  # operation, what it reads (a name or a number's digits), first, last


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """Formulas, ready to be judged by `kernel.evaluate`.

    Rows of its memory: the signals, in the order of SIGNALS; constants; one row an instruction; one to work in.
    """

    code: NDArray[np.int64]  # shape (n_instructions, WIDTH)
    roots: NDArray[np.int64]  # row of each formula, shape (n_formulas,)
    wanted: NDArray[np.int64]  # 1 for each signal that is read, shape (n_signals,)
    constants: NDArray[np.float64]

    def memory(self, n_samples: int) -> NDArray[np.float64]:
        """Return memory for tracks of at most this many samples, shape (n_rows, n_samples)."""
        first = len(self.wanted)
        rows = np.zeros((first + len(self.constants) + len(self.code) + 1, n_samples))
        rows[first : first + len(self.constants)] = self.constants[:, np.newaxis]
        return rows


def compile_formulas(formulas: Sequence[Formula], names: Sequence[str] = tuple(SIGNALS)) -> Program:
    """Return the program of formulas over signals of these names.

    >>> from parcours_navigation.requirements.parsing import parse
    >>> near = parse("always (clearance > 0.1 -> speed < 0.2)").formula
    >>> program = compile_formulas([near, parse("eventually clearance > 0.1").formula])
    >>> len(program.code), int(program.wanted.sum())  # a comparison is shared
    (7, 2)
    """
    compiler = _Compiler(list(names))
    return compiler.program([compiler.formula(one) for one in formulas])


class _Compiler:
    # Signals, constants and instructions are numbered as they are met; equal ones have one number.
    def __init__(self, names: list[str]) -> None:
        self.names = names
        self.parts: list[_Part] = []
        self.known: dict[_Part, int] = {}
        self.made: dict[Formula, int] = {}

    def program(self, roots: Sequence[int]) -> Program:
        """Return what the roots are made of; instructions stand behind those they read, as they were met."""
        samples = self._samples(roots)
        needed = [k for k in range(len(self.parts)) if k in samples]
        rows: dict[int, int] = {}
        for k in needed:
            if self.parts[k][0] == _SIGNAL:
                rows[k] = self.names.index(str(self.parts[k][1]))
        constants = [k for k in needed if self.parts[k][0] == _CONSTANT]
        instructions = [k for k in needed if self.parts[k][0] >= 0]
        wanted = np.zeros(len(self.names), np.int64)
        wanted[list(rows.values())] = 1
        for k in (*constants, *instructions):
            rows[k] = len(self.names) + len(rows) - int(wanted.sum())
        code = np.zeros((len(instructions), WIDTH), np.int64)
        for row, k in zip(code, instructions, strict=True):
            operation, left, right, first, last = self.parts[k]
            columns = operation, rows[int(left)], rows[right], *samples[k], first, last
            row[:] = np.array(columns, np.int64)
        values = np.array([float.fromhex(str(self.parts[k][1])) for k in constants], np.float64)
        return Program(code, np.array([rows[one] for one in roots], np.int64), wanted, values)

    def _samples(self, roots: Sequence[int]) -> dict[int, tuple[int, int]]:
        """Return which samples of each part are needed, both ends included.

        A comparison is looked at all along the track: one without a value anywhere has none for its formula.
        """
        found = dict.fromkeys(roots, (0, 0))
        for k in range(len(self.parts) - 1, -1, -1):
            operation, left, right, first, last = self.parts[k]
            if k not in found or operation < 0:
                continue
            if operation == COMPARE:
                found[k] = 0, END
            low, high = found[k]
            needed = low + first, min(high + last, END)
            for part in (int(left), right):
                known = found.get(part, needed)
                found[part] = min(known[0], needed[0]), max(known[1], needed[1])
        return found

    def _row(self, operation: int, left: int | str, right: int = 0, first: int = 0, last: int = 0) -> int:
        part = (operation, left, right, first, last)
        if part not in self.known:
            self.known[part] = len(self.parts)
            self.parts.append(part)
        return self.known[part]

    def _constant(self, value: float) -> int:
        return self._row(_CONSTANT, value.hex())

    def _not(self, row: int) -> int:
        operation, left, right, *_ = self.parts[row]
        if operation == COMPARE:  # -(a - b) and b - a are the same bits but for the sign of 0
            return self._row(COMPARE, right, int(left))
        return int(left) if operation == NEGATE else self._row(NEGATE, row, row)

    def _window(self, row: int, first: int, last: int | None) -> int:
        return self._row(WINDOW, row, row, first, END if last is None else last)

    def _eventually(self, row: int, first: int, last: int | None) -> int:
        return self._not(self._window(self._not(row), first, last))

    def formula(self, node: Formula) -> int:
        """Return the instruction that computes a formula."""
        if node not in self.made:
            self.made[node] = self._formula(node)
        return self.made[node]

    def _formula(self, node: Formula) -> int:
        match node:
            case Comparison(operator, left, right):
                greater, less = (left, right) if operator in (">", ">=") else (right, left)
                return self._row(COMPARE, self.number(greater), self.number(less))
            case Signal(name):
                return self._row(COMPARE, self._row(_SIGNAL, name), self._constant(0.0))
            case Not(operand):
                return self._not(self.formula(operand))
            case Junction(operator, left, right):
                operation = {"and": LEAST, "or": GREATEST, "->": IMPLY}[operator]
                return self._row(operation, self.formula(left), self.formula(right))
            case Timed("always", interval, operand):
                return self._window(self.formula(operand), interval.first, interval.last)
            case Timed(_, interval, operand):
                return self._eventually(self.formula(operand), interval.first, interval.last)
            case Until(left, interval, right):
                return self._until(self.formula(left), interval, self.formula(right))

    def _until(self, left: int, interval: Interval, right: int) -> int:
        #     samples      i ........ i+a ........ t ... i+b
        #     right                   [            *      ]      somewhere between a and b
        #     left         [--------------------- )              up to there
        first, last = interval.first, interval.last
        found = self._row(UNTIL, left, right, 0, END if last is None else last - first)
        if first:
            found = self._row(LEAST, self._window(left, 0, first - 1), self._eventually(found, first, first))
        if last is not None:
            found = self._row(LEAST, self._eventually(right, first, last), found)
        return found

    def number(self, node: Number) -> int:
        """Return the row of a number; what has no signals becomes a constant."""
        value = _value(node)
        if value is not None:
            return self._constant(value)
        match node:
            case Signal(name):
                return self._row(_SIGNAL, name)
            case Negative(operand):
                row = self.number(operand)
                return self._row(NEGATE, row, row)
            case Arithmetic(operator, left, right):
                return self._row(_OF_OPERATOR[operator], self.number(left), self.number(right))
            case Function(name, arguments):
                rows = [self.number(one) for one in arguments]
                return self._row(_OF_FUNCTION[name], rows[0], rows[-1])
            case Constant():  # has a value
                raise AssertionError(node)


def _value(node: Node) -> float | None:
    """Return the value of a number without signals, as a kernel would compute it; None if it reads one."""
    match node:
        case Constant(value):
            return value
        case Negative(operand):
            inner = _value(operand)
            return None if inner is None else -inner
        case Arithmetic(operator, left, right):
            a, b = _value(left), _value(right)
            return None if a is None or b is None else _computed(_OF_OPERATOR[operator], a, b)
        case Function(name, arguments):
            values = [_value(one) for one in arguments]
            if any(one is None for one in values):
                return None
            return _computed(_OF_FUNCTION[name], values[0], values[-1])  # type: ignore[arg-type]
        case _:
            return None


def _computed(operation: int, a: float, b: float) -> float:
    x, y = np.float64(a), np.float64(b)
    with np.errstate(all="ignore"):
        found = {
            ADD: x + y, SUBTRACT: x - y, MULTIPLY: x * y, DIVIDE: x / y, ABS: abs(x), SQRT: np.sqrt(x),
            HYPOT: np.sqrt(x * x + y * y), MIN: np.minimum(x, y), MAX: np.maximum(x, y),
        }[operation]  # fmt: skip
    return math.nan if np.isnan(found) else float(found)
