"""Formulas become a flat program: one row of memory and one instruction a sub-formula, shared where they are equal.

`eventually` is `not always not`. A bounded `until` is what A. Donze, T. Ferrere and O. Maler (Efficient Robust
Monitoring for STL, CAV 2013) split it into; minima and maxima only choose among values, so no bit is lost:

    left until[a, b] right  =  eventually[a, b] right  and  always[0, a) left  and  (left until right) a samples later

An instruction computes only the samples that some formula asks for: the root needs the first one alone. Where a formula
is decided, its rows go to the next one: memory stays in the cache, which is a third of the time that a case is judged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
 COMPARE, ABOVE, BELOW, NEGATE, LEAST, GREATEST, IMPLY, WINDOW, NEGATED_WINDOW, UNTIL) = range(19)  # fmt: skip
"""Instructions: of numbers; COMPARE, a subtraction, which is ABOVE if the right side is a constant and BELOW if the
left side is; of robustness, where WINDOW takes the least of many."""

OPERATION, LEFT, RIGHT, OUT, FROM, TO, FIRST, LAST, IS_ROOT, WIDTH = range(10)
"""Columns of an instruction: rows read and written, samples computed, samples of the window, whether a formula ends."""

END = 1 << 40
"""A sample beyond every track."""

_OF_OPERATOR = {"+": ADD, "-": SUBTRACT, "*": MULTIPLY, "/": DIVIDE}
_OF_FUNCTION = {"abs": ABS, "sqrt": SQRT, "hypot": HYPOT, "min": MIN, "max": MAX}

_SIGNAL, _CONSTANT = -1, -2  # what is no instruction
_Part = tuple[int, int | str, int, int, int]  # operation, what it reads (a name or a number's digits), first, last


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """Formulas, ready to be judged by `kernel.evaluate`.

    Rows of its memory: the signals, in the order of SIGNALS; constants; those of instructions; one to work in.
    """

    code: NDArray[np.int64]  # shape (n_instructions, WIDTH)
    roots: NDArray[np.int64]  # instruction that ends each formula, shape (n_formulas,)
    wanted: NDArray[np.int64]  # 1 for each signal that is read, shape (n_signals,)
    constants: NDArray[np.float64]

    def memory(self, n_samples: int) -> NDArray[np.float64]:
        """Return memory for tracks of at most this many samples, shape (n_rows, at least n_samples)."""
        first, line = len(self.wanted), 8  # numbers of a cache line: rows that begin with one take a third less time
        n_rows = max(first + len(self.constants), int(self.code[:, OUT].max(initial=0)) + 1) + 1
        wide = -(-n_samples // line) * line
        words = np.zeros(n_rows * wide + line)
        begin = -(words.ctypes.data // words.itemsize) % line
        rows = words[begin : begin + n_rows * wide].reshape(n_rows, wide)
        rows[first : first + len(self.constants)] = self.constants[:, np.newaxis]
        return rows


def compile_formulas(formulas: Sequence[Formula], names: Sequence[str] = tuple(SIGNALS)) -> Program:
    """Return the program of formulas over signals of these names.

    >>> from parcours_navigation.requirements.parsing import parse
    >>> near = parse("always (clearance > 0.1 -> speed < 0.2)").formula
    >>> program = compile_formulas([near, parse("eventually clearance > 0.1").formula])
    >>> len(program.code), int(program.wanted.sum())  # a comparison is shared
    (6, 2)
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
        """Return what the roots are made of; instructions stand behind those they read, a formula's together."""
        samples = self._samples(roots)
        needed = [k for k in range(len(self.parts)) if k in samples]
        rows: dict[int, int] = {}
        for k in needed:
            if self.parts[k][0] == _SIGNAL:
                rows[k] = self.names.index(str(self.parts[k][1]))
        constants = [k for k in needed if self.parts[k][0] == _CONSTANT]
        spans = self._spans(roots)
        instructions = sorted(spans, key=lambda k: (spans[k][0], k))
        wanted = np.zeros(len(self.names), np.int64)
        wanted[list(rows.values())] = 1
        rows |= {k: row for row, k in enumerate(constants, len(self.names))}
        self._assign(rows, spans, len(self.names) + len(constants))
        code = np.zeros((len(instructions), WIDTH), np.int64)
        for row, k in zip(code, instructions, strict=True):
            operation, left, right, first, last = self.parts[k]
            if operation == COMPARE and self.parts[right][0] == _CONSTANT:
                operation = ABOVE
            elif operation == COMPARE and self.parts[int(left)][0] == _CONSTANT:
                operation = BELOW
            columns = operation, rows[int(left)], rows[right], rows[k], *samples[k], first, last, k in roots
            row[:] = np.array(columns, np.int64)
        values = np.array([float.fromhex(str(self.parts[k][1])) for k in constants], np.float64)
        return Program(code, np.array([instructions.index(one) for one in roots], np.int64), wanted, values)

    def _spans(self, roots: Sequence[int]) -> dict[int, tuple[int, int]]:
        """Return the first formula and the last one that each instruction is a part of."""
        found: dict[int, tuple[int, int]] = {}
        for number, root in enumerate(roots):
            left = [root]
            while left:
                k = left.pop()
                first, last = found.get(k, (number, -1))
                if last < number and self.parts[k][0] >= 0:
                    found[k] = first, number
                    left += [int(self.parts[k][1]), self.parts[k][2]]
        return found

    def _assign(self, rows: dict[int, int], spans: Mapping[int, tuple[int, int]], row: int) -> None:
        """Give each instruction a row, from `row` on: one that no formula reads any more, if there is one.

        What decides a formula is looked for in all that it is made of, so that is kept until then.
        """
        free: list[int] = []
        held: list[tuple[int, int]] = []  # the last formula that reads a row, and the row
        for k, (formula, last) in sorted(spans.items(), key=lambda item: (item[1][0], item[0])):
            free += [each for until, each in held if until < formula]
            held = [(until, each) for until, each in held if until >= formula]
            if not free:
                free, row = [row], row + 1
            rows[k] = free.pop()
            held.append((last, rows[k]))

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
        operation, left, right, first, last = self.parts[row]
        if operation == COMPARE:  # -(a - b) and b - a are the same bits but for the sign of 0
            return self._row(COMPARE, right, int(left))
        if operation in (WINDOW, NEGATED_WINDOW):
            return self._row(WINDOW if operation == NEGATED_WINDOW else NEGATED_WINDOW, left, right, first, last)
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
