"""SCXML takes the first transition that may go, at once if it waits for nothing: a model's choices survive that."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
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
    Transition,
    Variable,
    predicate,
)
from parcours.model.expression import Assignment, parse_expression
from parcours.model.formats import ForeignModel, read_any
from parcours_formats import scxml
from parcours_formats.scxml.chart import ID, OWN, SILENT

ROOT = Path(__file__).parents[2]
HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" name="chart">\n'
NEVER = "can never be taken; left out"


def ids(cefsm: Cefsm) -> list[str]:
    return sorted(each.id for part in cefsm.components for each in part.transitions())


def again(cefsm: Cefsm) -> ForeignModel:
    return scxml.read(scxml.write(cefsm).text, "again.scxml")


def model(*transitions: Transition, variables: tuple[Variable, ...] = ()) -> Cefsm:
    states = tuple(dict.fromkeys(state for each in transitions for state in (each.source, each.target)))
    events = dict.fromkeys(each.event.channel for each in transitions if each.event)
    channels = tuple(Channel(event, ENVIRONMENT, "chart", "Event") for event in events)
    component = Component("chart", (Machine("chart", states[0], states, transitions),), variables)
    return Cefsm("chart", (component,), channels, (MessageClass("Event", ()),))


@pytest.mark.parametrize(
    ("file", "count"), [("examples/formats/ticket_machine.json", 11), ("src/parcours_ramp/components/model.yaml", 37)]
)
def test_every_transition_comes_back_under_its_name(file: str, count: int) -> None:
    before = read_any(ROOT / file).cefsm
    back = again(before)
    assert len(ids(before)) == count and ids(back.cefsm) == ids(before)
    silent = {each.id for part in before.components for each in part.transitions() if each.event is None}
    assert silent == {each.id for part in back.cefsm.components for each in part.transitions() if each.event is None}
    assert all(NEVER not in loss.what for loss in back.losses)


def test_a_choice_between_transitions_without_events_stays_one() -> None:
    before = model(
        Transition("left", "a", "b"), Transition("right", "a", "a"), Transition("go", "a", "a", Receive("e"))
    )
    writing = scxml.write(before)
    assert writing.text.count(f'parcours:{SILENT}="true"') == 2 and f'xmlns:parcours="{OWN}"' in writing.text
    assert [str(loss) for loss in writing.losses] == [
        "transition 'left': waits for the event 'left' there; only Parcours reads it as a transition without event",
        "transition 'right': waits for the event 'right' there; only Parcours reads it as a transition without event",
    ]
    assert set(again(before).cefsm.components[0].transitions()) == set(before.components[0].transitions())


def test_the_only_way_out_of_a_state_needs_no_event_but_a_loop_does() -> None:
    before = model(Transition("on", "a", "b"), Transition("loop", "b", "b"))
    text = scxml.write(before).text
    assert f'<transition parcours:{ID}="on" target="b"/>' in text and f'event="loop" parcours:{SILENT}="true"' in text
    assert again(before).cefsm.components == before.components


def test_the_event_of_a_transition_without_one_is_no_event_of_the_model() -> None:
    before = model(
        Transition("e", "a", "b"),
        Transition("done", "a", "b"),
        Transition("error", "a", "b"),
        Transition("x", "a", "b", Receive("e")),
    )
    text = scxml.write(before).text
    assert [f'event="{name}" parcours:{SILENT}' in text for name in ("e_2", "done_2", "error_2")] == [True] * 3
    assert set(again(before).cefsm.components[0].transitions()) == set(before.components[0].transitions())


def test_of_two_transitions_on_one_event_the_first_goes_and_that_is_a_loss() -> None:
    small, large = parse_expression("n < 5"), parse_expression("n > 2")
    before = model(
        Transition("small", "a", "b", Receive("e"), small),
        Transition("large", "a", "a", Receive("e"), large),
        Transition("not_small", "a", "b", Receive("f"), parse_expression("n >= 5")),
        Transition("but_small", "a", "a", Receive("f"), small),
        variables=(Variable("n", "int", 0),),
    )
    [loss] = scxml.write(before).losses
    assert loss.where == "transition 'large'" and "where 'small' can go too, that goes first there" in loss.what
    back = {each.id: each for each in again(before).cefsm.components[0].transitions()}
    assert predicate(back["large"]) == "(e/[n >= 5 && n > 2]/-/-)"


def test_an_event_that_the_document_sends_is_an_event_although_it_is_marked() -> None:
    text = (
        f'{HEAD.replace("<scxml", f"<scxml xmlns:parcours={OWN!r}")}<state id="a"><onexit><raise event="t"/></onexit>'
        f'<transition event="t" parcours:{SILENT}="true" target="a"/></state></scxml>'
    )
    [back] = scxml.read(text, "chart.scxml").cefsm.components[0].transitions()
    assert back.event == Receive("t")


def test_what_can_never_be_taken_or_entered_is_a_loss_with_its_line() -> None:
    text = f"""{HEAD}<state id="a">
      <transition target="b"/>
      <transition event="e" target="c"/>
      <transition target="c"/></state>
    <state id="b">
      <transition event="x" target="a"/>
      <transition event="x" target="c"/></state>
    <state id="c"/>
    <state id="never"><transition event="y" target="a"/></state></scxml>"""
    reading = scxml.read(text, "chart.scxml")
    assert len(ids(reading.cefsm)) == 2
    assert [(loss.line, loss.where, loss.what) for loss in reading.losses] == [
        (4, "transition 2 of state 'a'", NEVER),
        (5, "transition 3 of state 'a'", NEVER),
        (8, "transition 2 of state 'b'", NEVER),
        (9, "state 'c'", "can never be entered; left out"),
        (10, "state 'never'", "can never be entered; left out"),
        (10, "transition 1 of state 'never'", NEVER),
    ]


def test_what_waits_for_the_end_of_a_state_is_taken() -> None:
    text = f"""{HEAD}<datamodel><data id="n" expr="0"/></datamodel><state id="a">
      <transition event="done.state.a"><assign location="n" expr="n + 1"/></transition>
      <history id="h"><transition target="b"/></history>
      <state id="b"><transition event="e" target="f"/></state><final id="f"/></state></scxml>"""
    assert scxml.read(text, "chart.scxml").losses == ()


def random_model(source: random.Random) -> Cefsm:
    """Return a model with choices of every kind: silent ones, shared events, guards that overlap, unreached states."""
    guards = ["n < 3", "n >= 3", "p", "!p", "n != 1 || p"]
    machines, channels = [], []
    for number in range(source.randint(1, 2)):
        states = tuple(f"s{number}_{at}" for at in range(source.randint(1, 4)))
        events = [f"e{number}_{at}" for at in range(2)]
        channels += [Channel(event, ENVIRONMENT, "chart", "Event") for event in events]
        transitions = []
        for at in range(source.randint(1, 8)):
            event = Receive(source.choice(events)) if source.random() < 0.5 else None
            guard = parse_expression(source.choice(guards)) if source.random() < 0.6 else None
            actions = (Assignment("n", parse_expression("n + 1")),) if source.random() < 0.3 else ()
            start, end = source.choice(states), source.choice(states)
            transitions.append(Transition(f"t {number}.{at}", start, end, event, guard, actions))
        machines.append(Machine(f"m{number}", states[0], states, tuple(transitions)))
    variables = (Variable("n", "int", 0), Variable("p", "bool", True))
    return Cefsm(
        "chart", (Component("chart", tuple(machines), variables),), tuple(channels), (MessageClass("Event", ()),)
    )


@given(st.integers(0, 2**32))
@settings(max_examples=100, deadline=None)
def test_every_transition_of_a_model_comes_back_or_is_a_loss(seed: int) -> None:
    before = random_model(random.Random(seed))
    back = again(before)
    kept, never = ids(back.cefsm), [loss for loss in back.losses if loss.what == NEVER]
    assert set(kept) <= set(ids(before)) and len(kept) + len(never) == len(ids(before))
    known = {each.id: each for each in before.components[0].transitions()}
    for each in back.cefsm.components[0].transitions():
        same = known[each.id]
        assert (each.source, each.target, each.event, each.actions) == (
            same.source,
            same.target,
            same.event,
            same.actions,
        )
        if each.event is None:
            assert each.guard == same.guard
