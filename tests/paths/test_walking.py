from __future__ import annotations

from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel, BadRequest
from parcours.model import enabled, initial, parse_model, step
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.paths import measure
from parcours.paths import spaces as spaces_module
from parcours.paths.walking import WALKERS, Ending, GraphSpace, ModelSpace, Phase, Planned, Walk, part_of, phase
from parcours.paths.walking.conditions import parse_condition
from parcours.paths.walking.walkers import Guided

GATE = parse_model("""
parcours: model/1
name: gate
messages: {Key: {fields: {code: {type: int}}}}
channels:
  press: {from: environment, to: Pad, message: Key}
  open: {from: Pad, to: Door, message: Key, capacity: 0}
  log: {from: Door, to: Pad, message: Key, capacity: 2}
components:
  Pad:
    variables: {right: {type: int, initial: 0, range: [0, 3]}}
    machines:
      keys:
        initial: idle
        transitions:
          good: {from: idle, to: idle, event: press(k), guard: k.code == 7 && right < 3, action: right := right + 1}
          bad: {from: idle, to: idle, event: press(k), guard: k.code != 7, action: right := 0}
          ask: {from: idle, to: asked, guard: right == 3, message: open(), action: right := 0}
          noted: {from: asked, to: idle, event: log(it)}
  Door:
    machines:
      door:
        initial: shut
        transitions:
          turn: {from: shut, to: ajar, event: open(it)}
          close: {from: ajar, to: shut, message: log()}
          jam: {from: ajar, to: stuck}
""")


