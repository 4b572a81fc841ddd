"""Formulas of the guard language over places of messages, such as `abs(cmd_vel.linear.x) < 0.01`.

The guard language knows no indices and no lenses: each place in the text becomes a name of its own before the
language's parser sees it, so nothing is ever evaluated here either.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import Expression, Name, Type, evaluate, parse_expression, type_of
from parcours.model.expression.evaluation import FUNCTIONS
from parcours.model.expression.parsing import MAX_LENGTH, RESERVED
from parcours.run.binding.places import LENSES, PATH, Place, parse_place

_PIECE = re.compile(
    rf"""(?P<text>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")
       | (?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
       | (?P<lens>(?:{"|".join(LENSES)})\s*\(\s*{PATH}\s*\))
       | (?P<path>{PATH})(?P<open>\s*\()?""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
_MARK = re.compile(r"\b_([0-9]+)\b")


@dataclass(frozen=True, slots=True)
class PlacedFormula:
    """An expression whose names `_0`, `_1`, ... stand for `places`, in this order."""

    text: str
    expression: Expression
    places: tuple[Place, ...]
    line: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return self.text

    @property
    def place(self) -> Place | None:
        """The place that the formula consists of, or None if it is more, or less, than one place."""
        return self.places[0] if isinstance(self.expression, Name) else None

    def value(self, values: Mapping[Place, object], where: str) -> object:
        """Return its value.

        Args:
            values: the value of each of its places.
            where: what the formula belongs to, for the error message.

        Raises:
            BadModel: it cannot be computed from these values: a division by zero, or another type than needed.
        """
        valuation = {f"_{number}": values[place] for number, place in enumerate(self.places)}
        try:
            return evaluate(self.expression, valuation, where)
        except BadModel as error:
            raise self._readable(error) from None

    def type(self, types: Mapping[Place, Type], where: str) -> Type:
        """Return its type.

        Args:
            types: the type of each of its places.
            where: what the formula belongs to, for the error message.

        Raises:
            BadModel: its operators and functions do not work on these types.
        """
        try:
            return type_of(self.expression, {f"_{n}": types[place] for n, place in enumerate(self.places)}, where=where)
        except BadModel as error:
            raise self._readable(error) from None

    def _readable(self, error: BadModel) -> BadModel:
        return BadModel(error.where, _readable(error.rule, self.places), error.remedy, slug=error.slug)


def parse_formula(text: str, where: str = "formula", line: int = 0) -> PlacedFormula:
    """Return the formula that a text writes.

    Args:
        text: an expression of the guard language, whose names are places; at most 4096 characters.
        where: what the text belongs to, for the error message.
        line: the line of the file where it stands; 0 if it is from none.

    Raises:
        BadModel: the text is no expression; the message shows where, by a caret.

    >>> formula = parse_formula("hypot(twist.linear.x, data[1]) < 0.5 * yaw(pose.orientation)")
    >>> [str(place) for place in formula.places]
    ['twist.linear.x', 'data[1]', 'yaw(pose.orientation)']
    >>> x, y, heading = formula.places
    >>> formula.value({x: 0.3, y: 0.4, heading: 2.0}, "here")
    True
    >>> parse_formula("data[0] < && 1", "event of 'p3'")
    Traceback (most recent call last):
    parcours.errors.BadModel: event of 'p3': a value must stand at the caret, but found '&&' in \
"data[0] < ^&& 1" [syntax]
    """
    if len(text) > MAX_LENGTH:
        rule = f"an expression has at most {MAX_LENGTH} characters, but this one has {len(text)}"
        raise BadModel(where, rule, slug="expression-size")
    places: dict[Place, int] = {}

    def named(match: re.Match[str]) -> str:
        whole = match.group()
        if match["text"] or match["number"]:
            return whole
        path = match["lens"] or match["path"]
        if path in RESERVED or (match["open"] and path in FUNCTIONS):
            return whole
        if match["open"]:
            known = ", ".join(sorted([*FUNCTIONS, *LENSES]))
            rule = f"a function must be known, and a lens be given a path, but {path[:60]!r} is not or has none"
            raise BadModel(where, rule, f"Known: {known}", slug="unknown-function")
        return f"_{places.setdefault(parse_place(path, where), len(places))}"

    replaced = _PIECE.sub(named, text)
    found = tuple(places)
    try:
        expression = parse_expression(replaced, where)
    except BadModel as error:
        raise BadModel(error.where, _readable(error.rule, found), error.remedy, slug=error.slug) from None
    return PlacedFormula(text.strip(), expression, found, line)


def _readable(rule: str, places: tuple[Place, ...]) -> str:
    def written(match: re.Match[str]) -> str:
        number = int(match[1][:9])
        return str(places[number]) if number < len(places) else match[0]

    return _MARK.sub(written, rule)
