"""A module of kernels, rewritten for NVIDIA Warp: the same operations in the same order, on a CPU or a GPU.

Warp compiles a subset of Python, too, but takes literals for floats of 32 bits, converts nothing by itself, and knows
neither a choice between tuples nor elements of arrays as targets of tuples. Those are rewritten, expression by
expression; no operation is added or moved. What kernels must not use (memory from the heap, recursion, exceptions)
fails when Warp compiles it.
"""

from __future__ import annotations

import ast
import importlib.util
import inspect
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

_TYPES = {"float": "wp.float64", "int": "wp.int32", "bool": "wp.bool", "Floats": "wp.array2d(dtype=wp.float64)"}
_CALLS = {"float": "wp.float64", "int": "wp.int32", "abs": "wp.abs", "min": "wp.min", "max": "wp.max"}


class _Rewriter(ast.NodeTransformer):
    """Rewrites expressions; `statements` rewrites what holds them."""

    def function(self, node: ast.FunctionDef) -> str:
        """Return the source of a kernel as a function of Warp's."""
        for argument in node.args.args:
            assert argument.annotation is not None
            argument.annotation = _expression(_TYPES[ast.unparse(argument.annotation)])
        body = node.body[1:] if ast.get_docstring(node) else node.body
        lines = [ast.unparse(ast.fix_missing_locations(each)) for part in body for each in self.statements(part)]
        head = f"@wp.func\ndef {node.name}({ast.unparse(node.args)}):\n"
        return head + textwrap.indent("\n".join(lines), "    ")

    def statements(self, node: ast.stmt) -> list[ast.stmt]:
        """Return the statements that stand for one: a choice of values becomes one between statements."""
        if isinstance(node, ast.Assign | ast.Return) and isinstance(node.value, ast.IfExp):
            first, second = (self.statements(_with_value(node, each)) for each in (node.value.body, node.value.orelse))
            return [ast.If(self.visit(node.value.test), first, second)]
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple) and "[" in ast.unparse(node.targets[0]):
            names = [f"part_{node.lineno}_{k}" for k in range(len(node.value.elts))]
            parts = ast.parse("".join(f"{name} = 0\n" for name in names)).body
            assert isinstance(node.targets[0], ast.Tuple)
            takes = [_with_value(part, value) for part, value in zip(parts, node.value.elts, strict=True)]
            gives = [ast.Assign([to], ast.Name(name)) for to, name in zip(node.targets[0].elts, names, strict=True)]
            return [each for part in [*takes, *gives] for each in self.statements(part)]
        counts = isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for name, value in ast.iter_fields(node):
            if isinstance(value, ast.expr):
                setattr(node, name, self.visit(value))
            elif name in ("body", "orelse"):
                setattr(node, name, [each for part in value for each in self.statements(part)])
        if counts and isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
            node.value = _expression(f"wp.int32({node.value.value!r})")  # a loop may not change a literal
        return [node]

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return _expression(f"wp.float64({node.value!r})") if isinstance(node.value, float) else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if ast.unparse(node.value) != "np":
            return node
        return _expression("wp.float64(wp.inf)" if node.attr == "inf" else f"wp.{node.attr}")

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.func, ast.Name):
            node.func = _expression(_CALLS.get(node.func.id, node.func.id))
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        ends = [node.left, *node.comparators]
        links: list[ast.expr] = [
            ast.Compare(low, [op], [high]) for low, op, high in zip(ends, node.ops, ends[1:], strict=False)
        ]
        return links[0] if len(links) == 1 else ast.BoolOp(ast.And(), links)


def _expression(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _with_value(node: Any, value: ast.expr) -> ast.stmt:
    """Return an assignment or a return with another value."""
    made = ast.Return(value) if isinstance(node, ast.Return) else ast.Assign(node.targets, value)
    return ast.copy_location(made, node)


def rewritten(module: ModuleType) -> str:
    """Return the source of a module's constants and kernels for Warp."""
    parts = []
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.FunctionDef):
            parts.append(_Rewriter().function(node))
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
            parts.append(f"{ast.unparse(node.targets[0])} = wp.constant(wp.float64({node.value.value!r}))")
    return "\n\n".join(parts) + "\n"


def ported(modules: list[ModuleType], launched: str, file: Path, *, fused: bool = False) -> ModuleType:
    """Return modules as one of Warp's, with the source of the kernels that are to be launched at its end.

    `fused`: whether a product and a sum may be rounded once, as no kernel of ours is.
    """
    flags = {"cpu_compiler_flags": "-march=native -ffp-contract=fast"} if fused else {}
    options = f"wp.set_module_options({ {'fuse_fp': fused, 'enable_backward': False, **flags} })\n"
    file.write_text("import warp as wp\n\n" + options + "".join(map(rewritten, modules)) + launched)
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made
