"""Expressions and times of our language to UPPAAL's C and its whole units of time, or why it cannot say them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Set
from dataclasses import dataclass, field

from parcours.model.expression import Apply, Assignment, Binary, Expression, Field, Literal, Name, Unary, names
from parcours.model.expression.syntax import walk
from parcours.model.structure import CLOCK, Cefsm
from parcours_formats.guard_languages.kinds import is_natural

WORDS = frozenset(
    re.findall(
        r"\w+",
        """after_update and assign before_update bool branchpoint broadcast break case chan clock commit const continue
        default do double dynamic else enum exists exit false for forall gantt guard hybrid if imply import init int
        invariant meta not numOf or postcondition priority process progress query rate return scalar select
        simulation spawn state string struct sum switch sync system trans true type typedef urgent void while xor abs
        fabs fmod fint floor ceil sqrt pow exp log sin cos tan deadlock location""",
    )
)
"""Names that mean something in UPPAAL and cannot be given."""

LARGEST_SCALE = 9
"""Most decimals of a second that the unit of time may have: nanoseconds."""

_LEVELS = {"||": 1, "&&": 2, "==": 3, "!=": 3, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 6, "-": 6, "*": 7, "/": 7, "%": 7}
_COMPARING = ("==", "!=", "<", "<=", ">", ">=")


class UnsayableError(Exception):
    """What UPPAAL cannot say, in words."""


@dataclass(frozen=True, slots=True)
class Rendering:
    """How the names and constants of one machine are written.

    Args:
        names: what is written for a variable, or for the field of a message (`it.x`).
        numbers: what is written for a text: the constants of enumerations.
        naturals: variables that are never negative.
        clocks: variables that are clocks.
        scale: units of time a second.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    naturals: Set[str] = frozenset()
    clocks: Set[str] = frozenset()
    scale: int = 1

    def text(self, node: Expression) -> str:
        """Return an expression in UPPAAL's C.

        Raises:
            UnsayableError: it has no counterpart there.

        Example:
        >>> from parcours.model.expression import parse_expression
        >>> rendering = Rendering(naturals={"n"}, clocks={"t"}, scale=1000)
        >>> rendering.text(parse_expression("t >= 0.25 && max(n, 2) % 3 == floor(n / 2)"))
        't >= 250 && (n >? 2) % 3 == n / 2'
        """
        return self._of(node, 0, 1)

    def constant(self, value: float) -> str:
        """Return a number of units of time. Raises UnsayableError if it is not whole."""
        units = value * self.scale
        if abs(units - round(units)) > 1e-6 * max(1.0, abs(units)):
            raise UnsayableError(f"{value} s is no whole number of its units of time")
        return str(round(units))

    def _of(self, node: Expression, level: int, scale: int) -> str:
        own = 9
        match node:
            case Literal(bool() as value):
                text = "true" if value else "false"
            case Literal(str() as value):
                if value not in self.numbers:
                    raise UnsayableError("it has no texts")
                text = self.numbers[value]
            case Literal(int() | float() as value):
                text = self.constant(value) if scale > 1 else self._number(value)
            case Name() | Field():
                text = self._named(node)
            case Unary(operator, operand):
                text, own = operator + self._of(operand, 8, scale), 8
            case Binary(operator, left, right):
                text, own = self._binary(operator, left, right, scale)
            case Apply(function, arguments):
                text, own = self._applied(function, arguments)
        return f"({text})" if own < level else text

    def _number(self, value: int | float) -> str:
        if isinstance(value, float) and not value.is_integer():
            raise UnsayableError(f"it computes with whole numbers, not {value!r}")
        return str(int(value))

    def _named(self, node: Expression) -> str:
        if isinstance(node, Name) and node.id not in self.names:
            return node.id
        if str(node) not in self.names:
            raise UnsayableError(f"it cannot read {node}")
        return self.names[str(node)]

    def _binary(self, operator: str, left: Expression, right: Expression, scale: int) -> tuple[str, int]:
        own = _LEVELS[operator]
        if operator in _COMPARING:
            if (names(left) | names(right)) & self.clocks:
                scale = self.scale
            first, second = self._of(left, own + 1, scale), self._of(right, own + 1, scale)
            return f"{first} {operator} {second}", own
        if operator == "/":
            raise UnsayableError("it divides whole numbers only")
        if scale > 1 and operator in "*%":
            raise UnsayableError("it only adds to clocks")
        text = f"{self._of(left, own, scale)} {operator} {self._of(right, own + 1, scale)}"
        if operator == "%" and not is_natural(left, self.naturals):
            if not (isinstance(right, Literal) and is_natural(right, self.naturals)):
                raise UnsayableError("the sign of its remainder is that of the dividend")
            divisor = self._of(right, own + 1, scale)
            return f"({text} + {divisor}) % {divisor}", own
        return text, own

    def _applied(self, function: str, arguments: tuple[Expression, ...]) -> tuple[str, int]:
        match function, arguments:
            case "floor", (Binary("/", left, right),) if all(is_natural(each, self.naturals) for each in (left, right)):
                return f"{self._of(left, 7, 1)} / {self._of(right, 8, 1)}", 7
            case (("min" | "max"), _):
                sign = " <? " if function == "min" else " >? "
                return sign.join(self._of(each, 6, 1) for each in arguments), 5
            case "abs", (argument,):
                return f"abs({self._of(argument, 0, 1)})", 9
            case _:
                raise UnsayableError(f"it has no function {function!r}")


def scale_of(cefsm: Cefsm) -> int:
    """Return the units of time a second in which every time of a model is whole, as far as nanoseconds go."""
    times: list[float] = []
    for component in cefsm.components:
        clocks = {variable.name for variable in component.variables if variable.type == CLOCK}
        for machine in component.machines:
            conditions = [condition for _, condition in machine.invariants]
            for transition in machine.transitions:
                times += [time for time in transition.duration or () if math.isfinite(time)]
                conditions += [transition.guard] if transition.guard is not None else []
                for action in transition.actions:
                    if isinstance(action, Assignment) and action.target in clocks:
                        times += _numbers(action.value)
            for condition in conditions:
                if names(condition) & clocks:
                    times += _numbers(condition)
    scale = 1
    while scale < 10**LARGEST_SCALE and any(abs(time * scale - round(time * scale)) > 1e-6 for time in times):
        scale *= 10
    return scale


def _numbers(node: Expression) -> list[float]:
    return [
        float(each.value)
        for each in walk(node)
        if isinstance(each, Literal) and isinstance(each.value, int | float) and not isinstance(each.value, bool)
    ]
