"""Turns a drawn graph into machines over an alphabet, or GraphWalker's models, depending on its labels."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from parcours.errors import BadModel
from parcours.model.conversion import Loss
from parcours.model.structure import Machine, Send, Transition
from parcours_formats.dot.dot_graphs import DotEdge, DotGraph, label_text
from parcours_formats.graphwalker.joining import START
from parcours_formats.graphwalker.labels import Model, as_edge, as_vertex
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames, as_label
from parcours_formats.symbols import Alphabet

_MOORE = re.compile(r"([^/|]*)[/|]([^/|]*)", re.DOTALL)
_NAME = re.compile(r"[\w$.]*")
_INVISIBLE = ("point", "none", "plaintext", "plain")
_MARK = "__start"


def drawings(graph: DotGraph, origin: str, name: str) -> Iterator[Drawing]:
    """Yield the machines that a digraph draws: one, unless parts that no edge joins have starts of their own."""
    whole = Drawing(graph, origin, name)
    # A search from each start: if two reach the same part, all is one machine; what none reaches goes with the first.
    part: dict[str, int] = {}
    near: dict[str, list[str]] = {id: [] for id in graph.nodes}
    for edge in graph.edges:
        near[edge.source].append(edge.target)
        near[edge.target].append(edge.source)
    for number, mark in enumerate(whole.marks):
        border = [mark]
        while border:
            if part.setdefault(id := border.pop(), number) == number and near[id]:
                border += near[id]
                near[id] = []
    if len({part[mark] for mark in whole.marks}) < max(len(whole.marks), 2):
        yield whole
        return
    for number in range(len(whole.marks)):
        ids = [id for id in graph.nodes if part.get(id, 0) == number]
        piece = DotGraph(graph.name, graph.line, graph.attributes, {id: graph.nodes[id] for id in ids}, graph.lines)
        piece.edges = [edge for edge in graph.edges if part.get(edge.source, 0) == number]
        yield Drawing(piece, origin, name)


class Drawing:
    """A graph with its labels as they are seen."""

    def __init__(self, graph: DotGraph, origin: str, name: str) -> None:
        self.graph = graph
        self.name = as_label(label_text({"label": graph.name})) if graph.name.strip() else name
        self.labels = {id: label_text(attributes, id) for id, attributes in graph.nodes.items()}
        self.edges = [(edge, label_text(edge.attributes)) for edge in graph.edges]
        self.marks = self._marks()
        self.states = [id for id in graph.nodes if id not in self.marks]
        first = next((edge.source for edge in graph.edges), next(iter(graph.nodes), ""))
        self.initial = next(iter(self.marks.values()), first)
        if not self.states:
            rule = f"a graph must have a node, but {self.name!r} has none"
            raise BadModel(f"{origin}:{graph.line}", rule, slug="dot-graph")

    @property
    def is_walked(self) -> bool:
        """Whether its labels are GraphWalker's: with guards or actions, from a node `Start`, or named as it does."""
        if any(mark.startswith(_MARK) for mark in self.marks):
            return False
        said = [label for _, label in self.edges if label]
        if any(map(_is_walked, said)) or (said and all(label[:2] == "e_" for label in said)):
            return True
        if any(self._seen(mark).lower() == START.lower() for mark in self.marks):
            return True
        entered = {edge.target for edge in self.graph.edges}
        starts = [id for id in self.graph.nodes if self._seen(id).lower() == START.lower() and id not in entered]
        return len(starts) == 1 and not any("/" in label for label in said)

    def losses(self) -> Iterator[Loss]:
        """Yield what the graph says and no model does."""
        for mark in list(self.marks)[1:]:
            what = f"a machine starts in one state; the start in {self.marks[mark]!r} is not kept"
            yield Loss(f"node {mark!r}", self.graph.lines[mark], what)
        for id, attributes in self.graph.nodes.items():
            for key in attributes.keys() - DRAWN:
                yield Loss(f"node {id!r}", self.graph.lines[id], f"its attribute {key[:60]!r} is not kept")
        for edge in self.graph.edges:
            for key in edge.attributes.keys() - DRAWN:
                where = f"edge from {edge.source!r} to {edge.target!r}"
                yield Loss(where, edge.line, f"its attribute {key[:60]!r} is not kept")

    def model(self) -> Model:
        """Return the graph as GraphWalker's model."""
        vertices, actions = [], list[str]()
        for id in self.states:
            vertex, initial = as_vertex(self._seen(id), id, self.graph.lines[id])
            vertices.append(vertex)
            actions += initial
        edges = [
            as_edge(label, edge.attributes.get("id", ""), edge.source, edge.target, edge.line)
            for edge, label in self.edges
            if edge.source not in self.marks
        ]
        started = any(vertex.name.lower() == START.lower() for vertex in vertices)
        start = self.initial if self.marks or not started else ""
        return Model(self.name, vertices, edges, start, tuple(actions), line=self.graph.line)

    def machine(self, component: str, name: str, alphabet: Alphabet, ids: UniqueNames) -> tuple[Machine, list[Loss]]:
        """Return the graph as a machine of a component, whose transitions take and give symbols, and what it loses."""
        shown, given_in = self._moore()
        # A label that several nodes have is no name.
        bearers = Counter(shown[id] for id in self.states)
        named = UniqueNames()
        states = {id: named.label(shown[id] if bearers[shown[id]] == 1 else id) for id in self.states}
        transitions = []
        for edge, label in self.edges:
            if edge.source in self.marks:
                continue
            taken, _, given = label.partition(" / ") if " / " in label else label.partition("/")
            taken, given = taken.strip(), given.strip() or given_in.get(edge.target, "")
            source, target = states[edge.source], states[edge.target]
            wanted = edge.attributes.get("id") or (f"{source} {taken}" if taken else f"{source} to {target}")
            event = alphabet.received(component, as_label(taken)) if taken else None
            sends: tuple[Send, ...] = alphabet.sent(component, as_label(given)) if given else ()
            transitions.append(Transition(ids.label(wanted), source, target, event, sends=sends, line=edge.line))
        final = tuple(states[id] for id in self.states if self.graph.nodes[id].get("shape") == "doublecircle")
        initial = states[self.initial]
        losses = Losses()
        if first := given_in.get(self.initial):
            what = f"outputs are given on entering a state; {first!r} before the first input is not kept"
            losses.add(f"state {initial!r}", self.graph.line, what)
        machine = Machine(name, initial, tuple(states.values()), tuple(transitions), final, line=self.graph.line)
        return machine, losses

    def _moore(self) -> tuple[dict[str, str], dict[str, str]]:
        """Return the name of each state, and its output if the states have outputs and no edge has (`s0 / a`)."""
        seen = {id: self._seen(id) for id in self.states}
        split = {id: _MOORE.fullmatch(label) for id, label in seen.items()}
        if any("/" in label for _, label in self.edges):
            return seen, {}
        outputs = {id: match[2].strip() for id, match in split.items() if match is not None}
        names = {id: match[1].strip() or id for id, match in split.items() if match is not None}
        return (names, outputs) if len(names) == len(seen) else (seen, {})

    def _marks(self) -> dict[str, str]:
        """Return the nodes that only mark a start, each with that start."""
        entered = {edge.target for edge, _ in self.edges}
        leaving: dict[str, list[tuple[DotEdge, str]]] = {}
        for edge, label in self.edges:
            leaving.setdefault(edge.source, []).append((edge, label))
        found = {}
        for id, attributes in self.graph.nodes.items():
            ways = leaving.get(id, [])
            if id in entered or len(ways) != 1 or ways[0][1]:
                continue
            hidden = attributes.get("shape") in _INVISIBLE or "invis" in attributes.get("style", "")
            unnamed = "label" in attributes and not self.labels[id]
            if id.startswith(_MARK) or hidden or unnamed or self._seen(id).lower() == START.lower():
                found[id] = ways[0][0].target
        return {id: start for id, start in found.items() if start not in found}

    def _seen(self, id: str) -> str:
        return self.labels[id] or id


def _is_walked(label: str) -> bool:
    edge = as_edge(label, "", "", "")
    acts = any(text.endswith(";") for text in edge.actions)
    return _NAME.fullmatch(edge.name) is not None and bool(edge.guard or edge.weight or acts)


DRAWN = frozenset(
    re.findall(
        r"\w+",
        """URL area arrowhead arrowsize arrowtail class color colorscheme comment constraint decorate dir distortion
        edgeURL edgehref edgetarget edgetooltip fillcolor fixedsize fontcolor fontname fontsize gradientangle group
        headURL head_lp headclip headhref headlabel headport headtarget headtooltip height href id image imagepos
        imagescale label labelURL labelangle labeldistance labelfloat labelfontcolor labelfontname labelfontsize
        labelhref labeljust labelloc labeltarget labeltooltip layer len lhead lp ltail margin minlen nojustify ordering
        orientation penwidth peripheries pin pos radius rects regular root samehead samepoints sametail sampoints
        shape shapefile showboxes sides skew sortv style tailURL tail_lp tailclip tailhref taillabel tailport
        tailtarget tailtooltip target tooltip vertices weight width xdotversion xlabel xlp z""",
    )
)
"""Names of attributes of nodes and edges."""
