"""Evaluates rules between inputs for all rows of a table at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias
from typing import Literal as TypingLiteral

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadDomain
from parcours.model.expression import Apply, Binary, Expression, Literal, Name, Unary, names

if TYPE_CHECKING:
    from parcours.data.inputs import InputModel

Columns = Mapping[str, NDArray[np.float64]]
"""The values of each input, by name, all of shape (n_rows,)."""

_ARITHMETIC: dict[str, Callable[..., NDArray[np.float64]]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "%": np.mod,
}  # fmt: skip
_COMPARISON: dict[str, Callable[..., NDArray[np.bool_]]] = {
    "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal, "!=": np.not_equal,
}  # fmt: skip

Over: TypeAlias = TypingLiteral["values", "blocks"]
"""What the numbers of a rule are: values of the inputs, or indices of their blocks."""


@dataclass(frozen=True, slots=True)
class Constraint:
    """A rule that every row must meet: a condition over input names, and why it is there.

    Attributes:
        name: what the rule is called.
        expression: the condition, over numbers only; names of an enumeration or of blocks are their places in it.
        doc: why the rule is there.
        over: whether the condition speaks of values or of blocks.
        text: the condition as people write it, where that differs: with the names in place of the numbers.
    """

    name: str
    expression: Expression
    doc: str = ""
    over: Over = "values"
    text: str = ""

    @property
    def inputs(self) -> frozenset[str]:
        """The names of the inputs that the rule speaks of."""
        return names(self.expression)

    def __str__(self) -> str:
        return f"{self.name}: {self.text or self.expression}"


def meets(constraint: Constraint, columns: Columns) -> NDArray[np.bool_]:
    """Return whether each row meets the constraint, shape (n_rows,).

    The answer is that of `evaluate` row by row, except that hypot is the root of the sum of squares here,
    whose bits IEEE 754 fixes on every machine: on rows within rounding of the limit the two may differ.
    """
    n_rows = len(next(iter(columns.values())))
    try:
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            return np.broadcast_to(truth_of(constraint.expression, columns), (n_rows,))
    except FloatingPointError as error:
        rule = f"a condition must have a value on every row, but {constraint.expression} meets a {error}"
        remedy = "guard it: `x != 0 && 1 / x < 2` reads its right side only where the left holds"
        raise BadDomain(f"constraint {constraint.name!r}", rule, remedy, slug="constraint-undefined") from None


def allows(model: InputModel, values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which rows of values, shape (n_rows, n_inputs), meet all constraints of a model, shape (n_rows,)."""
    columns = {name: values[:, k] for k, name in enumerate(model.names)}
    met = np.ones(len(values), bool)
    for one in model.constraints:
        if one.over == "values":
            met &= meets(one, columns)
        else:
            blocks = model.blocks_of(values).astype(np.float64)
            met &= meets(one, {name: blocks[:, k] for k, name in enumerate(model.names)})
    return met


def truth_of(node: Expression, columns: Columns) -> NDArray[np.bool_]:
    """Return where a condition over numbers and truth values holds, of a shape that broadcasts to (n_rows,).

    `&&` and `||` read their right side only where it matters. NumPy's state decides what becomes of a division by zero.
    """
    match node:
        case Literal(value):
            return np.array(bool(value))
        case Name(id):
            return columns[id].astype(bool)
        case Unary("!", operand):
            return ~truth_of(operand, columns)
        case Binary("&&" | "||" as operator, left, right):
            first = np.array(np.broadcast_to(truth_of(left, columns), (len(next(iter(columns.values()))),)))
            # The right side is read only on the rows it decides, as the language says.
            undecided = first if operator == "&&" else ~first
            if undecided.any():
                first[undecided] = truth_of(right, {name: column[undecided] for name, column in columns.items()})
            return first
        case Binary("==" | "!=" as operator, left, right) if is_condition(left) or is_condition(right):
            return _COMPARISON[operator](truth_of(left, columns), truth_of(right, columns))
        case Binary(operator, left, right):
            return _COMPARISON[operator](_number(left, columns), _number(right, columns))
        case _:
            raise AssertionError(f"the reader lets no {node} through as a condition")


def is_condition(node: Expression) -> bool:
    """Return whether an expression of a constraint is true or false, not a number."""
    match node:
        case Literal(value):
            return isinstance(value, bool)
        case Unary(operator, _):
            return operator == "!"
        case Binary(operator, _, _):
            return operator in _COMPARISON or operator in ("&&", "||")
        case _:
            return False


def _number(node: Expression, columns: Columns) -> NDArray[np.float64]:
    match node:
        case Literal(value):
            return np.array(float(value))
        case Name(id):
            return columns[id]
        case Unary("-", operand):
            return -_number(operand, columns)
        case Binary(operator, left, right):
            return _ARITHMETIC[operator](_number(left, columns), _number(right, columns))
        case Apply(function, arguments):
            return _applied(function, [_number(argument, columns) for argument in arguments])
        case _:
            raise AssertionError(f"the reader lets no {node} through as a number")


def _applied(function: str, arguments: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    first, *others = arguments
    match function:
        case "abs":
            return np.abs(first)
        case "floor":
            return np.floor(first)
        case "sqrt":
            return np.sqrt(first)
        case "hypot":
            total = first * first
            for other in others:
                total = total + other * other
            return np.sqrt(total)
        case "min" | "max":
            pick = np.minimum if function == "min" else np.maximum
            for other in others:
                first = pick(first, other)
            return first
        case _:
            raise AssertionError(f"the reader lets no {function} through")
