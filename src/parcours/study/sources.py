"""Says which names and methods Python source lacks, without running it."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path

from parcours.errors import one_of

Lack = tuple[str, str, str]  # what is lacking: slug, rule, remedy


def absent_in(path: Path, name: str, methods: Sequence[str] = ()) -> Iterator[Lack]:
    """Yield what a file lacks: the name, or methods of the class of that name.

    A file that makes names by other means than definitions, assignments and imports is believed; so is a class with
    bases from elsewhere, with `__getattr__`, `run` or `handle`.
    """
    try:
        tree = ast.parse(path.read_bytes(), str(path))
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = f"{path.name}:{error.lineno}: " if isinstance(error, SyntaxError) else ""
        said = error.msg if isinstance(error, SyntaxError) else str(error)
        yield "study-source", f"{path.name} must be Python, but: {line}{said}", "run it alone to see where"
        return
    known = dict(_names(tree))
    if "*" in known or "__getattr__" in known:
        return
    first = name.partition(".")[0]
    if first not in known:
        shown = [one for one in known if not one.startswith("_")]
        yield "target-missing", f"{name!r} must be defined in {path.name}, but is not", one_of(first, shown)
        return
    node = known[first]
    if isinstance(node, ast.ClassDef) and "." not in name:
        yield from _lacking(node, known, methods, path)


def _lacking(node: ast.ClassDef, known: dict[str, ast.AST], methods: Sequence[str], path: Path) -> Iterator[Lack]:
    members: set[str] = set()
    waiting = [node]
    while waiting:
        one = waiting.pop()
        members |= {name for name, _ in _names(one)}
        for base in one.bases:
            parent = known.get(base.id) if isinstance(base, ast.Name) else None
            if isinstance(parent, ast.ClassDef) and parent is not one:
                waiting.append(parent)
            elif not (isinstance(base, ast.Name) and base.id == "object"):
                return
    if node.decorator_list or members & {"__getattr__", "handle", "run"}:
        return
    lacking = [name for name in methods if name not in members]
    if lacking:
        methods_ = f"the method{'s' * (len(lacking) > 1)} {', '.join(lacking)}"
        rule = f"class {node.name} ({path.name}:{node.lineno}) lacks {methods_}"
        yield "component-method", rule, f"write: def {lacking[0]}(self, message): ..."


def _names(tree: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the names that a module or class body binds, also within `if` and `try`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node
        elif isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                yield (alias.asname or alias.name).partition(".")[0], node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                for part in ast.walk(target):
                    if isinstance(part, ast.Name):
                        yield part.id, node
        elif isinstance(node, ast.If | ast.Try | ast.With | ast.ExceptHandler):
            yield from _names(node)
