"""The mutants of Python modules, and the source that holds all of them and chooses one when it runs.

    if a < b:        ->        if (a <= b if _mutant == 17 else a < b):
    n += 1           ->        if _mutant != 18: n += 1

`_mutant` is read from memory when a function begins, in compiled code also (`parcours.kernels.chosen`), so one build
serves all mutants. Each round of a `while` loop is counted, so that those that never end are ended by the work they do.
"""

from __future__ import annotations

import ast
import copy
import importlib.util
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadRequest
from parcours.kernels import PLACES
from parcours.study.loading import file_of
from parcours.study.mutation.changes import Change, KnownNames, changes_of
from parcours.study.mutation.mutant import Mutant, diff_of

if TYPE_CHECKING:
    from parcours.study.protocol import Study

_CHOSEN, _SPEND, _NUMBER = "_parcours_chosen", "_parcours_spend", "_mutant"


@dataclass(frozen=True, slots=True)
class Module:
    """The source of a module whose mutants are made."""

    name: str  # as in the ids of mutants
    path: Path
    text: str


def modules_of(study: Study) -> list[Module]:
    """Return the modules that are mutated: those the study names (`mutants`), else those of its components.

    Raises BadRequest: there are none in Python, or one cannot be found or read.
    """
    folder = Path(study.where).parent if study.where.endswith((".yaml", ".yml")) else Path.cwd()
    targets = list(getattr(study, "mutants", ())) or list(_targets(study))
    paths: dict[Path, str] = {}
    for target in targets:
        for path, name in _files(target, folder, study.name):
            paths.setdefault(path.resolve(), name)
    if not paths:
        rule = f"the components of {study.name} must be in Python for their mutants, but none is"
        raise BadRequest(study.where or study.name, rule, "name modules: mutants: [FILE.py]", slug="mutants-none")
    try:
        return [Module(name, path, path.read_text(encoding="utf-8")) for path, name in paths.items()]
    except (OSError, UnicodeDecodeError) as error:
        raise BadRequest(study.name, f"what is mutated must be readable, but: {error}", slug="mutants-none") from error


def _targets(study: Study) -> Iterator[str]:
    """Yield the files and modules that a study's components, or its simulation, come from."""
    from parcours.study.components.systems import FunctionsPart, PythonPart

    simulate = getattr(study, "simulate", None)
    found: list[object] = [simulate]
    for part in getattr(getattr(study, "system", None), "parts", {}).values():
        found += [part.target] if isinstance(part, PythonPart) else []
        found += list(part.targets.values()) if isinstance(part, FunctionsPart) else []
    for target in found:
        if isinstance(target, str):
            yield target.rpartition(":")[0]
        elif callable(target) and (code := getattr(target, "__code__", None)) is not None:
            yield str(code.co_filename)
        elif isinstance(target, type):
            yield target.__module__


def _files(target: str, folder: Path, study: str) -> Iterator[tuple[Path, str]]:
    """Yield the files of a module, of all modules of a package, or the file itself, with their names."""
    path = file_of(f"{target}:x", folder)
    if path is None:
        spec = importlib.util.find_spec(target)
        if spec is None or not spec.origin:
            rule = f"a module that is mutated must be there, but there is no {target!r}"
            raise BadRequest(f"study {study!r}", rule, slug="mutants-none")
        path = Path(spec.origin)
        if path.name == "__init__.py":
            for one in sorted(path.parent.rglob("*.py")):
                if one.name != "__init__.py":
                    inner = ".".join(one.relative_to(path.parent).with_suffix("").parts)
                    yield one, f"{target}.{inner}"
            return
        yield path, target
        return
    yield path, path.stem


def place_of(id: str) -> str:
    """Return the module and function of a mutant's id."""
    return ":".join(id.split(":")[:2])


