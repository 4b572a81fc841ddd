from __future__ import annotations

import re
from dataclasses import replace
from importlib.resources import files
from itertools import islice

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.abtc import (
    POLICIES,
    AbstractCase,
    Start,
    abstract_cases,
    ask_alone,
    case_counts,
    find_case,
    interaction_paths,
    serialise,
)
from parcours.errors import BadRequest, BadSuite
from parcours.model import read_model
from parcours.model.structure import Cefsm, Channel, Component, Machine, Receive, Send, Transition

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
OBSTACLES = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))


def obstacles(count: int) -> Cefsm:
    """A model of `count` dynamic obstacles, each (stopped, moving, stopped)."""

    def machine(n: int) -> Machine:
        there, back = Transition(f"p{n}1", "stopped", "moving"), Transition(f"p{n}2", "moving", "stopped")
        return Machine("motion", "stopped", ("stopped", "moving"), (there, back))

    return Cefsm("obstacles", tuple(Component(f"Obstacle{n}", (machine(n),)) for n in range(1, count + 1)))


@st.composite
def talking_models(draw: st.DrawFn) -> Cefsm:
    """Two or three components, each one ring of states with loops, that send and receive at random."""
    names = "ABC"[: draw(st.integers(2, 3))]
    channels = tuple(Channel(a + b, a, b, "Text") for a in names for b in names if a != b)
    components = []
    for name in names:
        size = draw(st.integers(1, 3))
        arcs = [(n, (n + 1) % size) for n in range(size)] + [(n, n) for n in range(draw(st.integers(0, size)))]
        heard = [None, *(channel.name for channel in channels if channel.receiver == name)]
        told = [None, *(channel.name for channel in channels if channel.sender == name)]
        transitions = []
        for n, (a, b) in enumerate(arcs):
            receive, send = draw(st.sampled_from(heard)), draw(st.sampled_from(told))
            event = Receive(receive) if receive else None
            sends = (Send(send),) if send else ()
            transitions.append(Transition(f"{name}{n}", f"s{a}", f"s{b}", event=event, sends=sends))
        states = tuple(f"s{n}" for n in range(size))
        components.append(Component(name, (Machine("m", "s0", states, tuple(transitions)),)))
    return Cefsm("talk", tuple(components), channels)


def check_sequence(case: AbstractCase) -> None:
    """What every serialised execution sequence must keep."""
    events = serialise(case)
    assert [event.position for event in events] == list(range(len(events)))
    assert all(cause < event.position for event in events for cause in event.after)
    assert all(event.before is None or event.position < event.before for event in events)
    taken: dict[int, list[str]] = {}
    for event in events:
        taken.setdefault(event.reference, []).append(event.transition)
    assert taken == {n: list(path.ids) for n, (_, path) in enumerate(case.combination.references)}
    for event in events:
        if event.receives is not None and event.receives.event is not None:
            send = events[event.receives.event]
            assert send.position < event.position
            assert send.visit == event.visit - 1
            assert (event.receives.channel, event.reference) in [(s.channel, s.reference) for s in send.sends]
    met = [e.receives.event for e in events if e.receives is not None and e.receives.event is not None]
    channels = [e.receives.channel for e in events if e.receives is not None and e.receives.event is not None]
    assert len(set(zip(met, channels, strict=True))) == len(met), "a message was received twice"


@given(talking_models(), st.sampled_from(list(POLICIES)))
@settings(max_examples=150, deadline=None)
def test_any_case_of_any_model_runs_to_its_end_and_keeps_order_and_rendezvous(model: Cefsm, policy: str) -> None:
    for case in islice(abstract_cases(model, policy), 20):
        check_sequence(case)


@pytest.mark.parametrize("model", [RAMP, OBSTACLES], ids=["components", "obstacles"])
def test_every_case_of_the_study_keeps_order_and_rendezvous(model: Cefsm) -> None:
    for case in abstract_cases(model):
        check_sequence(case)


@pytest.mark.parametrize("model", [RAMP, OBSTACLES], ids=["components", "obstacles"])
def test_different_cases_are_executed_differently(model: Cefsm) -> None:
    cases = list(abstract_cases(model))
    executions = {tuple((e.turn, e.reference, e.transition) for e in serialise(case)) for case in cases}
    assert len(executions) == len(cases)


