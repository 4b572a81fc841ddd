"""Formulas as functions of Python, for oracles that look at every sample of every message.

A parsed formula becomes a function that is several times as fast as its evaluation node by node. Wherever that function
is unsure (a value of an unusual type, a number that is not finite, anything raised) the formula is evaluated node by
node after all, so that values and errors are those of `evaluate`.

    all k in 1..n: it.points[k].v <= 1     def _1(known):
                                               for a in _range(1, known['n']):
                                                   if not (_number(known['it']['points'][a]['v']) <= 1): return False
                                               return True

No text of a model is executed: names and texts of a formula are constants of the function, as `repr` writes them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

from parcours.model.expression.evaluation import INTEGER_LIMIT, Code, Value, _kind, _size, compiled
from parcours.model.expression.syntax import Apply, Binary, Each, Expression, FieldAccess, Item, Literal, Name, Unary

_WORDS = {"&&": "and", "||": "or"}
_KILLS = frozenset(("min", "max", "atan2"))  # of an operand that is not finite they may make one that is
_SLOW = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, RecursionError)


def _unsure() -> float:
    raise ValueError


def _number(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    return value


def _truth(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value


def _equal(one: object, other: object) -> bool:
    kinds = {_kind(one), _kind(other)}
    if len(kinds) != 1 or not kinds <= {"bool", "number", "text"}:
        raise TypeError
    return one == other


def _range(first: float, last: float) -> range:
    return range(math.ceil(first), math.floor(last) + 1)


def _list(value: object) -> object:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError
    return value


_GLOBALS = {
    "_unsure": _unsure, "_number": _number, "_truth": _truth, "_equal": _equal, "_range": _range, "_list": _list,
    "size": _size, "floor": math.floor, "hypot": math.hypot, "max": max, "min": min, "abs": abs, "sqrt": math.sqrt,
    "atan2": math.atan2, "cos": math.cos, "sin": math.sin, "_remainder": math.remainder, "_tau": math.tau,
    "type": type, "float": float,
}  # fmt: skip


@lru_cache(maxsize=4096)
def program(expression: Expression, where: str = "expression") -> Code:
    """Return what evaluates an expression again and again, fast; it raises what `evaluate` raises."""
    slow = compiled(expression, where)
    writer = _Writer()
    try:
        body = writer.of(expression)
        text = "\n".join([*writer.functions, f"def _0(known):\n return {body}"])
        made: dict[str, Code] = {}
        exec(compile(text, "<formula>", "exec"), {**_GLOBALS, "__builtins__": {}}, made)  # text of ours, see above
    except (RecursionError, MemoryError, SyntaxError):  # nested too deeply
        return slow
    for function in made.values():
        function.__globals__.update(made)
    fast = made["_0"]

    def evaluated(known: Mapping[str, Value]) -> Value:
        try:
            return fast(known)
        except _SLOW:
            return slow(known)

    return evaluated


class _Writer:
    """Writes a formula as Python: an expression, and a function for each quantifier in it."""

    def __init__(self) -> None:
        self.functions: list[str] = []
        self._bound: dict[str, tuple[str, bool]] = {}
        """A quantifier's name -> the local variable that holds it, and whether it is a whole number."""
        self._n = 0

    def _new(self) -> str:
        self._n += 1
        return f"_{self._n}"

    def of(self, node: Expression) -> str:
        """Return the expression."""
        match node:
            case Literal(value):
                return repr(value) if not isinstance(value, float) or math.isfinite(value) else "_unsure()"
            case Name(id):
                return self._bound[id][0] if id in self._bound else f"known[{id!r}]"
            case FieldAccess(of, name):
                return f"{self.of(of)}[{name!r}]"
            case Item(of, index):
                at = self._new()
                return f"{self.of(of)}[{at} if ({at} := {self.whole(index)}) >= 0 else _unsure()]"
            case Each():
                return self._each(node)
            case Unary("!", operand):
                return f"(not {self.truth(operand)})"
            case Unary(_, operand):
                return f"(-{self.number(operand)})"
            case Binary("&&" | "||" as sign, left, right):
                return f"({self.truth(left)} {_WORDS[sign]} {self.truth(right)})"
            case Binary("==" | "!=" as sign, left, right):
                return f"({'' if sign == '==' else 'not '}_equal({self.of(left)}, {self.of(right)}))"
            case Binary("<" | "<=" | ">" | ">=" as sign, left, right):
                return f"({self.sure(left)} {sign} {self.sure(right)})"
            case Binary("/" | "%" as sign, left, right):
                return f"({self.number(left)} {sign} {self.sure(right)})"
            case Binary(sign, left, right):
                return f"({self.number(left)} {sign} {self.number(right)})"
            case Apply(function, arguments):
                return self._apply(function, arguments)

    def _apply(self, function: str, arguments: Sequence[Expression]) -> str:
        if function == "size":
            return f"size({self.of(arguments[0])})"
        if function == "near" and len(arguments) == 3:
            one, other, tolerance = (self.sure(each) for each in arguments)
            return f"(abs({one} - {other}) <= {tolerance})"
        read = self.sure if function in _KILLS else self.number
        given = ", ".join(read(each) for each in arguments)
        return f"_remainder({given}, _tau)" if function == "wrap" else f"{function}({given})"

    def whole(self, node: Expression) -> str:
        """Return the expression for an index: a list refuses one that is no integer."""
        return self.of(node) if self._is_whole(node) else self.number(node)

    def number(self, node: Expression) -> str:
        """Return the expression for a number."""
        if self._is_number(node):
            return self.of(node)
        value = self._new()
        return f"({value} if type({value} := {self.of(node)}) is float else _number({value}))"

    def sure(self, node: Expression) -> str:
        """Return the expression for a number that fits 64 bits if it was computed."""
        if isinstance(node, Literal) or self._is_whole(node) or not self._is_number(node):
            return self.number(node)
        value = self._new()
        return f"({value} if -{INTEGER_LIMIT} <= ({value} := {self.of(node)}) <= {INTEGER_LIMIT} else _unsure())"

    def truth(self, node: Expression) -> str:
        """Return the expression for a truth."""
        match node:
            case Unary("!") | Binary("&&" | "||" | "==" | "!=" | "<" | "<=" | ">" | ">=") | Apply("near"):
                return self.of(node)
            case Each(kind) if kind != "sum":
                return self.of(node)
            case _:
                return f"_truth({self.of(node)})"

    def _is_whole(self, node: Expression) -> bool:
        match node:
            case Literal(value):
                return type(value) is int
            case Name(id):
                return self._bound.get(id, ("", False))[1]
            case Binary("+" | "-", left, right):
                return self._is_whole(left) and self._is_whole(right)
            case Apply("size"):
                return True
            case _:
                return False

    def _is_number(self, node: Expression) -> bool:
        match node:
            case Literal(value):
                return type(value) in (int, float)
            case Binary("+" | "-" | "*" | "/" | "%") | Unary("-"):
                return True
            case Apply(function):
                return function != "near"
            case Each(kind):
                return kind == "sum"
            case _:
                return self._is_whole(node)

    def _each(self, node: Each) -> str:
        if node.last is None:
            items = f"_list({self.of(node.first)})"
        else:
            items = f"_range({self.sure(node.first)}, {self.sure(node.last)})"
        outer, name, given = self._bound, self._new(), self._new()
        passed = ", ".join(("known", *(one for one, _ in outer.values())))
        self._bound = {**outer, node.name: (name, node.last is not None)}
        # What the name hides is passed on under its own: no two local variables share a name.
        head = f"def {given}({passed}, items):\n for {name} in items:\n  "
        if node.kind == "sum":
            body = f"total = 0\n for {name} in items:\n  total += {self.number(node.body)}\n return total"
            self.functions.append(f"def {given}({passed}, items):\n {body}")
        elif node.kind == "some":
            self.functions.append(f"{head}if {self.truth(node.body)}: return True\n return False")
        else:
            self.functions.append(f"{head}if not {self.truth(node.body)}: return False\n return True")
        self._bound = outer
        return f"{given}({passed}, {items})"