class Sources:
    """The mutants of some modules.

    Args:
        modules: parsed, not run.
        transitions: of the model, by component: where a step names one, another of the same component is put.
        channels: of the model: what is sent there can be left out, or sent twice.

    Raises BadRequest: a module is no Python.
    """

    def __init__(
        self, modules: Sequence[Module], transitions: Collection[Sequence[str]], channels: Collection[str]
    ) -> None:
        self.modules = modules
        self.model_names = tuple(map(tuple, transitions)), tuple(channels)
        self._trees = {one.path: _parsed(one) for one in modules}
        self._others = {id: ids[(k + 1) % len(ids)] for ids in transitions if len(ids) > 1 for k, id in enumerate(ids)}
        self._channels = channels
        self._signatures = dict(_signatures(self._trees.values()))
        places = dict.fromkeys(f"{one.name}:{name}" for one in modules for name, _ in _functions(self._trees[one.path]))
        self.places = {name: min(k, PLACES - 1) for k, name in enumerate(places)}  # function -> its number
        self._constants = {one.path: dict(_constants(self._trees[one.path])) for one in modules}

    def mutants(self) -> list[Mutant]:
        """Return all mutants, module by module."""
        return [
            Mutant(id, change.operator, str(module.path), change.node.lineno, *_shown(module, change))
            for module in self.modules
            for id, _, change in self._changes(module, self._trees[module.path])
        ]

    def build(self, path: Path, numbers: Mapping[str, int]) -> ast.Module | None:
        """Return the tree of a module that holds the mutants of these numbers, by id; None if the file is no module."""
        module = next((one for one in self.modules if one.path == path), None)
        if module is None:
            return None
        tree = copy.deepcopy(self._trees[path])
        changes: dict[ast.AST, list[tuple[int, Change]]] = {}
        functions: dict[ast.AST, int] = {}
        for id, function, change in self._changes(module, tree):
            if id in numbers:
                functions[function] = self.places[place_of(id)]
                changes.setdefault(change.node, []).append((numbers[id], change))
        _Builder(changes, functions).visit(tree)
        first = next((k for k, one in enumerate(tree.body) if not _is_head(one)), len(tree.body))
        names = [ast.alias("chosen", _CHOSEN), ast.alias("spend", _SPEND)]
        tree.body.insert(first, ast.ImportFrom("parcours.kernels", names, 0))
        return ast.fix_missing_locations(tree)

    def _changes(self, module: Module, tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef, Change]]:
        imported = {
            alias.asname or alias.name: constants[alias.name]
            for one in ast.walk(tree) if isinstance(one, ast.ImportFrom)
            for constants in self._constants.values()
            for alias in one.names if alias.name in constants and _is_of(one, self._constants, constants)
        }  # fmt: skip
        known = {**imported, **self._constants[module.path]}
        top = {alias.asname or alias.name for one in tree.body if isinstance(one, ast.Import | ast.ImportFrom)
               for alias in one.names}  # fmt: skip
        top |= {one.name for one in tree.body if isinstance(one, ast.FunctionDef | ast.ClassDef)}
        names = KnownNames(self._others, self._channels, known, self._signatures, top)
        counts: Counter[tuple[str, str]] = Counter()
        for place, function in _functions(tree):
            for change in changes_of(function, names, _is_kernel(function)):
                counts[place, change.operator] += 1
                word = change.operator.replace(" ", "-")
                yield f"{module.name}:{place}:{counts[place, change.operator]}:{word}", function, change


class _Builder(ast.NodeTransformer):
    """Puts all changes into a tree, each behind its number."""

    def __init__(self, changes: Mapping[ast.AST, list[tuple[int, Change]]], functions: Mapping[ast.AST, int]) -> None:
        self._changes, self._functions = changes, functions

    def visit(self, node: ast.AST) -> ast.AST | list[ast.stmt]:
        changes = self._changes.get(node, [])
        original = copy.deepcopy(node) if any(change.kind == "twice" for _, change in changes) else node
        self.generic_visit(node)
        if isinstance(node, ast.FunctionDef) and node in self._functions:
            head = 1 if ast.get_docstring(node, clean=False) is not None else 0
            place = ast.Constant(self._functions[node])
            read = ast.Assign([ast.Name(_NUMBER, ast.Store())], ast.Call(ast.Name(_CHOSEN, ast.Load()), [place], []))
            node.body.insert(head, ast.copy_location(read, node.body[head]))
        if isinstance(node, ast.While):
            spend = ast.Call(ast.Name(_SPEND, ast.Load()), [], [])
            node.test = ast.copy_location(ast.BoolOp(ast.And(), [spend, node.test]), node.test)
        if isinstance(node, ast.stmt):
            return self._statement(node, original, changes)
        made = node
        for number, change in changes:
            assert change.instead is not None and isinstance(made, ast.expr)
            made = ast.copy_location(ast.IfExp(_is(number, ast.Eq()), change.instead, made), node)
        return made

    @staticmethod
    def _statement(
        node: ast.stmt, original: ast.AST, changes: Sequence[tuple[int, Change]]
    ) -> ast.AST | list[ast.stmt]:
        made: list[ast.stmt] = [node]
        for number, change in changes:
            if change.kind == "skip":
                made[0] = ast.copy_location(ast.If(_is(number, ast.NotEq()), [made[0]], []), node)
            else:
                again = copy.deepcopy(original)
                assert isinstance(again, ast.stmt)
                made.append(ast.copy_location(ast.If(_is(number, ast.Eq()), [again], []), node))
        return made if len(made) > 1 else made[0]


