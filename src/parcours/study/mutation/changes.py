"""A Python function into the small changes that mutants make to it: what is put in the place of which node.

Only changes that keep the types of a compiled kernel are made within one: there all mutants are in one build, and a
whole number that becomes a float for one of them would become one for all.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["instead", "skip", "twice"]

_RELATIONS: Mapping[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt), ast.LtE: (ast.Lt, ast.GtE), ast.Gt: (ast.GtE, ast.Lt), ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}  # fmt: skip
_ARITHMETIC: Mapping[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
# Functions whose place another one can take
_PAIRS = {"min": "max", "sin": "cos", "asin": "acos", "arcsin": "arccos", "sinh": "cosh", "floor": "ceil", "any": "all",
          "exp": "log", "argmin": "argmax", "minimum": "maximum", "degrees": "radians"}  # fmt: skip
_PAIRS |= {other: one for one, other in _PAIRS.items()}
_REVERSED = ("sin_cos", "sincos")  # return a pair whose halves can be taken for each other
_ANGLED = ("sin", "cos", "tan", *_REVERSED)  # take an angle
_SYMMETRIC = ("min", "max", "isinstance", "getattr", "setattr", "hasattr", "range", "print", "zip", "hypot", "replace")
_AXES = {"x": "y", "y": "x"}
_DEGREE = 0.017453292519943295
_PERIOD = re.compile(r"period|interval|cycle|timeout", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Change:
    """One change to a node: another expression instead of it, or a statement that is skipped, or done twice."""

    operator: str
    node: ast.expr | ast.stmt
    kind: Kind
    instead: ast.expr | None = None  # of an expression


@dataclass(frozen=True, slots=True)
class KnownNames:
    """What is known of names beyond the function itself."""

    transitions: Mapping[str, str]  # transition of the model -> another of the same component
    channels: Collection[str]
    constants: Mapping[str, float]  # numbers of modules, by name
    signatures: Mapping[str, tuple[str, ...]]  # function -> annotations of its parameters
    globals: Collection[str]  # what the module defines or imports


def changes_of(function: ast.FunctionDef, names: KnownNames, compiled: bool) -> Iterator[Change]:
    """Yield the changes to a function, statement by statement; not those to functions within it.

    Args:
        compiled: whether it is a kernel.
    """
    bound = {one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)}
    yield from _Finder(names, compiled).block(function.body, bound)


class _Finder:
    def __init__(self, names: KnownNames, compiled: bool) -> None:
        self._names, self._compiled = names, compiled

    def block(self, body: list[ast.stmt], bound: set[str]) -> Iterator[Change]:
        """Yield the changes to statements; `bound` are the names that have a value before them, and grows."""
        for statement in body:
            yield from self._statement(statement, bound)
            bound |= {one.id for one in ast.walk(statement) if isinstance(one, ast.Name) and _is_stored(one)}

    def _statement(self, one: ast.stmt, bound: set[str]) -> Iterator[Change]:
        match one:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef() | ast.Raise() | ast.Assert():
                return
            case ast.Import() | ast.ImportFrom() | ast.Global() | ast.Nonlocal():
                return
            case ast.Expr(value=ast.Constant()):
                return
            case ast.Expr(value=ast.Yield()):
                yield Change("step", one, "skip")
                yield Change("step", one, "twice")
            case ast.Expr():
                yield Change("statement", one, "skip")
                if any(self._is_message(part) for part in ast.walk(one)):
                    yield Change("message", one, "twice")
            case ast.Assign() | ast.AugAssign() if _targets(one) <= bound:
                yield Change("stale", one, "skip")
            case ast.Break() | ast.Continue():
                yield Change("statement", one, "skip")
        for field, value in ast.iter_fields(one):
            if field in ("body", "orelse", "finalbody") and isinstance(value, list):
                yield from self.block(value, bound if field == "finalbody" else set(bound))
            elif field == "test":
                if not _has_opposite(value):
                    yield self._instead("condition", value, ast.UnaryOp(ast.Not(), _copy(value)))
                yield from self._expression(value)
            elif field == "handlers":
                for handler in value:
                    yield from self.block(handler.body, set(bound))
            elif field == "items":
                for item in value:
                    yield from self._expression(item.context_expr)
            elif field in ("value", "iter", "subject", "exc") and isinstance(value, ast.expr):
                yield from self._expression(value)
            elif field == "cases":
                for case in value:
                    yield from self.block(case.body, set(bound))
        for target in getattr(one, "targets", []):
            yield from self._expression(target)

    def _expression(self, root: ast.expr) -> Iterator[Change]:
        """Yield the changes to an expression and its parts, outer ones first."""
        if isinstance(root, ast.JoinedStr | ast.Lambda):
            return
        pauses = any(isinstance(part, ast.Yield | ast.YieldFrom | ast.Await | ast.NamedExpr) for part in ast.walk(root))
        if not pauses and not isinstance(getattr(root, "ctx", ast.Load()), ast.Store | ast.Del):
            yield from self._changes(root)
        if isinstance(root, ast.BinOp) and isinstance(root.op, ast.Pow):
            yield from self._expression(root.left)  # another exponent would be other machine code for all mutants
            return
        for child in ast.iter_child_nodes(root):
            if isinstance(root, ast.Call) and child is root.func:  # a function is no value of its own
                if isinstance(child, ast.Attribute):
                    yield from self._expression(child.value)
            elif isinstance(child, ast.expr):
                yield from self._expression(child)
            elif isinstance(child, ast.keyword | ast.comprehension):
                for part in ast.iter_child_nodes(child):
                    if isinstance(part, ast.expr):
                        yield from self._expression(part)

    def _instead(self, operator: str, node: ast.expr, instead: ast.expr) -> Change:
        return Change(operator, node, "instead", instead)

    def _changes(self, node: ast.expr) -> Iterator[Change]:
        match node:
            case ast.Compare():
                for k, relation in enumerate(node.ops):
                    for other in _RELATIONS.get(type(relation), ()):
                        ops: list[ast.cmpop] = [*node.ops[:k], other(), *node.ops[k + 1 :]]
                        parts = [_copy(one) for one in node.comparators]
                        yield self._instead("relation", node, ast.Compare(_copy(node.left), ops, parts))
            case ast.BoolOp():
                other_op: ast.boolop = ast.Or() if isinstance(node.op, ast.And) else ast.And()
                yield self._instead("logic", node, ast.BoolOp(other_op, [_copy(one) for one in node.values]))
            case ast.IfExp() if not _has_opposite(node.test):
                test = ast.UnaryOp(ast.Not(), _copy(node.test))
                yield self._instead("condition", node, ast.IfExp(test, _copy(node.body), _copy(node.orelse)))
            case ast.BinOp() if type(node.op) in _ARITHMETIC and not (_is_text(node.left) or _is_text(node.right)):
                other_sign = _ARITHMETIC[type(node.op)]()
                yield self._instead("arithmetic", node, ast.BinOp(_copy(node.left), other_sign, _copy(node.right)))
            case ast.UnaryOp(op=ast.USub()):
                yield self._instead("sign", node, _copy(node.operand))
            case ast.UnaryOp(op=ast.Not()):
                yield self._instead(
                    "condition", node, ast.Call(ast.Name("bool", ast.Load()), [_copy(node.operand)], [])
                )
            case ast.Constant(value=bool()):
                yield self._instead("constant", node, ast.Constant(not node.value))
            case ast.Constant(value=int(n)):
                yield self._instead("off by one", node, ast.Constant(n + 1))
                yield self._instead("off by one", node, ast.Constant(n - 1))
            case ast.Constant(value=float(value)):
                yield from self._number(node, value, "")
            case ast.Constant(value=str(text)) if text in self._names.transitions:
                yield self._instead("transition", node, ast.Constant(self._names.transitions[text]))
            case ast.Name(id=name) if name in self._names.constants:
                yield from self._number(node, self._names.constants[name], name)
            case ast.Attribute(attr=name):
                if name in _AXES:
                    yield self._instead("axis", node, ast.Attribute(_copy(node.value), _AXES[name], ast.Load()))
                if _PERIOD.search(name):
                    yield self._instead("period", node, _times(node, 2))
            case ast.Tuple() | ast.List():
                yield from self._display(node)
            case ast.Call():
                yield from self._call(node)

    def _number(self, node: ast.expr, value: float, name: str) -> Iterator[Change]:
        """Yield other numbers of the same type: none or one, a thousand of its unit, another period."""
        if isinstance(value, int):
            other = ast.BinOp(_copy(node), ast.Add(), ast.Constant(1)) if abs(value) < 100 else _times(node, 2)
            yield self._instead("off by one" if abs(value) < 100 else "period", node, other)
            return
        if name and _PERIOD.search(name):
            yield self._instead("period", node, _times(node, 2.0))
        yield self._instead("constant", node, ast.Constant(0.0 if value else 1.0))
        if value:
            yield self._instead("unit", node, ast.Constant(1000.0 * value) if not name else _times(node, 1000.0))

    def _display(self, node: ast.Tuple | ast.List) -> Iterator[Change]:
        for k, one in enumerate(node.elts):
            if self._is_message(one):
                for times in (0, 2):
                    elements = [*node.elts[:k], *[one] * times, *node.elts[k + 1 :]]
                    yield self._instead("message", node, type(node)([_copy(part) for part in elements], ast.Load()))
        if not isinstance(node, ast.Tuple) or len(node.elts) != 2 or self._compiled or self._is_message(node):
            return
        one, other = node.elts
        fixed = any(isinstance(part, ast.Starred | ast.Constant) or self._is_message(part) for part in node.elts)
        if not fixed and ast.dump(one) != ast.dump(other):
            yield self._instead("swap", node, ast.Tuple([_copy(other), _copy(one)], ast.Load()))

    def _call(self, node: ast.Call) -> Iterator[Change]:
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        arguments = [_copy(one) for one in node.args]
        plain = not any(isinstance(one, ast.Starred) for one in node.args)
        if (other := _PAIRS.get(name)) and plain and len(node.args) <= 2:
            if isinstance(node.func, ast.Attribute):
                function: ast.expr = ast.Attribute(_copy(node.func.value), other, ast.Load())
            else:
                function = ast.Name(other, ast.Load())
            if (
                isinstance(node.func, ast.Attribute)
                or other in self._names.globals
                or other in ("min", "max", "any", "all")
            ):
                yield self._instead("function", node, ast.Call(function, arguments, []))
        if name in ("min", "max") and plain and len(node.args) == 2:
            for one in node.args:
                yield self._instead("limit", node, _copy(one))
        if name == "abs" and plain:
            yield self._instead("sign", node, _copy(node.args[0]))
        if name in _REVERSED:
            halves = [ast.Subscript(_copy(node), ast.Constant(k), ast.Load()) for k in (1, 0)]
            yield self._instead("function", node, ast.Tuple(list(halves), ast.Load()))
        if name in _ANGLED and plain and node.args:
            angle = ast.BinOp(_copy(node.args[0]), ast.Mult(), ast.Constant(_DEGREE))
            yield self._instead("unit", node, ast.Call(_copy(node.func), [angle, *arguments[1:]], []))
        for k in range(len(node.args) - 1):
            if plain and self._can_swap(name, node.args, k):
                swapped = [*arguments[:k], arguments[k + 1], arguments[k], *arguments[k + 2 :]]
                keywords = [ast.keyword(one.arg, _copy(one.value)) for one in node.keywords]
                yield self._instead("swap", node, ast.Call(_copy(node.func), swapped, keywords))
        for k, keyword in enumerate(node.keywords):
            if name == "took" and keyword.arg in self._names.channels:
                others = [ast.keyword(one.arg, _copy(one.value)) for j, one in enumerate(node.keywords) if j != k]
                yield self._instead("message", node, ast.Call(_copy(node.func), arguments, others))
                again = ast.Tuple([ast.Constant(keyword.arg), _copy(keyword.value)], ast.Load())
                all = [ast.keyword(one.arg, _copy(one.value)) for one in node.keywords]
                yield self._instead("message", node, ast.Call(_copy(node.func), [*arguments, again], all))

    def _can_swap(self, name: str, arguments: list[ast.expr], k: int) -> bool:
        if name in _SYMMETRIC or ast.dump(arguments[k]) == ast.dump(arguments[k + 1]):
            return False
        types = self._names.signatures.get(name, ())
        if k + 1 < len(types) and types[k] and types[k + 1]:
            return types[k] == types[k + 1] and (types[k] in ("int", "float", "bool") or not self._compiled)
        return not self._compiled and not any(isinstance(one, ast.Constant) for one in arguments[k : k + 2])

    def _is_message(self, node: ast.AST) -> bool:
        """Whether a node is a message with its channel, as (channel, payload)."""
        if not (isinstance(node, ast.Tuple) and len(node.elts) == 2 and isinstance(node.elts[0], ast.Constant)):
            return False
        return node.elts[0].value in self._names.channels


def _copy(node: ast.expr) -> ast.expr:
    return copy.deepcopy(node)


def _times(node: ast.expr, factor: float) -> ast.expr:
    return ast.BinOp(_copy(node), ast.Mult(), ast.Constant(factor))


def _is_text(node: ast.expr) -> bool:
    """Whether a node is text or a display, with which arithmetic would only raise."""
    if isinstance(node, ast.BinOp):
        return _is_text(node.left) or _is_text(node.right)
    return isinstance(node, ast.JoinedStr | ast.Tuple | ast.List | ast.Dict | ast.Set) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _has_opposite(test: ast.expr) -> bool:
    """Whether another change to a condition turns it into its opposite already."""
    if isinstance(test, ast.Compare):
        return len(test.ops) == 1 and len(_RELATIONS.get(type(test.ops[0]), ())) == 1
    return isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)


def _is_stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _targets(one: ast.Assign | ast.AugAssign) -> set[str]:
    """Return the local names that an assignment gives a value."""
    targets = one.targets if isinstance(one, ast.Assign) else [one.target]
    return {
        part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name) and _is_stored(part)
    }
