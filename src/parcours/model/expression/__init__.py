"""The language of guards, actions and formulas over messages: its parser, syntax tree, types and values.

It knows nothing of machines, so constraints over test data are written in it too.
"""

from parcours.model.expression.evaluation import evaluate
from parcours.model.expression.parsing import parse_actions, parse_calls, parse_expression, parse_formula
from parcours.model.expression.syntax import (
    Apply,
    Assignment,
    Binary,
    Call,
    Each,
    Expression,
    FieldAccess,
    Item,
    Literal,
    Name,
    Unary,
    names,
)
from parcours.model.expression.typing import BOOL, INT, REAL, TEXT, Type, type_of

__all__ = [
    "BOOL", "INT", "REAL", "TEXT", "Apply", "Assignment", "Binary", "Call", "Each", "Expression", "FieldAccess", "Item",
    "Literal", "Name", "Type", "Unary", "evaluate", "names", "parse_actions", "parse_calls", "parse_expression",
    "parse_formula", "type_of",
]  # fmt: skip
