"""Which states a microstep leaves and enters: the algorithm of W3C SCXML 1.0, appendix D, on one document."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from parcours_formats.scxml.chart import Arc, Node
from parcours_formats.xml_lines import Element


@dataclass(frozen=True, slots=True)
class Configuration:
    """The active states (all of them, by order in the document), and what each history remembers."""

    active: frozenset[Node]
    remembered: frozenset[tuple[Node, frozenset[Node]]] = frozenset()

    def atoms(self) -> list[Node]:
        """Return the active states that have none inside, in the order of the document."""
        return sorted((node for node in self.active if node.is_atomic), key=_order)

    @property
    def name(self) -> str:
        """The ids of the innermost active states, with what histories remember."""
        name = " | ".join(node.id for node in self.atoms())
        kept = sorted(
            f"{history.id}: {' | '.join(node.id for node in sorted(nodes, key=_order))}"
            for history, nodes in self.remembered
        )
        return f"{name} ({', '.join(kept)})" if kept else name


def arrived(configuration: Configuration, node: Node) -> bool:
    """Return whether a state has come to its end: `done.state.id` was raised."""
    if node.is_compound:
        return any(child.kind == "final" and child in configuration.active for child in node.inner())
    return node.kind == "parallel" and all(arrived(configuration, child) for child in node.inner())


def start(root: Node) -> tuple[Configuration, list[Element]]:
    """Return the first configuration of a document, or of one region of it, and what is done on the way."""
    moves = _Moves(Configuration(frozenset()))
    if root.kind == "scxml":
        moves.targets(root.starts, root)
        moves.defaults[root] = root.start_content
    else:
        moves.descend(root)
    return moves.entered(frozenset(), frozenset())


def without_conflicts(arcs: Iterable[Arc], configuration: Configuration) -> list[Arc]:
    """Return the transitions that can be taken together: of two that leave a common state, the inner one."""
    kept: list[Arc] = []
    for arc in arcs:
        leaving = exits(arc, configuration)
        rivals = [other for other in kept if leaving & exits(other, configuration)]
        if all(arc.source.is_inside(other.source) for other in rivals):
            kept = [other for other in kept if other not in rivals]
            kept.append(arc)
    return kept


def take(arcs: Iterable[Arc], configuration: Configuration) -> tuple[Configuration, list[Element], list[Element]]:
    """Return the configuration after transitions that are taken together, and what is done before and on entering it.

    Args:
        arcs: transitions without conflicts, in the order of the document.
        configuration: in which all of them start.
    """
    arcs = tuple(arcs)
    leaving = {node for arc in arcs for node in exits(arc, configuration)}
    remembered = dict(configuration.remembered)
    done: list[Element] = []
    for node in sorted(leaving, key=_order, reverse=True):
        for history in (child for child in node.children if child.kind == "history"):
            inside = (each for each in configuration.active if each.is_inside(node))
            remembered[history] = frozenset(
                each for each in inside if (each.is_atomic if history.is_deep else each.parent is node)
            )
        done += node.exit
    for arc in arcs:
        done += arc.content
    now = Configuration(configuration.active, frozenset(remembered.items()))
    moves = _Moves(now)
    for arc in arcs:
        if arc.targets:
            domain = _domain(arc, now)
            moves.targets(arc.targets, domain)
    after, entering = moves.entered(configuration.active - leaving, now.remembered)
    return after, done, entering


def exits(arc: Arc, configuration: Configuration) -> frozenset[Node]:
    """Return the active states that a transition leaves."""
    if not arc.targets:
        return frozenset()
    domain = _domain(arc, configuration)
    return frozenset(node for node in configuration.active if node.is_inside(domain))


def _domain(arc: Arc, configuration: Configuration) -> Node:
    targets = _effective(arc.targets, configuration)
    if arc.is_internal and arc.source.is_compound and all(target.is_inside(arc.source) for target in targets):
        return arc.source
    for ancestor in arc.source.ancestors():
        if ancestor.is_compound and all(target.is_inside(ancestor) for target in targets):
            return ancestor
    return list(arc.source.ancestors())[-1] if arc.source.parent is not None else arc.source


def _effective(targets: Iterable[Node], configuration: Configuration) -> list[Node]:
    remembered, found = dict(configuration.remembered), list[Node]()
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

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.remembered = dict(configuration.remembered)
        self.entering: set[Node] = set()
        self.defaults: dict[Node, tuple[Element, ...]] = {}

    def targets(self, nodes: Iterable[Node], domain: Node) -> None:
        nodes = list(nodes)
        for node in nodes:
            self.descend(node)
        for node in _effective(nodes, self.configuration):
            self.climb(node, domain)

    def descend(self, node: Node) -> None:
        if node.kind == "history":
            if node in self.remembered:
                inside: Iterable[Node] = self.remembered[node]
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
        elif node.kind == "parallel":
            for child in node.inner():
                if not any(each.is_inside(child) or each is child for each in self.entering):
                    self.descend(child)

    def climb(self, node: Node, until: Node) -> None:
        for ancestor in node.ancestors(until):
            self.entering.add(ancestor)
            if ancestor.kind == "parallel":
                for child in ancestor.inner():
                    if not any(each.is_inside(child) or each is child for each in self.entering):
                        self.descend(child)

    def entered(
        self, staying: frozenset[Node], remembered: frozenset[tuple[Node, frozenset[Node]]]
    ) -> tuple[Configuration, list[Element]]:
        done: list[Element] = []
        for node in sorted(self.entering - staying, key=_order):
            done += node.entry
            done += self.defaults.get(node, ())
        active = frozenset(node for node in self.entering | staying if node.kind != "scxml")
        return Configuration(active, remembered), done


def _order(node: Node) -> int:
    return node.order