def test_the_total_orders_alone_already_tell_the_component_cases_apart() -> None:
    orders = {tuple((e.reference, e.transition) for e in serialise(case)) for case in abstract_cases(RAMP)}
    assert len(orders) == 67


@pytest.mark.parametrize("policy", list(POLICIES))
def test_cases_are_counted_without_being_made(policy: str) -> None:
    made: dict[str, int] = {}
    for case in abstract_cases(RAMP, policy, [each for each in interaction_paths(RAMP) if each.criterion == "EPC"]):
        made[case.interaction.name] = made.get(case.interaction.name, 0) + 1
    counts = case_counts(RAMP, policy)
    assert made == {name: counts[name] for name in ("ITP1", "ITP2", "ITP3", "ITP4")}


def test_cases_stream_however_many_there_are() -> None:
    crowd = obstacles(60)
    assert case_counts(crowd) == {"together": 3**59}
    assert [case.start_vector[-1] for case in islice(abstract_cases(crowd), 3)] == [0, 1, 2]


@pytest.mark.parametrize("policy", list(POLICIES))
def test_ids_are_unique_and_fit_for_file_names(policy: str) -> None:
    ids = [case.id for case in islice(abstract_cases(RAMP, policy), 2000)]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[A-Za-z0-9.+_-]{1,120}", id) for id in ids)


def test_ids_stay_the_same_between_releases() -> None:
    ids = [case.id for case in abstract_cases(RAMP)]
    assert ids[2] == "ITP1-tp12.tp21.tp12-0.0.2"
    assert ids[15] == "ITP4-tp11.tp41+tp42.tp11-0.0+3.3"
    assert ids[36] == "ITP5-tp61.tp11+tp12.tp21.tp11+tp12.tp31.tp11+tp12.tp41-0.1+1.1.3+3.3.5+5.5"
    assert ids[66] == "ITP6-tp41+tp42.tp11.tp51.tp11.tp41+tp42-0+4.5.5.7.7+7"
    assert next(abstract_cases(OBSTACLES, "before-return")).id == "together-tp11.tp21.tp31-0.0.0-before-return"


def test_a_hubs_partner_starts_right_after_the_request() -> None:
    for case in abstract_cases(RAMP):
        events = serialise(case)
        if case.interaction.name == "ITP3":
            first = next(event for event in events if event.path == "tp51")
            assert [events[cause].transition for cause in first.after] == ["p11"]


def test_the_next_obstacle_starts_while_the_one_before_stands_at_its_point() -> None:
    for case in abstract_cases(OBSTACLES):
        events = serialise(case)
        for reference in (1, 2):
            point = case.start_vector[reference] - case.start_vector[reference - 1]
            start = next(e for e in events if e.reference == reference)
            before = [e.transition for e in events if e.reference == reference - 1 and e.turn < start.turn]
            if point:
                assert len(before) == point
            else:
                assert start.after == next(e for e in events if e.reference == reference - 1).after


def leaving(case: AbstractCase) -> list[str | None]:
    """For each reference but the first, the transition that its first event must precede."""
    events = serialise(case)
    firsts = [next(e for e in events if e.reference == n) for n in range(1, len(case.starts))]
    return [None if first.before is None else events[first.before].transition for first in firsts]


def test_a_start_precedes_the_event_by_which_its_point_is_left() -> None:
    by_vector = {case.start_vector: leaving(case) for case in abstract_cases(OBSTACLES)}
    assert by_vector[0, 0, 0] == [None, None]  # together: neither waits for the other
    assert by_vector[0, 1, 2] == ["p12", "p22"]
    assert by_vector[0, 1, 3] == ["p12", None]  # an obstacle that has stopped stays there
    points = [leaving(case)[1] for case in abstract_cases(RAMP) if case.interaction.name == "ITP1"]
    assert points == [None, "p24", "p25"]  # p23 loops in `generating`; only p24 leaves it


def test_a_stand_in_gets_the_message_but_takes_no_receive() -> None:
    case = next(case for case in abstract_cases(RAMP) if case.interaction.name == "ITP4")
    (update,) = [e for e in serialise(case) if e.transition == "p48"]
    assert [(sent.channel, sent.to, sent.reference) for sent in update.sends] == [("update", "stand-in", 3)]


