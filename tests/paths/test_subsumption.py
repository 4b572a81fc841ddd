from __future__ import annotations

from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model.expression import Assignment, Binary, Expression, Literal, Name
from parcours.model.structure import Machine, Transition, Variable
from parcours.paths import cover, measure
from parcours.paths.criteria import CRITERIA, SUBSUMES, subsumes
from parcours.paths.measuring import Tours

X = (Variable("x", "int", 0),)
WRITTEN = (
    "node", "edge", "edge-pair", "0-switch", "1-switch", "2-switch", "prime", "simple-round-trip",
    "complete-round-trip", "complete:2", "complete:3", "all-defs", "all-uses", "all-du-paths",
)  # fmt: skip
PAIRS = [(stronger, weaker) for stronger, weaker in permutations(WRITTEN, 2) if subsumes(stronger, weaker)]
TOURS: tuple[Tours, ...] = ("direct", "sidetrips", "detours")
READ: tuple[Expression | None, ...] = (None, None, Binary("<", Name("x"), Literal(1)))


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    states = [f"s{number}" for number in range(draw(st.integers(1, 4)))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    arcs = [("s0", draw(st.sampled_from(states))), *draw(st.lists(ends, max_size=5))]
    transitions = (
        Transition(
            f"t{n}", a, b, guard=draw(st.sampled_from(READ)),
            actions=(Assignment("x", Literal(1)),) if draw(st.booleans()) else (),
        )
        for n, (a, b) in enumerate(arcs)
    )  # fmt: skip
    return Machine("m", "s0", tuple(states), tuple(transitions))


@st.composite
def runs(draw: st.DrawFn, machine: Machine) -> list[str]:
    state, run = "s0", []
    for _ in range(draw(st.integers(0, 12))):
        following = [each for each in machine.transitions if each.source == state]
        if not following:
            break
        run.append(draw(st.sampled_from(following)))
        state = run[-1].target
    return [each.id for each in run]


@given(machines(), st.sampled_from(PAIRS), st.sampled_from(TOURS))
@settings(max_examples=120)
def test_a_cover_of_the_stronger_criterion_satisfies_the_weaker(
    machine: Machine, pair: tuple[str, str], tours: Tours
) -> None:
    paths = [path.ids for path in cover(machine, pair[0], variables=X)]
    assert measure(machine, pair[1], *paths, tours=tours, variables=X).missed == ()


@given(machines(), st.sampled_from(PAIRS), st.sampled_from(TOURS), st.data())
@settings(max_examples=250)
def test_whatever_satisfies_the_stronger_criterion_satisfies_the_weaker(
    machine: Machine, pair: tuple[str, str], tours: Tours, data: st.DataObject
) -> None:
    # Some paths of a cover, and some more that the requirements know nothing of.
    made = [path.ids for path in cover(machine, data.draw(st.sampled_from(WRITTEN)), variables=X)]
    some = data.draw(st.lists(st.sampled_from(made), unique=True)) if made else []
    paths = [*some, *data.draw(st.lists(runs(machine), max_size=3))]
    if not measure(machine, pair[0], *paths, tours=tours, variables=X).missed:
        assert measure(machine, pair[1], *paths, tours=tours, variables=X).missed == ()


def satisfied(machine: Machine, *paths: str) -> set[str]:
    runs = [path.split() for path in paths]
    return {each for each in WRITTEN if not measure(machine, each, *runs, variables=X).missed}


SET = (Assignment("x", Literal(1)),)
LOOPS = Machine("m", "s", ("s", "a", "b"), (
    Transition("in", "s", "a"),
    Transition("set", "a", "a", actions=SET),
    Transition("reset", "a", "a", actions=SET),
    Transition("out", "a", "b", guard=READ[2]),
))  # fmt: skip
EIGHT = Machine("m", "s", ("s",), (Transition("x", "s", "s"), Transition("y", "s", "s")))
FORK = Machine("m", "s", ("s", "a"), (Transition("left", "s", "a"), Transition("right", "s", "a")))
UNDER_X = Machine("m", "s", ("s", "a", "b"), (
    Transition("set", "s", "a", actions=SET), Transition("p", "a", "b"), Transition("q", "a", "b"),
    Transition("use", "b", "b", guard=READ[2]), Transition("use2", "b", "b", guard=READ[2]),
))  # fmt: skip


@pytest.mark.parametrize(
    ("machine", "paths", "has", "lacks"),
    [
        (FORK, ["left"], "node", "edge"),
        (LOOPS, ["in set reset out"], "edge", "edge-pair"),
        (LOOPS, ["in set reset out", "in out"], "prime", "edge-pair"),
        (LOOPS, ["in set reset out", "in out"], "prime", "all-uses"),
        (EIGHT, ["x x"], "simple-round-trip", "complete-round-trip"),
        (EIGHT, ["x", "y"], "complete-round-trip", "edge-pair"),
        (UNDER_X, ["set p use"], "all-defs", "all-uses"),
        (UNDER_X, ["set p use", "set p use2"], "all-uses", "all-du-paths"),
        (UNDER_X, ["set p use use2 use2 use", "set q use2"], "edge", "all-du-paths"),
        (UNDER_X, ["set p use", "set q use2", "set p use2", "set q use"], "all-du-paths", "edge-pair"),
    ],
)
def test_what_is_not_said_to_subsume_does_not(machine: Machine, paths: list[str], has: str, lacks: str) -> None:
    assert not subsumes(has, lacks)
    assert has in satisfied(machine, *paths)
    assert lacks not in satisfied(machine, *paths)


def test_the_table_names_criteria_and_has_no_circle() -> None:
    assert {name for weaker in SUBSUMES.values() for name in weaker} | set(SUBSUMES) <= set(CRITERIA)
    for stronger, weaker in permutations(WRITTEN, 2):
        both = {stronger, weaker} <= {"edge", "0-switch"} or {stronger, weaker} <= {"edge-pair", "1-switch"}
        assert (subsumes(stronger, weaker) and subsumes(weaker, stronger)) == both


def test_given_walks_subsume_some_of_them_and_higher_bounds_lower_ones() -> None:
    assert subsumes("specified:t1 t2, t3", "specified:t3")
    assert not subsumes("specified:t3", "specified:t1 t2, t3")
    assert subsumes("complete:9", "complete:3")
    assert not subsumes("complete:9", "node")  # a state may lie deeper
