"""Models to UPPAAL files: what both sides can say comes back equal, the rest does the same or is a named loss."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model import (
    ENVIRONMENT,
    Cefsm,
    Channel,
    Component,
    Configuration,
    Machine,
    MessageClass,
    Receive,
    Send,
    StepRelation,
    Transition,
    Variable,
    findings,
    parse_model,
)
from parcours.model.expression import Assignment, parse_expression
from parcours.model.structure import CLOCK
from parcours_formats import uppaal

GUARDS = ("{n} < 3", "{p} && {n} % 2 == 0", "!{p} || {n} != 4", "max({n}, 2) > abs({n}) - 1", "floor({n} / 2) == 1")
VALUES = ("{n} + 1", "min({n}, 3) * 2 % 5", "0", "7")


def same_both_sides(source: random.Random) -> Cefsm:
    """Return a random model of what a UPPAAL file says as it is: rendezvous, ranges, clocks, invariants, urgency."""
    names = ["A", "B", "C"][: source.randint(1, 3)]
    channels = []
    for number in range(source.randint(0, 4)):
        ends = source.sample([*names, ENVIRONMENT], 2)
        channels.append(Channel(f"c{number}", ends[0], ends[1], "Signal", capacity=0))
    components = []
    for name in names:
        words = {"n": f"n_{name}", "p": f"p_{name}", "x": f"x_{name}"}
        states = tuple(f"s{at}" for at in range(source.randint(1, 4)))
        urgent = source.choice(states) if source.random() < 0.3 else ""
        transitions = []
        for number in range(source.randint(1, 6)):
            guards = [source.choice(GUARDS).format(**words)] * source.randrange(2)
            guards += [f"{words['x']} {source.choice(['<', '<=', '>='])} {source.randrange(1, 9)}"] * source.randrange(
                2
            )
            received = [each for each in channels if each.receiver == name]
            sent = [each for each in channels if each.sender == name]
            event, sends = None, tuple[Send, ...]()
            if received and source.random() < 0.4:
                event = Receive(source.choice(received).name)
            elif sent and source.random() < 0.6:
                sends = (Send(source.choice(sent).name),)
            actions = [
                Assignment(words["n"], parse_expression(source.choice(VALUES).format(**words)))
            ] * source.randrange(2)
            actions += [Assignment(words["x"], parse_expression(str(source.randrange(3))))] * source.randrange(2)
            origin = source.choice(states)
            transitions.append(
                Transition(
                    f"{name.lower()}{number}",
                    origin,
                    source.choice(states),
                    event,
                    parse_expression(" && ".join(f"({each})" for each in guards)) if guards else None,
                    tuple(actions),
                    sends,
                    (0.0, 0.0) if origin == urgent else None,
                )
            )
        invariants = tuple(
            (state, parse_expression(f"{words['x']} <= {source.randrange(1, 20)}"))
            for state in states
            if source.random() < 0.3
        )
        machine = Machine(name, states[0], states, tuple(transitions), invariants=invariants)
        variables = (
            Variable(words["n"], "int", 1, domain=range(8)),
            Variable(words["p"], "bool", source.random() < 0.5),
            Variable(words["x"], CLOCK, None, unit="s"),
        )
        components.append(Component(name, (machine,), variables))
    heard = {each.event.channel for part in components for each in part.transitions() if each.event}
    said = {send.channel for part in components for each in part.transitions() for send in each.sends}
    met = [
        each
        for each in channels
        if {ENVIRONMENT if each.receiver == ENVIRONMENT else "", each.name} & {ENVIRONMENT, *heard}
        and {ENVIRONMENT if each.sender == ENVIRONMENT else "", each.name} & {ENVIRONMENT, *said}
        and each.name in heard | said
    ]
    kept = {each.name for each in met}
    components = [_without(part, kept) for part in components]
    messages = (MessageClass("Signal", ()),) if kept else ()
    return Cefsm("net", tuple(components), tuple(met), messages)


def _without(component: Component, kept: set[str]) -> Component:
    [machine] = component.machines
    transitions = [
        each
        for each in machine.transitions
        if all(send.channel in kept for send in each.sends) and (each.event is None or each.event.channel in kept)
    ]
    urgent = {each.source for each in transitions if each.duration}
    machine = Machine(machine.name, machine.initial, machine.states, tuple(transitions), (), machine.invariants)
    assert all(each.duration for each in transitions if each.source in urgent)
    return Component(component.name, (machine,), component.variables)


@given(st.integers(0, 2**32))
@settings(max_examples=120, deadline=None)
def test_what_both_sides_say_comes_back_equal(seed: int) -> None:
    model = same_both_sides(random.Random(seed))
    assert not [each for each in findings(model) if each.severity == "error"]
    writing = uppaal.write(model)
    back = uppaal.read(writing.text, "net.xml")
    assert back.cefsm == model
    assert writing.losses == ()


QUEUE = """
parcours: model/1
name: belt
messages: {Part: {fields: {size: {type: int}, good: {type: bool}}}}
channels: {belt: {from: Press, to: Oven, message: Part, capacity: 2}}
components:
  Press:
    variables: {made: {type: int, initial: 0, range: [0, 5]}}
    machines:
      Press:
        initial: on
        transitions:
          p1: {from: on, to: on, guard: made < 5, action: made := made + 1, message: "belt(made, made != 3)"}
  Oven:
    variables: {last: {type: int, initial: 0, range: [0, 5]}, waste: {type: int, initial: 0, range: [0, 5]}}
    machines:
      Oven:
        initial: on
        transitions:
          o1: {from: on, to: on, event: belt(part), guard: part.good, action: last := part.size}
          o2: {from: on, to: on, event: belt(part), guard: "!part.good", action: waste := part.size}