def chance(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def machine(*edges: tuple[str, str, str], initial: str = "a", weights: dict[str, float] | None = None) -> Cefsm:
    states = tuple(dict.fromkeys([initial, *(state for _, *ends in edges for state in ends)]))
    transitions = tuple(
        Transition(id, source, target, weight=(weights or {}).get(id, 1.0)) for id, source, target in edges
    )
    return Cefsm("m", (Component("A", (Machine("f", initial, states, transitions),)),))


@st.composite
def machines(draw: st.DrawFn) -> Cefsm:
    states = draw(st.integers(1, 5))
    ends = draw(st.lists(st.tuples(st.integers(0, states - 1), st.integers(0, states - 1)), min_size=1, max_size=12))
    return machine(*((f"t{i}", f"s{a}", f"s{b}") for i, (a, b) in enumerate(ends)), initial="s0")


def runs_of(walk: Walk) -> list[list[str]]:
    runs: list[list[str]] = [[]]
    for taken in walk:
        if taken.is_restart:
            runs.append([])
        runs[-1] += [taken.move.transition, *([taken.move.partner] if taken.move.partner else [])]
    return runs


@pytest.mark.parametrize("walker", WALKERS)
def test_every_move_of_a_walk_is_one_of_the_step_relation(walker: str) -> None:
    here = initial(GATE)
    for number, each in enumerate(
        Walk(ModelSpace(GATE), [phase(walker, "edge>=100% or steps>=200")], chance()), start=1
    ):
        here = initial(GATE) if each.is_restart else here
        assert each.move in enabled(GATE, here)
        here = step(GATE, here, each.move)
        assert each.after == here
        assert each.number == number


@pytest.mark.parametrize("walker", WALKERS)
def test_a_seed_is_a_walk(walker: str) -> None:
    def moves(seed: int) -> list[str]:
        return [str(each) for each in Walk(ModelSpace(GATE), [phase(walker, "steps>=60")], chance(seed))]

    assert moves(5) == moves(5)
    assert moves(5) != moves(6)


@settings(max_examples=60, deadline=None)
@given(machines(), st.sampled_from(list(WALKERS)), st.integers(0, 99))
def test_what_is_counted_on_the_way_is_what_measuring_afterwards_finds(cefsm: Cefsm, walker: str, seed: int) -> None:
    criteria = ("node", "edge", "edge-pair", "2-switch", "prime")
    walk = Walk(GraphSpace(cefsm), [phase(walker, "steps>=15")], chance(seed), criteria=criteria)
    runs = runs_of(walk)
    for name in criteria:
        assert set(walk.tallies.of[name].missed) == set(measure(cefsm, name, *runs).missed)
        assert walk.tallies.of[name].ratio == pytest.approx(measure(cefsm, name, *runs).ratio)


def test_a_rendezvous_counts_for_both_machines() -> None:
    walk = Walk(ModelSpace(GATE), [phase("guided", "edge>=100%")], chance())
    assert measure(GATE, "edge", *runs_of(walk)).missed == ()
    assert walk.ended is Ending.HELD


@settings(max_examples=40, deadline=None)
@given(machines(), st.integers(1, 100), st.integers(0, 9))
def test_a_walk_stops_at_the_first_step_where_its_condition_holds(cefsm: Cefsm, percent: int, seed: int) -> None:
    walk = Walk(GraphSpace(cefsm), [phase("random", f"edge>={percent}% or steps>=40")], chance(seed))
    runs = runs_of(walk)
    if walk.ended is Ending.HELD and walk.steps < 40:
        assert measure(cefsm, "edge", *runs).ratio >= percent / 100
        if walk.steps:
            assert measure(cefsm, "edge", *runs[:-1], runs[-1][:-1]).ratio < percent / 100


def test_guided_opens_the_lock_that_random_hardly_finds() -> None:
    walk = Walk(ModelSpace(GATE), [phase("guided", "taken(ask)")], chance())
    assert [str(each.move) for each in walk] == ["good", "good", "good", "ask+turn"]


def test_guided_begins_anew_where_only_that_helps_and_not_without_leave() -> None:
    fork = machine(("left", "a", "b"), ("spin", "b", "b"), ("right", "a", "c"))
    walk = Walk(GraphSpace(fork), [phase("guided", "edge>=100%")], chance())
    assert runs_of(walk) == [["left", "spin"], ["right"]] and walk.restarts == 1
    kept = Walk(GraphSpace(fork), [phase("guided", "edge>=100%")], chance(), at_dead_end="stop")
    assert runs_of(kept) == [["left", "spin"]] and kept.ended is Ending.EXHAUSTED


def test_guided_ends_when_it_has_seen_that_nothing_more_can_be_met() -> None:
    shut = parse_model(
        "{parcours: model/1, name: m, components: {A: {variables: {n: {type: int, initial: 0, range: [0, 4]}}, "
        "machines: {f: {initial: s, transitions: {up: {from: s, to: s, guard: n < 4, action: n := n + 1}, "
        "off: {from: s, to: s, guard: n == 4, action: n := 0}, never: {from: s, to: s, guard: n > 4}}}}}}}"
    )
    walk = Walk(ModelSpace(shut), [phase("guided", "edge>=100%")], chance())
    assert [str(each.move) for each in walk] == ["up"] * 4 + ["off"]
    assert walk.ended is Ending.EXHAUSTED and [str(need) for need in walk.tallies.of["edge"].missed] == ["never"]


def test_guided_goes_on_at_random_when_nothing_is_asked_or_all_is_met() -> None:
    for until in ("steps>=60", "edge>=100% and steps>=60"):
        walk = Walk(ModelSpace(GATE), [phase("guided", until)], chance())
        assert len(list(walk)) == 60 and walk.ended is Ending.HELD


def test_guided_walks_at_random_where_nothing_is_near() -> None:
    long = machine(*((f"t{i}", f"s{i}", f"s{i + 1}") for i in range(60)), ("back", "s60", "s0"), initial="s0")
    walk = Walk(GraphSpace(long), [Phase(Guided(look_ahead=5), parse_condition("edge>=100% and steps>=200"))], chance())
    assert len(list(walk)) == 200 and walk.ended is Ending.HELD


def test_weights_are_chances_and_weight_0_is_never_taken() -> None:
    fork = machine(("much", "a", "a"), ("little", "a", "a"), ("none", "a", "a"), weights={"much": 9.0, "none": 0.0})
    walk = Walk(GraphSpace(fork), [phase("weighted", "steps>=4000")], chance())
    list(walk)
    taken = walk.tallies.counts
    assert taken["none"] == 0 and 350 < taken["little"] < 450


def test_a_state_whose_ways_all_weigh_0_is_a_dead_end() -> None:
    walk = Walk(GraphSpace(machine(("none", "a", "a"), weights={"none": 0.0})), [phase("weighted", "never")], chance())
    assert list(walk) == [] and walk.ended is Ending.DEAD_END


def test_least_visited_takes_rivals_equally_often() -> None:
    walk = Walk(
        GraphSpace(machine(*((f"t{i}", "a", "a") for i in range(7)))), [phase("least-visited", "steps>=75")], chance()
    )
    list(walk)
    assert max(walk.tallies.counts.values()) - min(walk.tallies.counts.values()) <= 1


def test_a_transition_with_many_inputs_is_as_likely_as_its_rival() -> None:
    fork = parse_model(
        "{parcours: model/1, name: m, components: {A: {variables: {n: {type: int, role: input, range: [0, 40]}, "
        "m: {type: int, initial: 0}}, machines: {f: {initial: s, transitions: "
        "{many: {from: s, to: s, guard: n >= 0, action: m := n}, one: {from: s, to: s}}}}}}}"
    )
    walk = Walk(ModelSpace(fork), [phase("random", "steps>=2000")], chance())
    chosen = {value for each in walk for _, value in each.move.inputs}
    assert 900 < walk.tallies.counts["one"] < 1100 and len(chosen) > 30


@pytest.mark.parametrize("at_dead_end", ["restart", "stop"])
def test_a_dead_end_begins_anew_or_ends(at_dead_end: str) -> None:
    line = machine(("t1", "a", "b"), ("t2", "b", "c"))
    walk = Walk(GraphSpace(line), [phase("random", "steps>=6")], chance(), at_dead_end=at_dead_end)  # type: ignore[arg-type]
    runs = runs_of(walk)
    if at_dead_end == "restart":
        assert runs == [["t1", "t2"]] * 3 and walk.restarts == 2 and walk.ended is Ending.HELD
    else:
        assert runs == [["t1", "t2"]] and walk.ended is Ending.DEAD_END


def test_a_model_that_can_do_nothing_ends_at_once() -> None:
    walk = Walk(GraphSpace(machine(("t1", "b", "a"))), [phase("random", "edge>=100%")], chance())
    assert list(walk) == []
    assert walk.ended is Ending.HELD  # nothing is reachable, so nothing is required
    other = Walk(GraphSpace(machine(("t1", "b", "a"))), [phase("random", "steps>=1")], chance())
    assert list(other) == [] and other.ended is Ending.DEAD_END


def test_time_is_the_clocks_and_an_unbounded_condition_has_a_budget() -> None:
    ticks = count()
    walk = Walk(GraphSpace(machine(("t", "a", "a"))), [phase("random", "10 s")], chance(), clock=lambda: next(ticks))
    assert len(list(walk)) == 9 and walk.ended is Ending.HELD
    walk = Walk(GraphSpace(machine(("t", "a", "a"))), [phase("random", "never")], chance(), budget=5)
    assert len(list(walk)) == 5 and walk.ended is Ending.BUDGET
    dead = Walk(GraphSpace(machine(("t", "a", "b"))), [phase("random", "never")], chance(), budget=5)
    assert [each.is_restart for each in dead] == [False, True, True] and dead.ended is Ending.BUDGET


def test_phases_go_on_where_the_one_before_ended_and_count_their_own_steps() -> None:
    ring = machine(*((f"t{i}", f"s{i}", f"s{(i + 1) % 4}") for i in range(4)), initial="s0")
    walk = Walk(GraphSpace(ring), [phase("random", "steps>=5"), phase("guided", "reached(s0)")], chance())
    assert [str(each.move) for each in walk] == ["t0", "t1", "t2", "t3", "t0", "t1", "t2", "t3"]


def test_a_planned_path_is_followed_and_its_obstacle_named() -> None:
    walk = Walk(ModelSpace(GATE), [Phase(Planned([["bad", "bad"], ["good"]]), parse_condition("never"))], chance())
    assert runs_of(walk) == [["bad", "bad"], ["good"]] and walk.ended is Ending.PLAN_DONE
    walk = Walk(ModelSpace(GATE), [Phase(Planned([["bad", "ask"]]), parse_condition("never"))], chance())
    assert runs_of(walk) == [["bad"]] and walk.ended is Ending.BLOCKED


def test_a_move_that_breaks_the_models_rules_is_said() -> None:
    broken = parse_model(
        "{parcours: model/1, name: m, components: {A: {variables: {n: {type: int, initial: 0, range: [0, 1]}}, "
        "machines: {f: {initial: s, transitions: {up: {from: s, to: s, action: n := n + 1}}}}}}}"
    )
    with pytest.raises(BadModel, match=r"'A.n' must stay in its domain"):
        list(Walk(ModelSpace(broken), [phase("random", "steps>=9")], chance()))


@pytest.mark.parametrize("space", [GraphSpace, ModelSpace])
def test_forgetting_places_changes_no_walk(space: type[ModelSpace], monkeypatch: pytest.MonkeyPatch) -> None:
    def moves() -> list[str]:
        return [str(each) for each in Walk(space(GATE), [phase("least-visited", "steps>=300")], chance())]

    remembered = moves()
    monkeypatch.setattr(spaces_module, "REMEMBERED", 2)
    assert moves() == remembered


def test_a_machine_walks_alone_with_the_environment_at_its_channels() -> None:
    alone = part_of(GATE, "Door", "door")
    walk = Walk(ModelSpace(alone), [phase("guided", "edge>=100%")], chance())
    assert {id for run in runs_of(walk) for id in run} == {"turn", "close", "jam"}
    with pytest.raises(BadRequest, match=r"did you mean 'Door'"):
        part_of(GATE, "Dor")
    with pytest.raises(BadRequest, match=r"unknown-part"):
        part_of(GATE, "Door", "window")


@pytest.mark.parametrize(
    "until", ["reached(nowhere)", "taken(nothing)", "egde>=100%", "all-uses>=100%", "simple-round-trip>=1%"]
)
def test_a_condition_on_what_is_not_there_is_refused_before_the_first_step(until: str) -> None:
    with pytest.raises(BadRequest):
        Walk(ModelSpace(GATE), [phase("random", until)], chance())


@pytest.mark.parametrize("name", ["shut", "door.shut", "Door.shut", "Door.door.shut"])
def test_a_state_may_be_named_with_its_machine_and_component(name: str) -> None:
    assert list(Walk(ModelSpace(GATE), [phase("random", f"reached({name})")], chance())) == []
