"""DOT: graphs of any hand are read as drawn; automata go there and back; hostile files end soon."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel
from parcours.model import (
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    Send,
    StepRelation,
    Transition,
    predicate,
)
from parcours.model.formats import ForeignModel, read_any
from parcours_formats import aut, dot
from parcours_formats.dot.dot_graphs import label_text, parse_dot, quoted

SAMPLES = Path(__file__).parents[2] / "examples" / "formats"
SYMBOLS = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters="/"), min_size=1, max_size=4) | (
    st.sampled_from(
        ["coin", "ACK+PSH(V,V,1)", "a b", '"', "\\", "\\n", "<b>", "i", "tau", "?x", "!x", "e_1", "not", "x[1]"]
    )
)


@st.composite
def automata(draw: st.DrawFn) -> Cefsm:
    """Models whose transitions take an input and give at most one output, as an automaton does."""
    signal, channels, components = MessageClass("Signal", ()), list[Channel](), []
    ids = (f"t{number}" for number in range(100))
    for owner in draw(st.lists(st.sampled_from("ABC"), min_size=1, max_size=2, unique=True)):
        received, sent = (draw(st.lists(SYMBOLS, min_size=1, max_size=3, unique=True)) for _ in range(2))
        first = len(channels)
        channels += [
            Channel(f"r{at + first}", "environment", owner, "Signal", name) for at, name in enumerate(received)
        ]
        channels += [Channel(f"s{at + first}", owner, "environment", "Signal", name) for at, name in enumerate(sent)]
        machines = []
        for name in draw(st.lists(SYMBOLS, min_size=1, max_size=2, unique=True)):
            states = draw(st.lists(SYMBOLS, min_size=1, max_size=4, unique=True))
            transitions = []
            for _ in range(draw(st.integers(1, 5))):
                event = Receive(
                    draw(st.sampled_from([each.name for each in channels[first:] if each.receiver == owner]))
                )
                given = draw(st.sampled_from([None, *(each.name for each in channels[first:] if each.sender == owner)]))
                source, target = draw(st.sampled_from(states)), draw(st.sampled_from(states))
                sends = (Send(given),) if given else ()
                transitions.append(Transition(next(ids), source, target, event, sends=sends))
            final = tuple(state for state in states if draw(st.booleans()))
            machines.append(Machine(name, draw(st.sampled_from(states)), tuple(states), tuple(transitions), final))
        components.append(Component(owner, tuple(machines)))
    return Cefsm("m", tuple(components), tuple(channels), (signal,))


def spoken(model: Cefsm) -> list[object]:
    """The model with the symbol of each channel in place of its name."""
    symbol = {each.name: each.topic or each.name for each in model.channels}
    return [
        (component.name, machine.name, machine.initial, machine.states, machine.final, spoken_edges(machine, symbol))
        for component in model.components
        for machine in component.machines
    ]


def spoken_edges(machine: Machine, symbol: dict[str, str]) -> list[object]:
    heard = [symbol[each.event.channel] if each.event else "" for each in machine.transitions]
    given = [[symbol[send.channel] for send in each.sends] for each in machine.transitions]
    return [
        (each.id, each.source, each.target, taken, sent)
        for each, taken, sent in zip(machine.transitions, heard, given, strict=True)
    ]


@given(automata())
@settings(max_examples=60)
def test_an_automaton_reads_back_equal(model: Cefsm) -> None:
    writing = dot.write(model)
    back = dot.read(writing.text, "m.dot").cefsm
    assert spoken(back) == spoken(model)
    named = " ".join(map(str, writing.losses))
    used = {each.event.channel for component in model.components for each in component.transitions() if each.event}
    used |= {send.channel for component in model.components for each in component.transitions() for send in each.sends}
    assert all(repr(each.name) in named for each in model.channels if each.name not in used)


@given(automata().filter(lambda model: len(model.components) == len(model.components[0].machines) == 1))
@settings(max_examples=40)
def test_an_automaton_goes_through_aut_with_each_output_in_a_step_of_its_own(model: Cefsm) -> None:
    [machine] = model.components[0].machines
    writing = aut.write(model)
    [back] = aut.read(writing.text, "m.aut").cefsm.components[0].machines
    read = aut.read(writing.text, "m.aut").cefsm
    # A quote cannot stand in a label: the name of the channel stands there instead.
    topics = {each.name: each.name if '"' in each.topic else each.topic for each in model.channels}
    heard = {each.name: each.topic or each.name for each in read.channels}
    steps = iter(back.transitions)
    place = {state: str(at) for at, state in enumerate(dict.fromkeys([machine.initial, *machine.states]))}
    assert back.initial == place[machine.initial]
    for each in machine.transitions:
        taken = next(steps)
        assert each.event is not None
        assert taken.event is not None
        assert heard[taken.event.channel] == topics[each.event.channel]
        assert taken.source == place[each.source]
        for send in each.sends:
            between, taken = taken.target, next(steps)
            assert taken.source == between
            assert heard[taken.sends[0].channel] == topics[send.channel]
        assert taken.target == place[each.target]
    assert next(steps, None) is None


def drawn(found: ForeignModel) -> list[str]:
    transitions = [each for component in found.cefsm.components for each in component.transitions()]
    return [f"{each.source} -> {each.target}: {predicate(each)}" for each in transitions]


def test_inputs_come_from_the_environment_and_outputs_go_there() -> None:
    found = dot.read('digraph g { a -> b [label="coin / ok"]; b -> a [label="push/tea"]; b -> b [label=x] }', "g.dot")
    assert drawn(found) == ["a -> b: (coin/-/-/ok())", "b -> a: (push/-/-/tea())", "b -> b: (x/-/-/-)"]
    steps = StepRelation(found.cefsm)
    here = steps.layout.initial()
    for _ in range(2):
        here = steps.step(here, steps.enabled(here, {})[0])
    assert here.states == ("a",)
    assert [move.transition for move in steps.enabled(here, {})] == ["a coin"]


@pytest.mark.parametrize(
    ("text", "initial"),
    [
        ("b -> a; a -> b", "b"),
        ('__start0 [label="" shape=none]; __start0 -> a; b -> a [label=x]', "a"),
        ("hid [shape=point]; b -> a [label=x]; hid -> a", "a"),
        ('"" [label="" style=invis]; "" -> a; b -> a [label=x]', "a"),
        ("a; b", "a"),
    ],
)
def test_the_start_is_marked_or_the_source_of_the_first_edge(text: str, initial: str) -> None:
    machine = dot.read(f"digraph g {{ {text} }}", "g.dot").cefsm.components[0].machines[0]
    assert machine.initial == initial
    assert sorted(machine.states) == ["a", "b"]


def test_parts_with_starts_of_their_own_are_machines_of_their_own() -> None:
    parts = (
        "subgraph cluster0 { s -> a; a -> a [label=x]; s [shape=none] } subgraph cluster1 { t -> b; t [shape=none] }"
    )
    found = dot.read(f"digraph g {{ {parts} b -> c [label=y] }}", "g.dot")
    assert [machine.states for machine in found.cefsm.component("g").machines] == [("a",), ("b", "c")]
    joined = dot.read("digraph g { s [shape=none]; t [shape=none]; s -> a; t -> b; a -> b [label=x] }", "g.dot")
    assert joined.cefsm.component("g").machines[0].initial == "a"
    assert any("the start in 'b' is not kept" in loss.what for loss in joined.losses)


def test_outputs_of_states_are_given_on_entering_them() -> None:
    found = dot.read(
        'digraph g { a [label="s0 / off"]; b [label="s1 / on"]; a -> b [label=up]; b -> a [label=down] }', "g"
    )
    assert drawn(found) == ["s0 -> s1: (up/-/-/on())", "s1 -> s0: (down/-/-/off())"]
    assert any("'off'" in loss.what for loss in found.losses)


def test_labels_of_graphwalker_are_told_by_their_form() -> None:
    text = r"""digraph Login {
      Start -> v_Out [label="e_Init/n=0;"]
      v_Out -> v_In [label="e_Login[n < 3]/n++;"]; v_In -> v_Out [label="e_Logout\nWEIGHT=0.5"];
      v_In -> v_In [label="e_Stay BLOCKED"];
    }"""
    found = dot.read(text, "login.dot")
    assert drawn(found) == [
        "Start -> v_Out: (-/-/n := 0/-)",
        "v_Out -> v_In: (-/[n < 3]/n := n + 1/-)",
        "v_In -> v_Out: (-/-/-/-)",
    ]
    assert found.cefsm.component("Login").machines[0].initial == "Start"


def test_what_graphviz_does_not_draw_is_noted() -> None:
    found = dot.read('digraph g { a [timers="x=2" color=red]; a -> a [label=t modality=MAY] }', "g.dot")
    assert sorted(loss.what for loss in found.losses) == [
        "its attribute 'modality' is not kept",
        "its attribute 'timers' is not kept",
    ]


def test_the_whole_language_is_read() -> None:
    text = """/* c */ // c
    # line
    strict DiGraph "a" + "b" { graph [x=1] node [shape=box]; k = v; edge [label=e, color=red];
      n1:port:ne -> n2:p -> "n 3" [label=<a <b>bold</b> &lt; c>; w=.5]
      subgraph s { n4; n5 [label="two\\nlines \\"q\\""] } -> {n1 -2.5}
      n1 -> n2 [color = blue] { edge [label=inner]; n6 -> n6 } n7 -> n7
    }
    digraph { x }"""
    first, second = parse_dot(text, "here")
    edges = {(edge.source, edge.target): label_text(edge.attributes) for edge in first.edges}
    assert edges == {
        ("n1", "n2"): "a bold < c",
        ("n2", "n 3"): "a bold < c",
        **{(source, target): "e" for source in ("n4", "n5") for target in ("n1", "-2.5")},
        ("n6", "n6"): "inner",
        ("n7", "n7"): "e",
    }
    assert (first.name, first.attributes, second.nodes) == ("ab", {"x": "1", "k": "v"}, {"x": {}})
    assert label_text(first.nodes["n5"]) == 'two\nlines "q"'
    assert first.nodes["n1"]["shape"] == "box"
    assert first.lines["n5"] == 5
    assert first.edges[0].attributes["color"] == "blue"


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=20))
@settings(max_examples=60)
def test_any_text_in_quotes_is_read_as_it_was(text: str) -> None:
    [graph] = parse_dot(f"digraph {{ a [label={quoted(text)}] }}", "here")
    assert label_text(graph.nodes["a"]) == text.strip()


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "g.dot:1: 'digraph' must stand here, but here is the end"),
        ("graph g { a -- b }", "g.dot:1: a graph must be directed"),
        ("digraph g {\na -- b }", "g.dot:2: a graph must be directed, but this edge is not; write ->"),
        ("digraph g {\n\n a -> }", "g.dot:3: a node, an edge or a subgraph must stand here"),
        ("digraph g { a [label=", "a value must stand here, but here is the end"),
        ('digraph g {\n a [label="x\n', "g.dot:2: a text must end with a quote"),
        ("digraph g { a [label=<b", "a text in <> must end"),
        ("digraph g { /* a", "a comment must end"),
        ("digraph g { a ? b }", r"but here is '\? b }'"),
        ("digraph g {}", "must have a node"),
        ("digraph g { a -> b } tail", "'digraph' must stand here, but here is 'tail'"),
        ('digraph g { a + "b" }', r"must stand here, but here is '\+ \"b\""),
        ("digraph " + "{" * 100_000, "subgraphs nest at most 50 deep"),
        ('digraph g { a -> b [label="e_x[send()]"] }', "guard of 'e_x'.*'send'"),
    ],
)
def test_what_is_no_graph_is_refused_with_its_line(text: str, rule: str) -> None:
    with pytest.raises(BadModel, match=rule):
        dot.read(text, "g.dot")


def test_large_and_hostile_graphs_end_soon() -> None:
    crowd = " ".join(f"a{at}" for at in range(3000))
    started = time.process_time()
    for text in (
        "digraph { {" + crowd + "} -> {" + crowd.replace("a", "b") + "} }",
        'digraph { a [label="' + '\\"' * 2_000_000,
        "digraph { a [label=" + "<" * 2_000_000,
        "digraph { /*" + "* /" * 1_000_000,
        "#" * 20_000_000,
    ):
        with pytest.raises(BadModel):
            dot.read(text, "g.dot")
    assert time.process_time() - started < 10


def test_the_sample_is_a_machine_of_inputs_and_outputs() -> None:
    found = read_any(SAMPLES / "turnstile.dot")
    assert len(found.cefsm.component("turnstile").machines[0].transitions) == 5
    assert not found.losses
