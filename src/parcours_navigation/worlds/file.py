"""Reads a world file (`world/1`, docs/worlds.md): parts that are data, numbers that may be drawn from blocks."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from importlib.resources import files
from pathlib import Path

from parcours.data import InputModel
from parcours.data.schema import FORMAT as DATA_FORMAT
from parcours.data.schema import input_model_of
from parcours.errors import BadDomain, ParcoursError, one_of
from parcours.model.conversion import text_of
from parcours.model.documents import MAX_BYTES, Node, Scalar, Sequence, read_document
from parcours.model.documents import Mapping as MappingNode
from parcours.model.finding import Finding, complaint
from parcours.suite.cases import is_part
from parcours_navigation.ground.maps import read_map
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.ground.pictures import MOST_BYTES, read_bytes
from parcours_navigation.worlds.building import UNITS, Builder
from parcours_navigation.worlds.plan import WorldPlan
from parcours_navigation.worlds.units import is_scaled

FORMAT = "world/1"
"""The value of the key `parcours` in a file of this format."""

_PARTS = tuple(one.name for one in fields(WorldPlan))


class BadWorld(ParcoursError):
    """A world file, or a world that cannot be; `where` names file and line, or the case."""

    findings: tuple[Finding, ...] = ()  # where it says more than one


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """A world as its file describes it; each case has a `WorldPlan` of it."""

    name: str
    doc: str
    origin: str  # the file's name, for messages
    folder: Path  # in which the files lie that it names
    root: MappingNode
    inputs: InputModel | None  # what is drawn for each case; None: all cases have the same plan
    digest: str  # of the file and of those that it names
    _plans: dict[tuple[float, ...], WorldPlan] = field(default_factory=dict)

    def plan(self, values: tuple[float, ...] = ()) -> WorldPlan:
        """Return what the world is made of for a case's values, in the order of `inputs.names`.

        Raises BadWorld, naming the line, if they make no world.
        """
        found = self._plans.get(values)
        if found is None:
            found = self._build(values)
            if self.inputs is None:
                self._plans[values] = found
        return found

    @property
    def reference(self) -> str:
        """How it is found again: the name of a shipped world, or the whole path of its file."""
        path = self.folder / Path(self.origin).name
        return path.stem if shipped().get(path.stem) == path else str(path)

    def line_of(self, where: str) -> int:
        """Return the line of what a message calls `task, goal` or `others 2, number`; where unknown, the nearest above.

        Args:
            where: keys from the top, separated by commas; an item of a list is its name and number; or a file's path.
        """
        if "/" in where:
            tracks = [one for one in _named(self.root, "tracks") if where.startswith(str(self.folder / one.text))]
            found: list[Node] = [*tracks, *_named(self.root, "map"), self.root]
            return found[0].line
        at: Node = self.root
        for part in where.split(", "):
            name, _, number = part.partition(" ")
            name = _LISTS.get(name, name)
            for under in (at, _under(at, "ground"), _under(self.root, "sensing")):
                below = _under(under, name)
                if below is not None:
                    at = below
                    break
            if number.isdecimal() and isinstance(at, Sequence) and 0 < int(number) <= len(at.items):
                at = at.items[int(number) - 1]
        return at.line

    def _build(self, values: tuple[float, ...]) -> WorldPlan:
        names = self.inputs.names if self.inputs is not None else ()
        units = {one.name: one.unit for one in self.inputs.domains} if self.inputs is not None else {}
        builder = Builder(self.origin, dict(zip(names, values, strict=True)), units)
        parts = tuple((key, node) for key, node in self.root.items if key.text in _PARTS)
        plan: WorldPlan | None = builder.made(WorldPlan, MappingNode(parts, self.root.line), "the world")
        if builder.findings or plan is None:
            drawn = ", ".join(f"{name} = {value:g}" for name, value in zip(names, values, strict=True))
            raise refusal(builder.findings, f" (with {drawn})" if drawn else "")
        return plan


def shipped() -> Mapping[str, Path]:
    """Return the files of the worlds that ship with Parcours, by name."""
    folder = Path(str(files("parcours_navigation.worlds") / "shipped"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def find_world(name: str) -> World:
    """Return a shipped world by its name, or that of a file."""
    known = shipped()
    if name in known:
        return read_world(known[name])
    if not name.endswith((".yaml", ".yml")):
        beside = next((name + end for end in (".yaml", ".yml") if Path(name + end).is_file()), "")
        remedy = f"did you mean the file {beside!r}?" if beside else one_of(name, list(known))
        raise BadWorld(f"world {name!r}", "it must be a shipped world or a .yaml file", remedy, slug="world-unknown")
    return read_world(Path(name))


def read_world(path: Path) -> World:
    """Return the world that a file describes. Raises BadWorld with all findings and their lines."""
    return parse_world(text_of(path, MAX_BYTES, "a world", BadWorld), str(path), path.absolute().parent)


@functools.lru_cache(maxsize=64)
def parse_world(text: str, origin: str, folder: Path) -> World:
    """Return the world that a text describes; the files that it names lie in `folder`."""
    root, found = read_document(text, origin, "a world")
    if root is None or found:
        raise refusal(found)
    world = _world(root, origin, folder, text)
    n_tried = 16 if world.inputs is not None else 1
    for values in _samples(world, n_tried):
        world.plan(values)
    return world


def _samples(world: World, n: int) -> list[tuple[float, ...]]:
    from parcours.suite import combine

    if world.inputs is None:
        return [()]
    return [case.values for case in combine("world", ["world"], world.inputs, n_cases=n).cases()]


def _world(root: Node, origin: str, folder: Path, text: str) -> World:
    builder = Builder(origin, {})
    items = builder.record(root, "a world", ("parcours", "name"), ("doc", "data", *_PARTS))
    form = builder.text(items.get("parcours"), "parcours", FORMAT)
    if form != FORMAT:
        builder.add(items["parcours"], "format", f"the format must be {FORMAT}, but is {form[:40]!r}")
    name = builder.text(items.get("name"), "name")
    if "name" in items and not is_part(name):
        builder.add(items["name"], "case-id", f"a name consists of letters, digits and _ . + @ = , -, but is {name!r}")
    doc = builder.text(items.get("doc"), "doc")
    if builder.findings or not isinstance(root, MappingNode):
        raise refusal(builder.findings)
    inputs = _inputs(items["data"], name, origin) if "data" in items else None
    digest = hashlib.sha256(text.encode())
    for named in _named(root, "tracks"):
        digest.update(_content(folder / named.text))
    for named in _named(root, "map"):
        digest.update(_content(folder / named.text))
        with suppress(BadGround):  # said where the map is laid
            shown = read_map(folder / named.text) if (folder / named.text).is_file() else None
            digest.update(shown.cells.tobytes() if shown is not None else b"")
    return World(name, doc, origin, folder, root, inputs, digest.hexdigest()[:16])


def _inputs(node: Node, name: str, origin: str) -> InputModel:
    """Return the input model under `data`, which is written as in a file of format data/1."""
    line = node.line
    head = ((Scalar("parcours", True, line), Scalar(DATA_FORMAT, True, line)),
            (Scalar("name", True, line), Scalar(name, True, line)))  # fmt: skip
    rest = node.items if isinstance(node, MappingNode) else ()
    try:
        inputs = input_model_of(MappingNode((*head, *rest), line), origin)
    except BadDomain as error:
        raise BadWorld(error.where, error.rule, error.remedy, slug=error.slug) from None
    for one in inputs.names:
        if one in UNITS:
            raise BadWorld(f"{origin}:{line}", f"an input may not be called {one!r}, which numbers use as a unit",
                           "rename it", slug="duplicate-name")  # fmt: skip
    for domain in inputs.domains:
        if is_scaled(domain.unit):
            rule = f"an input must be in an SI unit, but {domain.name!r} is in {domain.unit}"
            raise BadWorld(f"{origin}:{line}", rule, "give its blocks in m, s, rad or m/s", slug="world-unit")
    return inputs


_LISTS = {"wall": "walls", "polygon": "polygons", "disc": "discs", "rasterise": "map"}
"""The keys of what messages call otherwise."""


def _under(node: Node | None, key: str) -> Node | None:
    """Return the value of a key, None without one."""
    items = node.items if isinstance(node, MappingNode) else ()
    return next((value for one, value in items if one.text == key), None)


def _named(node: Node, key: str) -> list[Scalar]:
    """Return the texts under a key, anywhere."""
    if isinstance(node, Scalar):
        return []
    if not isinstance(node, MappingNode):
        return [found for item in node.items for found in _named(item, key)]
    own = [value for one, value in node.items if one.text == key and isinstance(value, Scalar)]
    return own + [found for _, value in node.items for found in _named(value, key)]


def _content(path: Path) -> bytes:
    try:
        return read_bytes(path, "map-file", MOST_BYTES)
    except BadGround:  # said where it is read
        return b""


def refusal(found: list[Finding], tail: str = "") -> BadWorld:
    """Return one error that says all findings."""
    ordered = tuple(sorted(set(found)))
    error = complaint(ordered, "a world", slug="world-errors")
    refused = BadWorld(error.where, error.rule + tail, error.remedy, slug=error.slug)
    refused.findings = ordered if len(found) > 1 else ()
    return refused


__all__ = ["BadWorld", "World", "find_world", "parse_world", "read_world", "shipped"]