def test_what_no_earlier_path_sends_comes_from_the_environment() -> None:
    case = next(abstract_cases(RAMP))
    supplied = [e.receives.channel for e in serialise(case) if e.receives and e.receives.event is None]
    assert supplied.count("obstacles") == 2  # each of the two tp12 needs one; Sensing is not part of ITP1
    assert supplied.count("trajectory_response") == 1  # the second tp12 gets its own from tp21


def test_a_case_whose_starts_wait_for_each_other_is_refused() -> None:
    case = next(abstract_cases(OBSTACLES))
    knot = replace(case, starts=(Start(2, 1), Start(0, 1), Start(1, 1)))
    with pytest.raises(BadSuite, match=r"tp11#0, tp21#1, tp31#2 cannot go on after 0 steps.*serialisation-stuck"):
        serialise(knot)


def test_an_unknown_policy_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"'hubb' was given; did you mean 'hub'\?.*\[unknown-policy\]"):
        next(abstract_cases(RAMP, "hubb"))


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_start_vectors_of_obstacles_are_powers_of_what_counts_as_a_state(count: int) -> None:
    assert case_counts(obstacles(count))["together"] == 3 ** (count - 1)
    assert case_counts(obstacles(count), "distinct-states")["together"] == 2 ** (count - 1)


def test_the_model_file_names_the_policy_and_an_argument_overrules_it() -> None:
    named = replace(RAMP, serialisation="all-states")
    assert case_counts(named) == case_counts(RAMP, "all-states") != case_counts(RAMP)
    assert case_counts(named, "hub") == case_counts(RAMP)
    assert {case.policy for case in abstract_cases(named)} == {"all-states"}
    with pytest.raises(BadRequest, match="unknown-policy"):
        case_counts(replace(RAMP, serialisation="hubb"))


@pytest.mark.parametrize("policy", list(POLICIES))
def test_a_case_is_found_by_its_id_as_it_was_made(policy: str) -> None:
    for model in (RAMP, OBSTACLES):
        for case in islice(abstract_cases(model, policy), 0, 2000, 37):
            assert find_case(model, case.id) == case


def test_one_case_of_astronomically_many_is_found_at_once() -> None:
    crowd = obstacles(60)
    vector = ".".join(str(2 * n) for n in range(60))
    head, _, _ = next(abstract_cases(crowd)).id.rpartition("-")
    assert find_case(crowd, f"{head}-{vector}").start_vector[-1] == 118


@pytest.mark.parametrize("id", ["", "ITP1", "together-tp11.tp21.tp31-0.1.4", "together-tp11.tp21.tp31-0.2.1",
                                "together-tp11.tp21.tp31-0.0.0-hub", "together-tp11.tp21.tp31-0.0.00",
                                "together-tp11.tp21.tp31-0.0.\u0661"])  # fmt: skip
def test_an_id_that_no_case_has_is_refused(id: str) -> None:
    with pytest.raises(BadRequest, match="unknown-abstract"):
        find_case(OBSTACLES, id)


def test_a_path_that_hears_from_its_peers_only_is_asked_once_more_by_the_environment() -> None:
    asked = {id: ask_alone(serialise(find_case(RAMP, id)))
             for id in ("ITP1-tp12.tp21.tp12-0.0.1", "ITP4-tp11.tp41+tp42.tp11-0.0+1.2")}  # fmt: skip
    for id, events in asked.items():
        interaction = serialise(find_case(RAMP, id))
        more = events[len(interaction) :]
        assert events[: len(interaction)] == interaction and [event.position for event in events] == [
            *range(len(events))
        ]
        assert {event.path for event in more} == {"tp21" if id.startswith("ITP1") else "tp41"}
        assert all(event.receives is None or event.receives.event is None for event in more)
        assert {sent.to for event in more for sent in event.sends} <= {"environment"}
        lasts = {
            max(one.position for one in interaction if one.reference == r) for r in {e.reference for e in interaction}
        }
        assert set(more[0].after) == lasts and [one.after for one in more[1:]] == [(one.position,) for one in more[:-1]]


def test_a_path_that_the_environment_sends_everything_to_is_not_asked_again() -> None:
    events = serialise(next(abstract_cases(OBSTACLES)))
    assert ask_alone(events) == events
