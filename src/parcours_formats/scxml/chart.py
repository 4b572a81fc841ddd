"""The states of an SCXML document, and which of them a microstep leaves and enters (W3C SCXML 1.0, appendix D)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NoReturn

from parcours.errors import BadModel
from parcours_formats.xml_lines import Element

STATES = ("state", "parallel", "final", "history")

OWN = "urn:parcours"
"""The namespace of what our own writer adds to transitions."""

ID, SILENT = "transition", "tau"
"""The attributes it adds: the name of a transition, and whether its event stands for none."""


@dataclass(slots=True, eq=False)
class Arc:
    """A transition; `events` are descriptors such as `error.*`, and `content` is what it does.

    `id` and `is_silent` are what our own writer notes: the name it had, and that its event stands for none.
    """

    source: StateNode
    events: tuple[str, ...]
    condition: str
    targets: tuple[StateNode, ...]
    is_internal: bool
    content: tuple[Element, ...]
    line: int
    id: str = ""
    is_silent: bool = False


@dataclass(slots=True, eq=False)
class StateNode:
    """A state, or the document itself (`scxml`). `order` is its place in the document."""

    id: str
    kind: str
    parent: StateNode | None
    order: int
    line: int
    children: list[StateNode] = field(default_factory=list)
    arcs: list[Arc] = field(default_factory=list)
    entry: tuple[Element, ...] = ()
    exit: tuple[Element, ...] = ()
    starts: tuple[StateNode, ...] = ()
    start_content: tuple[Element, ...] = ()
    is_deep: bool = False

    @property
    def is_atomic(self) -> bool:
        """Whether the state has no states inside."""
        return self.kind == "final" or (self.kind == "state" and not self.inner())

    @property
    def is_compound(self) -> bool:
        """Whether one of the states inside is active with it."""
        return self.kind == "scxml" or (self.kind == "state" and bool(self.inner()))

    def inner(self) -> list[StateNode]:
        """Return the states directly inside, without histories."""
        return [child for child in self.children if child.kind != "history"]

    def ancestors(self, until: StateNode | None = None) -> Iterator[StateNode]:
        """Yield what the state lies in, innermost first, up to but without `until`."""
        here = self.parent
        while here is not None and here is not until:
            yield here
            here = here.parent

    def is_inside(self, other: StateNode) -> bool:
        """Return whether the state lies in the other, at any depth."""
        return any(ancestor is other for ancestor in self.ancestors())

    def walk(self) -> Iterator[StateNode]:
        """Yield the state and all inside, in the order of the document."""
        yield self
        for child in self.children:
            yield from child.walk()


class ChartReader:
    """Reads the states of one document."""

    def __init__(self, root: Element, origin: str) -> None:
        self.origin = origin
        self.nodes: dict[str, StateNode] = {}
        self.invoked: list[Element] = []
        self._elements: list[tuple[StateNode, Element]] = []
        # Two passes: a target may stand behind the transition that names it.
        self.root = self._node(root, None)
        for node, element in self._elements:
            self._fill(node, element)

    def _node(self, element: Element, parent: StateNode | None) -> StateNode:
        id = element.get("id") if parent is not None else ""
        if not id:
            id = f"{element.tag}@{element.line}" if parent is not None else "scxml"
            if id in self.nodes:
                id = f"{id}.{len(self.nodes)}"
        if id in self.nodes:
            self._fail(element, f"each state must have an id of its own, but {id!r} was used before", "duplicate")
        node = StateNode(id, element.tag, parent, len(self.nodes), element.line)
        node.is_deep = element.get("type") == "deep"
        self.nodes[id] = node
        self._elements.append((node, element))
        node.children = [self._node(child, node) for child in element.all(*STATES)]
        return node

    def _fill(self, node: StateNode, element: Element) -> None:
        node.entry = tuple(action for block in element.all("onentry") for action in block.children)
        node.exit = tuple(action for block in element.all("onexit") for action in block.children)
        node.arcs = [self._arc(node, child) for child in element.all("transition")]
        self.invoked += element.all("invoke")
        initial = element.first("initial")
        if node.kind == "history":
            if len(node.arcs) != 1 or not node.arcs[0].targets:
                self._fail(element, f"history {node.id!r} must have one transition with a target, but has not")
            node.starts, node.start_content = node.arcs[0].targets, node.arcs[0].content
            if any(start.kind == "history" or not start.is_inside(node.parent or node) for start in node.starts):
                self._fail(element, f"history {node.id!r} must lead to states beside it, but does not")
        elif node.is_compound:
            if initial is not None and (inner := initial.first("transition")) is not None:
                node.starts = self._named(inner, inner.get("target"))
                node.start_content = tuple(inner.children)
            elif element.get("initial"):
                node.starts = self._named(element, element.get("initial"))
            else:
                node.starts = tuple(node.inner()[:1])
            for start in node.starts:
                if not start.is_inside(node):
                    rule = f"the initial state of {node.id!r} must lie inside it, but {start.id!r} does not"
                    self._fail(element, rule)
        if node.kind == "scxml" and not node.inner():
            self._fail(element, "a document must have a state, but has none")

    def _arc(self, node: StateNode, element: Element) -> Arc:
        events, condition = tuple(element.get("event").split()), element.get("cond").strip()
        targets, content = self._named(element, element.get("target")), tuple(element.children)
        is_internal, is_silent = element.get("type") == "internal", element.get(SILENT) == "true"
        return Arc(node, events, condition, targets, is_internal, content, element.line, element.get(ID), is_silent)

    def _named(self, element: Element, ids: str) -> tuple[StateNode, ...]:
        found = []
        for id in ids.split():
            if id not in self.nodes or id == "scxml":
                self._fail(element, f"a target must be a state, but {id[:60]!r} is not one", "unknown-state")
            found.append(self.nodes[id])
        return tuple(found)

    def _fail(self, element: Element, rule: str, slug: str = "scxml-structure") -> NoReturn:
        raise BadModel(f"{self.origin}:{element.line}", rule, slug=slug)


@dataclass(frozen=True, slots=True)
class ChartConfiguration:
    """The active states (all of them, by order in the document), and what each history remembers."""

    active: frozenset[StateNode]
    remembered: frozenset[tuple[StateNode, frozenset[StateNode]]] = frozenset()

    def atoms(self) -> list[StateNode]:
        """Return the active states that have none inside, in the order of the document."""
        return sorted((node for node in self.active if node.is_atomic), key=in_order)

    @property
    def name(self) -> str:
        """The ids of the innermost active states, with what histories remember."""
        name = " | ".join(node.id for node in self.atoms())
        kept = sorted(
            f"{history.id}: {' | '.join(node.id for node in sorted(nodes, key=in_order))}"
            for history, nodes in self.remembered
        )
        return f"{name} ({', '.join(kept)})" if kept else name


def arrived(configuration: ChartConfiguration, node: StateNode) -> bool:
    """Return whether a state has come to its end: `done.state.id` was raised."""
    if node.is_compound:
        return any(child.kind == "final" and child in configuration.active for child in node.inner())
    return node.kind == "parallel" and all(arrived(configuration, child) for child in node.inner())


def start(root: StateNode) -> tuple[ChartConfiguration, list[Element]]:
    """Return the first configuration of a document, or of one region of it, and what is done on the way."""
    moves = _Moves(ChartConfiguration(frozenset()))
    if root.kind == "scxml":
        moves.targets(root.starts, root)
        moves.defaults[root] = root.start_content
    else:
        moves.descend(root)
    return moves.entered(frozenset(), frozenset())


def without_conflicts(arcs: Iterable[Arc], configuration: ChartConfiguration) -> list[Arc]:
    """Return the transitions that can be taken together: of two that leave a common state, the inner one."""
    kept: list[Arc] = []
    for arc in arcs:
        leaving = exits(arc, configuration)
        rivals = [other for other in kept if leaving & exits(other, configuration)]
        if all(arc.source.is_inside(other.source) for other in rivals):
            kept = [other for other in kept if other not in rivals]
            kept.append(arc)
    return kept


def take(
    arcs: Iterable[Arc], configuration: ChartConfiguration
) -> tuple[ChartConfiguration, list[Element], list[Element]]:
    """Return the configuration after transitions taken together, and what is done before and on entering it."""
    arcs = tuple(arcs)
    leaving = {node for arc in arcs for node in exits(arc, configuration)}
    remembered = dict(configuration.remembered)
    done: list[Element] = []
    # Exits run inside out, then the transitions, then entries outside in (appendix D of the standard).
    for node in sorted(leaving, key=in_order, reverse=True):
        for history in (child for child in node.children if child.kind == "history"):
            inside = [each for each in configuration.active if each.is_inside(node)]
            kept = (each for each in inside if (each.is_atomic if history.is_deep else each.parent is node))
            remembered[history] = frozenset(kept)
        done += node.exit
    for arc in arcs:
        done += arc.content
    now = ChartConfiguration(configuration.active, frozenset(remembered.items()))
    moves = _Moves(now)
    for arc in arcs:
        if arc.targets:
            domain = _domain(arc, now)
            moves.targets(arc.targets, domain)
    after, entering = moves.entered(configuration.active - leaving, now.remembered)
    return after, done, entering


def exits(arc: Arc, configuration: ChartConfiguration) -> frozenset[StateNode]:
    """Return the active states that a transition leaves."""
    if not arc.targets:
        return frozenset()
    domain = _domain(arc, configuration)
    return frozenset(node for node in configuration.active if node.is_inside(domain))


def _domain(arc: Arc, configuration: ChartConfiguration) -> StateNode:
    targets = _effective(arc.targets, configuration)
    if arc.is_internal and arc.source.is_compound and all(target.is_inside(arc.source) for target in targets):
        return arc.source
    for ancestor in arc.source.ancestors():
        if ancestor.is_compound and all(target.is_inside(ancestor) for target in targets):
            return ancestor
    return list(arc.source.ancestors())[-1] if arc.source.parent is not None else arc.source


def _effective(targets: Iterable[StateNode], configuration: ChartConfiguration) -> list[StateNode]:
    remembered, found = dict(configuration.remembered), list[StateNode]()
    for target in targets:
        if target.kind != "history":
            found.append(target)
        elif target in remembered:
            found += remembered[target]
        else:
            found += _effective(target.starts, configuration) if target not in target.starts else []
    return found


class _Moves:
    """Collects the states to enter, and the content of the defaults that lead there."""

    def __init__(self, configuration: ChartConfiguration) -> None:
        self.configuration = configuration
        self.remembered = dict(configuration.remembered)
        self.entering: set[StateNode] = set()
        self.defaults: dict[StateNode, tuple[Element, ...]] = {}

    def targets(self, nodes: Iterable[StateNode], domain: StateNode) -> None:
        nodes = list(nodes)
        for node in nodes:
            self.descend(node)
        for node in _effective(nodes, self.configuration):
            self.climb(node, domain)

    def descend(self, node: StateNode) -> None:
        if node.kind == "history":
            if node in self.remembered:
                inside: Iterable[StateNode] = self.remembered[node]
            else:
                inside = node.starts
                if node.parent is not None:
                    self.defaults[node.parent] = node.start_content
            inside = [each for each in inside if each is not node]
            for each in inside:
                self.descend(each)
            for each in _effective(inside, self.configuration):
                if node.parent is not None:
                    self.climb(each, node.parent)
            return
        self.entering.add(node)
        if node.is_compound:
            self.defaults.setdefault(node, node.start_content)
            for each in node.starts:
                self.descend(each)
            for each in _effective(node.starts, self.configuration):
                self.climb(each, node)
        self.fill(node)

    def fill(self, node: StateNode) -> None:
        """Enter the regions of a parallel state in which nothing is entered yet."""
        for child in node.inner() if node.kind == "parallel" else ():
            if not any(each.is_inside(child) or each is child for each in self.entering):
                self.descend(child)

    def climb(self, node: StateNode, until: StateNode) -> None:
        for ancestor in node.ancestors(until):
            self.entering.add(ancestor)
            self.fill(ancestor)

    def entered(
        self, staying: frozenset[StateNode], remembered: frozenset[tuple[StateNode, frozenset[StateNode]]]
    ) -> tuple[ChartConfiguration, list[Element]]:
        done: list[Element] = []
        for node in sorted(self.entering - staying, key=in_order):
            done += node.entry
            done += self.defaults.get(node, ())
        active = frozenset(node for node in self.entering | staying if node.kind != "scxml")
        return ChartConfiguration(active, remembered), done


def in_order(node: StateNode) -> int:
    """Return the place of a state in the document."""
    return node.order
