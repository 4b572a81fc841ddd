"""The tokens of formulas in signal temporal logic, and what messages say about them."""

from __future__ import annotations

import re

from parcours.errors import BadRequest
from parcours.model.expression.parsing import MAX_LENGTH
from parcours.model.expression.tokens import Tokens

MAX_DEPTH = 40
"""Deepest formula, so that every walk over it may recurse."""

_HINTS = {
    "=": "numbers that are measured are hardly ever equal: write abs(a - b) <= tolerance",
    "&": "write and",
    "|": "write or",
    "!": "write not",
    ":": "part the ends of an interval by a comma",
}


class FormulaTokens(Tokens):
    """The tokens of a formula. Raises BadRequest: the text is too long, or has a sign that no formula has."""

    pattern = re.compile(
        r"""(?P<blank>[ \t\r\n]+)
          | (?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
          | (?P<name>[A-Za-z_][A-Za-z0-9_]*)
          | (?P<sign>->|<=|>=|[-+*/<>()\[\],^])""",
        re.VERBOSE,
    )
    hints = _HINTS
    noun = "a formula"
    most = (MAX_LENGTH, MAX_DEPTH)
    shorten = ("split it at its `and`s",) * 2
    slugs = ("require-syntax", "require-size")
    refusal = BadRequest
