"""Models to SCXML documents: what both sides can say comes back equal, the rest is a named loss."""

from __future__ import annotations

import random
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model import (
    ENVIRONMENT,
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
)
from parcours.model.expression import Assignment, parse_expression
from parcours.model.formats import read_any
from parcours_formats import scxml

SEEDS = Path(__file__).parents[1] / "fuzz" / "seeds"


def random_chart(source: random.Random) -> Cefsm:
    """Return a random model of what an SCXML document says as it is: one component, spontaneous or outer events."""
    names = ["n", "v", "p", "t"]
    guards = ["n < 3", "n % 2 == 0 && p", "v <= 0.5 || !p", "t == 'a'", "max(n, 2) != 7"]
    values = {
        "n": ["n + 1", "0"],
        "v": ["v / 2", "0.25"],
        "p": ["!p", "n > v"],
        "t": ["'b'", "'it''s'".replace("''", "")],
    }
    several = source.random() < 0.4
    machines, events = [], 0
    for number in range(2 if several else 1):
        states = tuple(f"s{number}_{at}" for at in range(source.randint(2, 4)))
        transitions = []
        for at, state in enumerate(states[:-1]):
            for target in {states[at + 1], source.choice(states)}:
                events += 1
                guard = parse_expression(source.choice(guards)) if source.random() < 0.4 else None
                name = source.choice(names)
                value = parse_expression(source.choice(values[name]))
                actions = (Assignment(name, value),) if source.random() < 0.5 else ()
                sends = (Send("out"),) if source.random() < 0.3 else ()
                event = Receive(f"e{events}")
                transitions.append(Transition(f"{state}:e{events}", state, target, event, guard, actions, sends))
        order = [states[0]]
        for each in order:
            order += [t.target for t in transitions if t.source == each and t.target not in order]
        final = (states[-1],) if not several else ()
        transitions.sort(
            key=lambda each: (order.index(each.source), int(str(each.event.channel)[1:]) if each.event else 0)
        )
        machines.append(
            Machine(f"m{number}" if several else "chart", states[0], tuple(order), tuple(transitions), final)
        )
    variables = (
        Variable("n", "int", 0),
        Variable("v", "real", 1.5),
        Variable("p", "bool", True),
        Variable("t", "text", "a"),
    )
    used = [each for machine in machines for each in machine.transitions]
    channels = []
    for one in used:
        if one.event is not None:
            channels.append(Channel(one.event.channel, ENVIRONMENT, "chart", "Event"))
        if one.sends and all(channel.name != "out" for channel in channels):
            channels.append(Channel("out", "chart", ENVIRONMENT, "Event"))
    component = Component("chart", tuple(machines), variables)
    return Cefsm("chart", (component,), tuple(channels), (MessageClass("Event", ()),))


@given(st.integers(0, 2**32))
@settings(max_examples=80, deadline=None)
def test_what_both_sides_say_comes_back_equal(seed: int) -> None:
    model = random_chart(random.Random(seed))
    writing = scxml.write(model)
    assert scxml.read(writing.text, "chart.scxml").cefsm == model
    assert all("names of their own" in loss.what for loss in writing.losses)


def test_what_a_document_cannot_say_is_a_loss_by_name() -> None:
    said = " ".join(map(str, scxml.write(read_any(SEEDS / "lift.yaml").cefsm).losses))
    for named in (
        "the sentence about the model", "clocks are not written", "its duration of 0.5 to 2.0 s", "its weight 2.0",
        "its range 0 to 3", "is an input", 'the condition "it.floor > floor"', "sends to itself",
        "interaction 'round'", 'its action "ring()"', "is called 'on_the_way' there",
    ):  # fmt: skip
        assert named in said
