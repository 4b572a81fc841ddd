"""GraphWalker's JSON: what its models mean here, what is noted as lost, and what is refused."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadModel
from parcours.model import StepRelation, parse_model, predicate
from parcours.model.documents import Mapping
from parcours.model.formats import ForeignModel, read_any, write_as
from parcours.paths import cover, measure, requirements
from parcours.paths.solving import solve
from parcours.paths.walking import ModelSpace, Walk, phase
from parcours_formats.graphwalker import read
from parcours_formats.graphwalker.graphwalker_json import MAX_DEPTH, parse_json

SAMPLES = Path(__file__).parents[2] / "examples" / "formats"


def vertices(*names: str, **shared: str) -> list[dict[str, object]]:
    states = {name: {"sharedState": state} for name, state in shared.items()}
    return [{"id": name, "name": name, **states.get(name, {})} for name in names]


def edge(name: str, source: str, target: str, guard: str = "", *actions: str, **more: object) -> dict[str, object]:
    said = {"id": f"id of {name}", "name": name, "targetVertexId": target, **more}
    said |= {"sourceVertexId": source} if source else {}
    said |= {"guard": guard} if guard else {}
    return said | ({"actions": actions} if actions else {})


def model(name: str, places: list[dict[str, object]], *edges: dict[str, object], **more: object) -> dict[str, object]:
    return {"name": name, "generator": "random(edge_coverage(100))", "vertices": places, "edges": edges, **more}


def reading(*models: dict[str, object]) -> ForeignModel:
    return read(json.dumps({"models": models}), "shop.json")


def drawn(found: ForeignModel) -> list[str]:
    transitions = [each for component in found.cefsm.components for each in component.transitions()]
    return [f"{each.source} -> {each.target}: {each.id} {predicate(each)}" for each in transitions]


def lost(found: ForeignModel, *said: str) -> bool:
    return any(all(part in str(loss) for part in said) for loss in found.losses)


def test_a_walk_starts_at_the_vertex_named_as_start() -> None:
    found = reading(model("m", vertices("a", "b"), edge("e", "a", "b"), startElementId="b"))
    assert found.cefsm.component("m").machines[0].initial == "b"


def test_an_edge_without_source_leaves_a_state_of_its_own_once() -> None:
    found = reading(model("m", vertices("a"), edge("e_Init", "", "a", "", "n = 1;"), edge("e", "a", "a", "n > 0")))
    assert drawn(found) == ["Start -> a: e_Init (-/-/n := 1/-)", "a -> a: e (-/[n > 0]/-/-)"]
    assert found.cefsm.component("m").machines[0].initial == "Start"
    assert lost(found, "'n'", "starts as 0")


def test_a_start_edge_that_is_also_a_loop_is_taken_first_and_may_be_taken_again() -> None:
    found = reading(model("m", vertices("a"), edge("e", "a", "a"), startElementId="id of e"))
    assert drawn(found) == ["Start -> a: e (-/-/-/-)", "a -> a: e_2 (-/-/-/-)"]


def test_a_start_edge_from_a_place_of_its_own_starts_there() -> None:
    found = reading(
        model("m", vertices("Start", "a"), edge("e", "Start", "a"), edge("f", "a", "a"), startElementId="id of e")
    )
    assert found.cefsm.component("m").machines[0].initial == "Start"
    assert len(drawn(found)) == 2


def test_shared_states_make_one_walk_of_several_models() -> None:
    shop = model("Shop", vertices("home", "cart", cart="CART"), edge("add", "home", "cart"), startElementId="home")
    pay = model(
        "Pay", vertices("basket", "paid", basket="CART"), edge("pay", "basket", "paid", "", "n = 2"), actions=["n = 1"]
    )
    found = reading(shop, pay)
    [component] = found.cefsm.components
    [machine] = component.machines
    assert machine.initial == "Shop/home"
    assert machine.states == ("Shop/home", "Shop/cart", "Pay/basket", "Pay/paid")
    jumps = [(each.source, each.target) for each in machine.transitions if each.id.startswith("CART")]
    assert jumps == [("Shop/cart", "Pay/basket"), ("Pay/basket", "Shop/cart")]
    steps = StepRelation(found.cefsm)
    here = steps.layout.initial()
    for _ in range(3):
        here = steps.step(here, next(each for each in steps.enabled(here, {}) if "to Shop" not in each.transition))
    assert (here.states, here.values) == (("Pay/paid",), (2,))


def test_models_without_a_shared_state_walk_side_by_side_and_share_what_is_global() -> None:
    one = model(
        "One",
        vertices("a"),
        edge("e1", "a", "a", "", "global.n = global.n + 1;", "x = 1"),
        actions=["global.n = 0; x = 0"],
    )
    two = model("Two", vertices("b"), edge("e2", "b", "b", "global.n > 2 && x > 0"), actions=["x = 5;"])
    three = model("Three", vertices("c"), edge("e3", "c", "c"))
    found = reading(one, two, three)
    assert [(each.name, len(each.machines)) for each in found.cefsm.components] == [("One", 2), ("Three", 1)]
    variables = found.cefsm.component("One").variables
    assert [(each.name, each.initial) for each in variables] == [("n", 0), ("x", 0), ("x_2", 5)]
    assert drawn(found)[1].endswith("(-/[n > 2 && x_2 > 0]/-/-)")
    assert lost(found, "'x'", "'x_2'")


def test_actions_of_a_vertex_are_done_on_every_way_into_it() -> None:
    places = vertices("a", "b")
    places[1]["actions"] = ["n++;"]
    found = reading(model("m", places, edge("e", "a", "b", "", "n = 3"), edge("f", "b", "b"), actions=["n = 0"]))
    assert [line.partition(" (")[2] for line in drawn(found)] == ["-/-/n := 3; n := n + 1/-)", "-/-/n := n + 1/-)"]


def test_types_are_those_of_the_first_values() -> None:
    acts = "i = 1; r = 0.5; w = 1; b = true; t = 'low'; u = 'x'"
    later = edge("e", "a", "a", "t == 'high' && b", "w = w / 2; t = 'high'", "u = t")
    found = reading(model("m", vertices("a"), later, actions=[acts]))
    kinds = {each.name: each.type for each in found.cefsm.component("m").variables}
    assert kinds == {"i": "int", "r": "real", "w": "real", "b": "bool", "t": "text", "u": "text"}


def test_a_text_with_constant_values_only_is_an_enumeration() -> None:
    found = reading(
        model("m", vertices("a"), edge("e", "a", "a", "mode != 'off'", "mode = 'on'"), actions=["mode = 'off'"])
    )
    [mode] = found.cefsm.component("m").variables
    assert (mode.type, mode.initial, set(mode.domain)) == ("enum", "off", {"off", "on"})


def test_a_variable_that_nothing_sets_is_an_input() -> None:
    found = reading(model("m", vertices("a"), edge("e", "a", "a", "isDone == false && n > 2 && ready")))
    assert {(each.name, each.type, each.role) for each in found.cefsm.component("m").variables} == {
        ("isDone", "bool", "input"),
        ("n", "int", "input"),
        ("ready", "bool", "input"),
    }
    assert lost(found, "isDone", "input")


def test_weights_are_shares_of_what_leaves_a_vertex() -> None:
    edges = (edge("e", "a", "a", weight=0.5), edge("f", "a", "a"), edge("g", "a", "a"), edge("h", "b", "b"))
    found = reading(model("m", vertices("a", "b"), *edges, startElementId="a"))
    assert [each.weight for each in found.cefsm.component("m").transitions()] == [0.5, 0.25, 0.25, 1.0]


def test_everything_that_has_no_place_here_is_noted() -> None:
    places = vertices("a", "b", "c")
    places[0] |= {"requirements": ["R1", "R2"], "properties": {"x": 1, "description": "home"}}
    places[2]["properties"] = {"blocked": True}
    edges = (edge("e", "a", "b", dependency=80), edge("e", "b", "a"), edge("gone", "a", "c"))
    found = reading(
        model("m", places, *edges, startElementId="a", predefinedPathEdgeIds=["id of e"], requirements=["R0"])
    )
    for said in ("description", "dependency 80", "'e_2'", "predefined path is not kept: e", "R0"):
        assert lost(found, said), said
    assert lost(found, "'c'", "blocked")
    assert lost(found, "random(edge_coverage(100))", "--generator")
    assert len(drawn(found)) == 2
    assert not lost(found, "'x'")


def test_requirements_are_tags_that_can_be_covered_and_measured() -> None:
    places = vertices("a", "b", "c")
    places[1] |= {"requirements": ["UC 1", "UC 2"]}
    edges = (
        edge("e", "a", "b", requirements=["UC 2"]),
        edge("f", "a", "c"),
        edge("g", "c", "a", requirements=["UC 3"]),
    )
    cefsm = reading(model("m", places, *edges, startElementId="a")).cefsm
    (machine,) = cefsm.component("m").machines
    assert machine.tags == (("b", "UC 1"), ("b", "UC 2")) and machine.transitions[0].tags == ("UC 2",)
    assert [str(each) for each in requirements(machine, "tag")] == ["UC 1: b", "UC 2: b", "UC 2: e", "UC 3: g"]
    assert [str(each) for each in measure(cefsm, "tag", ["f", "g"]).met] == ["UC 3: g"]
    assert [path.ids for path in cover(machine, "tag")] == [("f", "g", "e")]
    assert [path.ids for path in solve(cefsm, "m", "m", "tag").paths] == [("f", "g", "e")]
    walk = Walk(ModelSpace(cefsm), [phase("guided", "tag>=100%")], np.random.default_rng(1))
    assert [str(step.move) for step in walk][-3:] == ["f", "g", "e"] or walk.tallies.of["tag"].met == 4
    (written,) = parse_model(write_as(cefsm, "native").text).components
    assert written.machines[0].tags == machine.tags and written.machines[0].transitions[0].tags == ("UC 2",)
    again = read(write_as(cefsm, "graphwalker").text, "m.json").cefsm.component("m").machines[0]
    assert again.tags == machine.tags and [each.tags for each in again.transitions] == [("UC 2",), (), ("UC 3",)]


def test_names_may_be_used_twice_or_not_at_all() -> None:
    places: list[dict[str, object]] = [{"id": "1", "name": "v"}, {"id": "2", "name": "v"}, {"id": "3"}]
    found = reading(model("m", places, {"id": "9", "sourceVertexId": "1", "targetVertexId": "3"}, startElementId="1"))
    assert found.cefsm.component("m").machines[0].states == ("v", "v_2", "3")
    assert drawn(found) == ["v -> 3: v to 3 (-/-/-/-)"]


def test_comments_are_left_out_but_not_in_strings_and_lines_stay_right() -> None:
    text = '/* head "\n * // */ // more\n{"models": [{"vertices": [{"id": "a /* b */ // c"}],\n'
    text += '"edges": [{"id": "e", "targetVertexId": "z"}]}]}'
    with pytest.raises(BadModel, match=r"m.json:4: an edge must join vertices of its model, but 'e' has 'z'"):
        read(text, "m.json")


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "m.json:1: a value must stand in JSON, but here is the end of the file"),
        ("[1,]", "a value must stand in JSON"),
        ('{"a" 1}', "a colon must stand"),
        ('{"models": []}', "must have a model"),
        ('{"name": "x"}', "must have the key 'models'"),
        ('{"models": 3}', "must be a list"),
        ('{"models": [7]}', "a model must be an object"),
        ('{"a": 1,\n"a": 2}', "m.json:2: an object has each key once, but 'a' was used in line 1"),
        ('{"a": NaN}', "but here is 'NaN}'"),
        ('{"a": Infinity}', "but here is 'Infinity}'"),
        ('{"a": "x\ny', "m.json:1: a string must end with a quote"),
        ('{} {"b": 1}', "a file holds one value"),
        ('{"a": "\\ud800"}', "whole characters"),
        ("/* x", "a comment must end"),
        ('{"models": ' * 1000, f"JSON nests at most {MAX_DEPTH} deep"),
        ("[" * 1_000_000, f"JSON nests at most {MAX_DEPTH} deep"),
        (json.dumps({"models": [model("m", [])]}), "must have a vertex"),
        (json.dumps({"models": [model("m", vertices("a", "a"))]}), "an id of its own"),
        (
            json.dumps({"models": [model("m", vertices("a"), edge("e", "a", "a", weight=-1))]}),
            "'weight' must be a number",
        ),
        (json.dumps({"models": [model("m", vertices("a"), edge("e", "a", "a", "send(x)"))]}), "guard of 'e'.*'send'"),
        (
            json.dumps({"models": [model("m", vertices("a"), edge("e", "a", "a", "", "x = [1]"))]}),
            "actions of 'e'.*list",
        ),
        (json.dumps({"models": [model("m", vertices("a"), edge("e", "a", "a", "", "x = 1; x = 'a'"))]}), "one type"),
        (json.dumps({"models": [model("m", vertices("a"), edge("e", "a", "a", "x == y"))]}), "must have a type"),
    ],
)
def test_what_is_no_model_is_refused_with_its_line(text: str, rule: str) -> None:
    with pytest.raises(BadModel, match=rule):
        read(text, "m.json")


def test_large_and_hostile_files_end_soon() -> None:
    many = [dict(each, sharedState="S") for each in vertices(*(f"v{at}" for at in range(400)))]
    crowd = json.dumps(
        {"models": [model(name, [dict(each, id=name + str(each["id"])) for each in many]) for name in "AB"]}
    )
    started = time.process_time()
    for text in ("/*" + "*" * 3_000_000, '"' + "\\" * 3_000_000, " " * 20_000_000, "/* */" * 600_000, crowd):
        with pytest.raises(BadModel):
            read(text, "m.json")
    assert time.process_time() - started < 10


def test_the_sample_reads_without_refusal() -> None:
    found = read_any(SAMPLES / "ticket_machine.json")
    assert [each.name for each in found.cefsm.components] == ["Sale"]
    assert len(found.cefsm.component("Sale").machines[0].transitions) == 11


def test_a_tree_knows_the_line_of_every_value() -> None:
    node = parse_json('{\n"a": [1,\n2], // x\n"b": {}\n}', "here")
    assert isinstance(node, Mapping)
    assert [(key.line, value.line) for key, value in node.items] == [(2, 2), (4, 4)]