def _is(number: int, relation: ast.cmpop) -> ast.Compare:
    return ast.Compare(ast.Name(_NUMBER, ast.Load()), [relation], [ast.Constant(number)])


def _parsed(module: Module) -> ast.Module:
    try:
        return ast.parse(module.text, str(module.path))
    except (SyntaxError, ValueError, RecursionError) as error:
        raise BadRequest(str(module.path), f"must be Python, but: {error}", slug="study-source") from error


def _is_head(one: ast.stmt) -> bool:
    """Whether a statement must stay the first of its module: its docstring, and what it imports from the future."""
    is_text = isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
    return is_text or (isinstance(one, ast.ImportFrom) and one.module == "__future__")


def _functions(tree: ast.AST, place: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            inner = f"{place}.{node.name}".lstrip(".")
            if isinstance(node, ast.FunctionDef) and not (node.name.startswith("__") and node.name != "__init__"):
                yield inner, node
            yield from _functions(node, inner)
        elif isinstance(node, ast.stmt):
            yield from _functions(node, place)


def _is_kernel(function: ast.FunctionDef) -> bool:
    """Whether a decorator compiles the function: ours, or numba's own."""
    words = {part.id if isinstance(part, ast.Name) else part.attr for one in function.decorator_list
             for part in ast.walk(one) if isinstance(part, ast.Name | ast.Attribute)}  # fmt: skip
    return bool(words & {"kernel", "heap_kernel", "njit", "jit"})


def _signatures(trees: Collection[ast.Module]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for tree in trees:
        for place, function in _functions(tree):
            arguments = [one for one in function.args.args if one.arg != "self"]
            types = tuple(ast.unparse(one.annotation) if one.annotation else "" for one in arguments)
            yield (place.split(".")[-2] if place.endswith(".__init__") else function.name), types


def _constants(tree: ast.Module) -> Iterator[tuple[str, float]]:
    """Yield the numbers that a module gives names in capitals."""
    for one in tree.body:
        if not isinstance(one, ast.Assign) or len(one.targets) != 1:
            continue
        target, value = one.targets[0], one.value
        pairs = [(target, value)]
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=False))
        for name, given in pairs:
            if isinstance(name, ast.Name) and name.id.isupper():
                try:
                    number = ast.literal_eval(given)
                except (ValueError, TypeError):
                    continue
                if isinstance(number, int | float) and not isinstance(number, bool):
                    yield name.id, number


def _is_of(one: ast.ImportFrom, known: Mapping[Path, Mapping[str, float]], constants: Mapping[str, float]) -> bool:
    """Whether an import is from the module that has these constants."""
    tail = (one.module or "").rpartition(".")[2]
    return any(path.stem == tail and each is constants for path, each in known.items())


def _shown(module: Module, change: Change) -> tuple[str, str]:
    """Return a change in short, and as a diff."""
    lines = module.text.encode().splitlines(keepends=True)
    node = change.node
    assert node.end_lineno is not None and node.end_col_offset is not None
    offset = sum(map(len, lines[: node.lineno - 1]))
    begin = offset + node.col_offset
    end = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    whole = module.text.encode()
    before = whole[begin:end].decode()
    if change.instead is not None:
        after = ast.unparse(ast.fix_missing_locations(copy.deepcopy(change.instead)))
        after = f"({after})" if isinstance(change.instead, ast.BinOp | ast.Compare | ast.BoolOp | ast.IfExp) else after
    else:
        after = "pass" if change.kind == "skip" else f"{before}\n{' ' * node.col_offset}{before}"
    short = f"{' '.join(before.split())} -> {' '.join(after.split())}"
    if change.kind == "twice":
        short = f"{' '.join(before.split())} twice"
    mutated = (whole[:begin] + after.encode() + whole[end:]).decode()
    return short, diff_of(module.path.name, module.text, mutated)
