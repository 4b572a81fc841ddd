"""yEd's GraphML: labels, starts, groups, plain GraphML, and what is refused."""

from __future__ import annotations

import time
from pathlib import Path
from xml.sax.saxutils import escape

import pytest

from parcours.errors import BadModel
from parcours.model import predicate
from parcours.model.formats import ForeignModel, read_any
from parcours_formats import graphml
from parcours_formats.graphwalker.labels import LabelledEdge, Vertex, as_edge, as_vertex, edge_label, vertex_label

SAMPLES = Path(__file__).parents[2] / "examples" / "formats"
HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns" xmlns:y="http://www.yworks.com/xml/graphml">
<key attr.name="description" for="node" id="d1"/><key attr.name="Description" for="graph" id="d2"/>"""


def node(id: str, *labels: str, shape: str = "ShapeNode") -> str:
    said = "".join(
        f"<y:NodeLabel>{escape(label)}<y:LabelModel>\n <y:Smart/></y:LabelModel></y:NodeLabel>" for label in labels
    )
    return f'<node id="{id}"><data key="g"><y:{shape}><y:Geometry x="1"/>{said}</y:{shape}></data></node>\n'


def edge(source: str, target: str, label: str = "") -> str:
    said = f"<y:EdgeLabel>{escape(label)}<y:LabelModel/></y:EdgeLabel>"
    data = f'<data key="e"><y:PolyLineEdge>{said}</y:PolyLineEdge></data>'
    return f'<edge source="{source}" target="{target}">{data}</edge>\n'


def reading(*parts: str) -> ForeignModel:
    return graphml.read(
        f'{HEAD}<graph edgedefault="directed" id="G">{"".join(parts)}</graph></graphml>', "walk.graphml"
    )


def drawn(found: ForeignModel) -> list[str]:
    transitions = [each for component in found.cefsm.components for each in component.transitions()]
    return [f"{each.source} -> {each.target}: {each.id} {predicate(each)}" for each in transitions]


def test_labels_of_any_node_are_read_with_what_they_say() -> None:
    found = reading(
        node("n0", "Start"),
        node("n1", "", "v_Out\nINIT: n = 0; b = true;\nREQTAG=UC 1, UC 2", shape="GenericNode"),
        node("n2", "<html>v_<b>In</b><br>SHARED:X</html>", shape="UMLClassNode"),
        node("n3", "v_Off\nBLOCKED"),
        edge("n0", "n1"),
        edge("n1", "n2", "e_Go [n <3 && b]\n / n++; // more"),
        edge("n2", "n1", "e_Back\nweight = 0.5"),
        edge("n2", "n3", "e_Off"),
    )
    assert drawn(found) == ["v_Out -> v_In: e_Go (-/[n < 3 && b]/n := n + 1/-)", "v_In -> v_Out: e_Back (-/-/-/-)"]
    assert found.cefsm.components[0].machines[0].initial == "v_Out"
    said = "\n".join(map(str, found.losses))
    assert found.cefsm.components[0].machines[0].tags == (("v_Out", "UC 1"), ("v_Out", "UC 2"))
    for each in ("'X'", "'v_Off'"):
        assert each in said


def test_a_start_whose_edge_does_something_is_a_state() -> None:
    found = reading(node("n0", "start"), node("n1", "v"), edge("n0", "n1", "e_Init/n = 1;"), edge("n1", "n1", "e[n>0]"))
    assert drawn(found)[0] == "start -> v: e_Init (-/-/n := 1/-)"
    assert found.cefsm.components[0].machines[0].initial == "start"


def test_groups_are_flattened_unless_each_has_a_start() -> None:
    inner = '<node id="g"><data key="x"><y:GroupNode><y:NodeLabel>{}</y:NodeLabel></y:GroupNode></data>'
    inner += '<graph edgedefault="directed">{}</graph></node>'
    one = node("a", "Start") + node("b", "v_b") + edge("a", "b")
    found = reading(
        inner.format("box", node("b", "v_b") + node("c", "v_c")),
        node("a", "Start"),
        edge("a", "b"),
        edge("b", "c", "e"),
    )
    assert drawn(found) == ["v_b -> v_c: e (-/-/-/-)"]
    two = one.replace('"a"', '"a2"').replace('"b"', '"b2"')
    found = reading(inner.format("First", one), inner.replace('"g"', '"g2"').format("Second", two))
    assert [(each.name, each.machines[0].states) for each in found.cefsm.components] == [
        ("First", ("v_b",)),
        ("Second", ("v_b",)),
    ]


def test_plain_graphml_is_read_by_ids_or_by_labels_as_data() -> None:
    text = """<graphml><key id="k" for="all" attr.name="label"/><graph edgedefault="directed">
    <node id="a"><data key="k">idle</data></node><node id="b"/>
    <edge source="a" target="b"><data key="k">go</data></edge><edge source="b" target="a"/></graph></graphml>"""
    assert drawn(graphml.read(text, "p.graphml")) == ["idle -> b: go (-/-/-/-)", "b -> idle: b to idle (-/-/-/-)"]


def test_descriptions_are_noted_as_lost() -> None:
    found = reading('<node id="a"><data key="d1">what it is</data></node>')
    assert [loss.what for loss in found.losses if "'a'" in loss.where] == ["its description is not kept"]


@pytest.mark.parametrize(
    ("label", "name", "guard", "actions", "weight"),
    [
        ("", "", "", (), 0.0),
        ("e", "e", "", (), 0.0),
        ("e[a[b] == ']']", "e", "a[b] == ']'", (), 0.0),
        ("[x > 1]", "", "x > 1", (), 0.0),
        ("e/x = 4 / 2; y = '/';", "e", "", ("x = 4 / 2; y = '/';",), 0.0),
        ("e /* no [x] */ [y] // z\n/ q++;", "e", "y", ("q++;",), 0.0),
        ("e WEIGHT=.25 [x]", "e", "x", (), 0.25),
        ("e\nDEPENDENCY=3\nREQTAG:A,B", "e", "", (), 0.0),
        ("e[x == 'WEIGHT=9']", "e", "x == 'WEIGHT=9'", (), 0.0),
        ("e[x /* open", "e", "x /* open", (), 0.0),
        ("e Weight =100\n\t", "e", "", (), 100.0),
    ],
)
def test_the_label_of_an_edge(label: str, name: str, guard: str, actions: tuple[str, ...], weight: float) -> None:
    read = as_edge(label, "e", "a", "b")
    assert (read.name, read.guard, read.actions, read.weight) == (name, guard, actions, weight)


def test_labels_that_are_written_read_back() -> None:
    vertex = Vertex("v", "v_Name", "STATE")
    assert as_vertex(vertex_label(vertex, ("n = 0;",)), "v") == (vertex, ("n = 0;",))
    said = LabelledEdge("e", "e_Name", "a", "b", "n < 'x]'", ("n = n / 2;",), weight=1e-7)
    assert as_edge(edge_label(said), "e", "a", "b") == said


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "must be XML"),
        ("<a/>", "walk:1: a GraphML file must be a <graphml> with a <graph>"),
        ("<graphml/>", "must be a <graphml> with a <graph>"),
        ('<graphml><graph edgedefault="undirected"/></graphml>', "walk:1: a graph must be directed"),
        ('<graphml>\n<graph><edge directed="false"/></graph></graphml>', "walk:2: an edge must be directed"),
        ("<graphml><graph/></graphml>", "must have a vertex"),
        ('<graphml><graph><node id="a"/><node id="a"/></graph></graphml>', "an id of its own"),
        ('<graphml><graph><node id="a"/>\n<edge source="a" target="z"/></graph></graphml>', "walk:2: .*'z'"),
        ('<!DOCTYPE g [<!ENTITY a "b">]><graphml/>', "declares no entities"),
        ("<graphml>" + "<graph>" * 200, "nests at most"),
    ],
)
def test_what_is_no_graph_is_refused_with_its_line(text: str, rule: str) -> None:
    with pytest.raises(BadModel, match=rule):
        graphml.read(text, "walk")


def test_hostile_labels_end_soon() -> None:
    started = time.process_time()
    for label in (
        "e" + "/*" * 300_000,
        "e" + "[" * 500_000,
        "e" + "/**/ INIT:" * 60_000,
        "e'" + "\\'" * 300_000,
        "[" * 9 + "x" * 500_000,
    ):
        try:
            reading(node("a", "v"), edge("a", "a", label))
        except BadModel as error:
            assert len(str(error)) < 2000
    assert time.process_time() - started < 10


def test_the_sample_reads_with_what_it_says() -> None:
    found = read_any(SAMPLES / "door.graphml")
    assert len(drawn(found)) == 4
    assert [each.name for each in found.cefsm.component("door").variables] == ["tries"]
