"""Reads and writes yEd's GraphML with GraphWalker's labels.

A node `Start` with an edge that does nothing marks where the walk starts. Groups are flattened; if several groups have
a `Start`, each is a graph of its own. Plain GraphML without yEd's labels is read by ids and by data called label or
name.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from parcours.errors import BadModel
from parcours.model.conversion import ForeignModel, Writing
from parcours.model.structure import Cefsm
from parcours_formats.graphwalker import labels
from parcours_formats.graphwalker.joining import START, joined
from parcours_formats.graphwalker.labels import LabelledEdge, Model, Vertex
from parcours_formats.graphwalker.splitting import parted
from parcours_formats.losses import Losses
from parcours_formats.naming import as_label, stem
from parcours_formats.xml_lines import Element, parse_xml


def read(text: str, origin: str) -> ForeignModel:
    """Return the model that a GraphML file holds.

    Raises BadModel if its graph is not directed, or a label says what our language cannot.

    >>> reading = read('''<graphml><graph edgedefault="directed"><node id="a"/><node id="b"/>
    ... <edge source="a" target="b"/></graph></graphml>''', "two.graphml")
    >>> reading.cefsm.component("two").machines[0].states
    ('a', 'b')
    """
    root = parse_xml(text, origin)
    graph = root.first("graph")
    if root.tag != "graphml" or graph is None:
        rule = f"a GraphML file must be a <graphml> with a <graph>, but this is a <{root.tag[:40]}> without"
        raise BadModel(f"{origin}:{root.line}", rule, slug="graphml")
    reader = _Reader(root, origin)
    name = reader.described(graph) or stem(origin)
    reader.graph(graph)
    return joined(reader.models(name), name, origin, reader.losses)


class _Reader:
    """The nodes and edges of one file, flattened; `groups` tells in which outermost group a node lies."""

    def __init__(self, root: Element, origin: str) -> None:
        self.origin = origin
        self.losses = Losses()
        self.keys = {key.get("id"): key.get("attr.name").lower() for key in root.all("key")}
        self.vertices: dict[str, Vertex] = {}
        self.initial: dict[str, tuple[str, ...]] = {}
        self.edges: list[LabelledEdge] = []
        self.inside: dict[str, str] = {}
        self.titles: dict[str, str] = {}
        self.frames: dict[str, Vertex] = {}

    def described(self, graph: Element) -> str:
        said = next((each.text for each in graph.all("data") if self.keys.get(each.get("key")) == "description"), "")
        return as_label(said) if said.strip() and "\n" not in said.strip() else ""

    def graph(self, graph: Element, group: str = "") -> None:
        if graph.get("edgedefault", "directed") != "directed":
            raise self.wrong(graph, "a graph must be directed, but this one is not")
        for node in graph.all("node"):
            id, inner = node.get("id"), node.first("graph")
            if id in self.inside:
                raise self.wrong(node, f"each node must have an id of its own, but {id!r} is used twice")
            self.inside[id] = group or (id if inner is not None else "")
            label = self.label(node, "NodeLabel")
            self.described_too(node, f"node {id!r}")
            vertex, initial = labels.as_vertex(label, id, node.line)
            if inner is None:
                self.vertices[id], self.initial[id] = vertex, initial
            else:
                self.frames[id] = vertex
                self.titles[id] = as_label(label or id)
                self.graph(inner, group or id)
        for edge in graph.all("edge"):
            if edge.get("directed") == "false":
                raise self.wrong(edge, "an edge must be directed, but this one is not")
            ends = (edge.get("source"), edge.get("target"))
            for end in ends:
                if end in self.frames:
                    self.vertices.setdefault(end, self.frames[end])
            label = self.label(edge, "EdgeLabel")
            self.described_too(edge, f"edge from {ends[0]!r} to {ends[1]!r}")
            self.edges.append(labels.as_edge(label, edge.get("id"), *ends, line=edge.line))

    def label(self, element: Element, tag: str) -> str:
        inner = [child for data in element.all("data") for child in data.children]
        found = [each for child in inner for each in child.walk() if each.tag == tag and each.text.strip()]
        if found:
            return "\n".join(labels.plain_text(each.text) for each in found)
        plain = {self.keys.get(data.get("key"), ""): data.text for data in element.all("data") if not data.children}
        return plain.get("label") or plain.get("name") or ""

    def described_too(self, element: Element, where: str) -> None:
        for data in element.all("data"):
            name = self.keys.get(data.get("key"), "")
            if data.text.strip() and not data.children and name not in ("label", "name"):
                self.losses.add(where, data.line, f"its {name or 'data'} is not kept")

    def models(self, name: str) -> list[Model]:
        """Return one model, or one for each outermost group that has a start."""
        # Groups are models only if each holds a start and no edge crosses from one to another.
        starts = [id for id, vertex in self.vertices.items() if vertex.name.lower() == START.lower()]
        groups = list(dict.fromkeys(self.inside[id] for id in starts))
        crossing = any(self.inside.get(edge.source) != self.inside.get(edge.target) for edge in self.edges)
        if len(groups) < 2 or crossing or not set(groups) >= {self.inside[id] for id in self.vertices}:
            return [self.model(name, set(self.vertices))]
        ids = {group: {id for id in self.vertices if self.inside[id] == group} for group in groups}
        return [self.model(self.titles.get(group, name), members) for group, members in ids.items()]

    def model(self, name: str, members: set[str]) -> Model:
        vertices = [vertex for id, vertex in self.vertices.items() if id in members]
        edges = [edge for edge in self.edges if edge.source in members or (edge.source not in self.vertices)]
        actions = tuple(text for vertex in vertices for text in self.initial.get(vertex.id, ()))
        start = ""
        for vertex in vertices:
            around = [edge for edge in edges if vertex.id in (edge.source, edge.target)]
            only = around[0] if len(around) == 1 else None
            is_mark = vertex.name.lower() == START.lower() and only is not None and only.source == vertex.id
            if is_mark and only is not None and not (only.name or only.guard or only.actions or only.blocked):
                # Nothing happens between the mark and the first vertex: it is no state.
                start = only.target
                vertices.remove(vertex)
                edges.remove(only)
                break
        return Model(name, vertices, edges, start, actions, line=vertices[0].line if vertices else 0)

    def wrong(self, element: Element, rule: str) -> BadModel:
        return BadModel(f"{self.origin}:{element.line}", rule, slug="graphml")


def write(cefsm: Cefsm) -> Writing:
    """Return a model as GraphML that yEd draws and GraphWalker walks; several machines are groups of one graph."""
    models, losses = parted(cefsm)
    more = Losses()
    if len(models) > 1:
        what = "GraphWalker reads one graph per file; its machines are groups here, to be cut apart"
        more.add(f"model {cefsm.name!r}", 0, what)
    elif models[0].name != cefsm.name:
        more.add(f"model {cefsm.name!r}", 0, f"its name is that of its only machine, {models[0].name!r}")
    lines = [_HEAD.format(escape(cefsm.name if len(models) > 1 else models[0].name))]
    for number, model in enumerate(models):
        if len(models) == 1:
            lines += _drawn(model, f"s{number}")
        else:
            title = f"<y:GroupNode><y:NodeLabel>{escape(model.name)}</y:NodeLabel></y:GroupNode>"
            lines.append(f'<node id="g{number}" yfiles.foldertype="group"><data key="d1">{title}</data>')
            lines.append(f'<graph edgedefault="directed" id="g{number}:">')
            lines += [*_drawn(model, f"s{number}"), "</graph></node>"]
    return Writing("\n".join([*lines, "</graph>", "</graphml>", ""]), (*losses, *more))


_HEAD = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns" xmlns:y="http://www.yworks.com/xml/graphml" \
xmlns:yed="http://www.yworks.com/xml/yed/3">
<key attr.name="Description" attr.type="string" for="graph" id="d0"/>
<key for="node" id="d1" yfiles.type="nodegraphics"/>
<key for="edge" id="d2" yfiles.type="edgegraphics"/>
<graph edgedefault="directed" id="G">
<data key="d0">{}</data>"""


