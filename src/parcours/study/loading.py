"""Loads the object that `path/to/file.py:Name` or `package.module:Name` names, or says what its source lacks."""

from __future__ import annotations

import ast
import contextlib
import hashlib
import importlib
import importlib.util
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from parcours.errors import BadRequest, one_of
from parcours.run.exception_text import frames_of, is_ctrl_c, said

_OURS = re.compile("^<frozen|/parcours/")  # files that nobody looks into for the place of an error
Lack = tuple[str, str, str]  # what source lacks: slug, rule, remedy


def is_target(text: str) -> bool:
    """Return whether the text names something to load: `file.py:Name` or `module:Name`.

    >>> is_target("mine.py:STUDY"), is_target("package.module:STUDY"), is_target("lift"), is_target("a/b")
    (True, True, False, False)
    """
    where, colon, name = text.rpartition(":")
    return bool(colon and where and name) and all(part.isidentifier() for part in name.split("."))


def load(target: str, folder: Path | None = None, source: SourceFile | None = None) -> object:
    """Return the object that `file.py:Name` or `module:Name` names. What loading prints goes to standard error.

    Args:
        target: a relative file counts from `folder`; modules are looked for there, too.
        folder: by default the current one.
        source: what its file held when it was first read; by default it is read now.

    Raises BadRequest: there is no such file, module or name, or loading raised.

    >>> load("math:hypot")(3.0, 4.0)
    5.0
    """
    where, _, name = target.rpartition(":")
    if not is_target(target):
        rule = f"must be file.py:Name or package.module:Name, but is {target!r}"
        raise BadRequest(target, rule, slug="target-form")
    with contextlib.redirect_stdout(sys.stderr):
        found: object = _module(target, where, folder or Path.cwd(), source)
    for part in name.split("."):
        try:
            found = getattr(found, part)
        except AttributeError as error:
            known = [one for one in dir(found) if not one.startswith("_")]
            raise BadRequest(target, f"{name!r} must be defined there, but is not", one_of(part, known),
                             slug="target-missing") from error  # fmt: skip
    return found


def file_of(target: str, folder: Path) -> Path | None:
    """Return the file that a target names, whether it is there or not; None if it names a module."""
    where = target.rpartition(":")[0]
    return folder / where if where.endswith(".py") or "/" in where else None


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A Python file as it was when it was first read, whatever its own code makes of the file later."""

    path: Path  # absolute
    text: bytes = field(repr=False)

    @property
    def digest(self) -> str:
        """The first 16 hexadecimal digits of the SHA-256 of the text."""
        return hashlib.sha256(self.text).hexdigest()[:16]

    def module(self, name: str) -> ModuleType:
        """Return the module of that name, executed and in `sys.modules`. Raises whatever its code raises."""
        spec = importlib.util.spec_from_file_location(name, self.path, loader=_FromText(name, self))
        assert spec is not None and spec.loader is not None  # a loader is given
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except BaseException:
            sys.modules.pop(name, None)
            raise
        return sys.modules.get(name, module)  # a module may put something else in its place


class _FromText(SourceFileLoader):
    """Compiles a text that has been read, and keeps no byte code of it."""

    def __init__(self, name: str, source: SourceFile) -> None:
        super().__init__(name, str(source.path))
        self._text = source.text

    def get_data(self, path: str) -> bytes:
        return self._text

    def path_stats(self, path: str) -> Mapping[str, Any]:
        raise OSError("no byte code is looked for")


def read_source(target: str, path: Path) -> SourceFile:
    """Return the source that a target names. Raises BadRequest if the file is absent, unreadable or not Python's."""
    path = path.absolute()
    if not path.is_file():
        rule = f"its file must exist, but there is no {path}"
        raise BadRequest(target, rule, "check the path", slug="target-missing")
    if path.suffix != ".py":
        raise BadRequest(target, "its file must be Python source with the ending .py, but is not", slug="target-form")
    try:
        return SourceFile(path, path.read_bytes())
    except OSError as error:
        raise BadRequest(target, f"its file must be readable, but: {error.strerror}", slug="target-missing") from error


def _module(target: str, where: str, folder: Path, source: SourceFile | None) -> ModuleType:
    path = file_of(target, folder)
    if path is None:
        if where in sys.modules and where not in NEIGHBOURS.get(str(folder.resolve()), {}):
            return sys.modules[where]
        with _importable(folder):
            return _guarded(target, lambda: importlib.import_module(where))
    read = source or read_source(target, path)
    digest = hashlib.sha256(str(path.resolve()).encode() + b"\0" + read.text).hexdigest()[:16]
    name = f"parcours_loaded_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    with _importable(path.resolve().parent):  # its neighbours are importable, as they are for `python file.py`
        return _guarded(target, lambda: read.module(name))


# Folder -> the modules in it that files there have imported: two studies may have a `helpers` each
NEIGHBOURS: dict[str, dict[str, ModuleType]] = {}


@contextlib.contextmanager
def _importable(folder: Path):  # type: ignore[no-untyped-def]
    """Make the modules in a folder importable for a while, and set them aside afterwards."""
    entry = str(folder.resolve())
    ours = NEIGHBOURS.setdefault(entry, {})
    sys.path.insert(0, entry)
    sys.modules.update(ours)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(entry)
        for name, module in list(sys.modules.items()):
            file = getattr(module, "__file__", None) or ""
            if Path(file).parent == Path(entry) and not name.startswith("parcours_loaded_") and name != "__main__":
                ours[name] = sys.modules.pop(name)


def _guarded(target: str, act) -> ModuleType:  # type: ignore[no-untyped-def]
    """Load what the user wrote; what it raises becomes one line with its place."""
    try:
        module: ModuleType = act()
        return module
    except BaseException as error:
        if is_ctrl_c(error):
            raise
        rule = f"loading it must not raise, but raised {said(error)}{_place(error)}"
        raise BadRequest(target, rule, "run it alone to see where", slug="target-raised") from error


def _place(error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename:
        return f" ({Path(error.filename).name}:{error.lineno})"
    theirs = [(code.co_filename, line) for code, line in frames_of(error) if not _OURS.search(code.co_filename)]
    return f" ({Path(theirs[-1][0]).name}:{theirs[-1][1]})" if theirs else ""


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


def members_of(target: str, folder: Path) -> frozenset[str]:
    """Return the names that the body of a class binds, by parsing its file only; none if it is not found there."""
    path, name = file_of(target, folder), target.rpartition(":")[2]
    try:
        tree = ast.parse(path.read_bytes()) if path is not None else ast.Module([], [])
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return frozenset()
    node = dict(_names(tree)).get(name)
    return frozenset(name for name, _ in _names(node)) if isinstance(node, ast.ClassDef) else frozenset()


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