"""


def reachable(cefsm: Cefsm, names: tuple[str, ...]) -> set[tuple[object, ...]]:
    """Return the values that the named variables have together, over everything a model can do."""
    steps = StepRelation(cefsm)
    order = [variable.name for _, variable in steps.layout.variables]
    seen: set[Configuration] = {steps.layout.initial()}
    border = list(seen)
    while border:
        here = border.pop()
        for move in steps.enabled(here, {}):
            after = steps.step(here, move)
            if after not in seen:
                seen.add(after)
                border.append(after)
    return {tuple(dict(zip(order, each.values, strict=True))[name] for name in names) for each in seen}


def test_a_queue_is_written_as_arrays_that_do_the_same() -> None:
    model = parse_model(QUEUE)
    back = uppaal.read(uppaal.write(model).text, "belt.xml").cefsm
    assert {machine.name for part in back.components for machine in part.machines} == {"Press", "Oven"}
    names = ("made", "last", "waste")
    assert reachable(back, names) == reachable(model, names)


def test_an_input_is_selected_at_each_edge_that_reads_it() -> None:
    model = parse_model(
        "{parcours: model/1, name: lamp, components: {Lamp: {variables: {level: {type: int, role: input, range: [0, 2]}"
        ", seen: {type: int, initial: 0, range: [0, 9]}}, machines: {Lamp: {initial: s, transitions: {"
        " t: {from: s, to: s, guard: level > 0, action: seen := level}}}}}}}"
    )
    writing = uppaal.write(model)
    assert '<label kind="select">level : int[0,2]</label>' in writing.text
    assert reachable(uppaal.read(writing.text, "lamp.xml").cefsm, ("seen",)) == reachable(model, ("seen",))


def test_times_are_whole_units_and_durations_are_a_clock() -> None:
    model = parse_model(
        "{parcours: model/1, name: m, components: {A: {variables: {x: {type: clock}}, machines: {A: {initial: s,"
        " invariants: {s: x <= 0.25}, transitions: {t: {from: s, to: s, guard: x > 0.1, duration: [0.005, 0.05]}}}}}}}"
    )
    writing = uppaal.write(model)
    assert (
        "x &lt;= 250" in writing.text
        and "since_A &gt;= 5 &amp;&amp; since_A &lt;= 50 &amp;&amp; x &gt; 100" in writing.text
    )
    said = [str(loss) for loss in writing.losses]
    assert "model: the unit of time is 1/1000 s there" in said
    assert any("its duration is written as a guard on the clock 'since_A'" in each for each in said)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("guard: sqrt(n) > 1", 'its guard "sqrt(n) > 1" is not written: it has no function'),
        ("guard: n / 2 > 1", "is not written: it divides whole numbers only"),
        ("action: ring(n)", 'its action "ring(n)" is not written'),
        ("weight: 3", "its weight 3.0 is not written"),
    ],
)
def test_what_uppaal_cannot_say_is_a_loss_by_name(change: str, named: str) -> None:
    model = parse_model(
        "{parcours: model/1, name: m, doc: a sentence, components: {A: {variables: {n: {type: int, initial: 0,"
        f" range: [0, 9]}}}}, machines: {{A: {{initial: s, transitions: {{t: {{from: s, to: s, {change}}}}}}}}}}}}}}}"
    )
    losses = [str(loss) for loss in uppaal.write(model).losses]
    assert any(named in loss for loss in losses) and any("the sentence about the model" in loss for loss in losses)


def test_names_that_uppaal_cannot_take_are_changed_and_said() -> None:
    model = parse_model(
        "{parcours: model/1, name: m, components: {clock: {variables: {chan: {type: bool, initial: true}}, machines:"
        " {clock: {initial: on the way, transitions: {go on: {from: on the way, to: on the way, guard: chan}}}}}}}"
    )
    writing = uppaal.write(model)
    back = uppaal.read(writing.text, "m.xml").cefsm
    assert [each.name for each in back.components] == ["clock_2"] and back.components[0].variables[0].name == "chan_2"
    assert {loss.where for loss in writing.losses} >= {"machine 'clock'", "state 'on the way'", "transition 'go on'"}