def _drawn(model: Model, start: str) -> Iterator[str]:
    yield _node(start, START, 0)
    for number, vertex in enumerate(model.vertices, 1):
        initial = model.actions if vertex.id == model.start else ()
        yield _node(vertex.id, labels.vertex_label(vertex, initial), number)
    yield _edge(f"{start}e", start, model.start, "")
    for edge in model.edges:
        yield _edge(edge.id, edge.source, edge.target, labels.edge_label(edge))


def _node(id: str, label: str, number: int) -> str:
    width = 20 + 8 * max(map(len, label.split("\n")))
    place = f'height="40.0" width="{width}.0" x="{number % 6 * 220}.0" y="{number // 6 * 120}.0"'
    shape = f'<y:Geometry {place}/><y:NodeLabel>{escape(label)}</y:NodeLabel><y:Shape type="roundrectangle"/>'
    return f'<node id={quoteattr(id)}><data key="d1"><y:ShapeNode>{shape}</y:ShapeNode></data></node>'


def _edge(id: str, source: str, target: str, label: str) -> str:
    said = f"<y:EdgeLabel>{escape(label)}</y:EdgeLabel>" if label else ""
    drawn = f'<y:PolyLineEdge><y:Arrows source="none" target="standard"/>{said}</y:PolyLineEdge>'
    ends = f"source={quoteattr(source)} target={quoteattr(target)}"
    return f'<edge id={quoteattr(id)} {ends}><data key="d2">{drawn}</data></edge>'
