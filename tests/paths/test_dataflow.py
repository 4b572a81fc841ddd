from __future__ import annotations

from collections.abc import Iterator, Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.model import parse_model
from parcours.model.expression import Assignment, Binary, Call, Expression, Literal, Name
from parcours.model.structure import Machine, Receive, Send, Transition, Variable
from parcours.paths import measure, requirements
from parcours.paths.criteria import START, CoverageRequirement, RequirementLimits
from parcours.paths.criteria.dataflow import access
from parcours.paths.graph import graph_of
from parcours.paths.measuring import Tours

VARIABLES = (Variable("x", "int", 0), Variable("y", "int", 0), Variable("i", "int", 0, role="input"))

names = st.sampled_from(["x", "y", "i"]).map(Name)
expressions: st.SearchStrategy[Expression] = names | st.just(Literal(1)) | st.builds(Binary, st.just("+"), names, names)
actions = st.builds(Assignment, st.sampled_from(["x", "y"]), expressions) | st.builds(
    Call, st.just("show"), st.tuples(names)
)


@st.composite
def transitions(draw: st.DrawFn, id: str, source: str, target: str) -> Transition:
    # Most transitions do nothing with variables, so that values travel far.
    return Transition(
        id, source, target,
        guard=draw(st.none() | st.none() | st.builds(Binary, st.just("<"), names, names)),
        actions=tuple(draw(st.lists(actions, max_size=2))) if draw(st.booleans()) else (),
        sends=(Send("c", (draw(names),)),) if draw(st.integers(0, 3)) == 0 else (),
    )  # fmt: skip


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    states = [f"s{number}" for number in range(draw(st.integers(1, 4)))]
    ends = st.tuples(st.sampled_from(states), st.sampled_from(states))
    arcs = draw(st.lists(ends, min_size=1, max_size=6))
    return Machine("m", "s0", tuple(states), tuple(draw(transitions(f"t{n}", a, b)) for n, (a, b) in enumerate(arcs)))


Event = tuple[str, str]
"""What happens to a variable, in order: ("use", name) or ("def", name)."""


def events(transition: Transition) -> Iterator[Event]:
    def read(expression: Expression) -> Iterator[Event]:
        parts = [expression.left, expression.right] if isinstance(expression, Binary) else [expression]
        return (("use", part.id) for part in parts if isinstance(part, Name))

    yield ("def", "i")  # the environment sets inputs before each transition
    if transition.guard is not None:
        yield from read(transition.guard)
    for action in transition.actions:
        if isinstance(action, Call):
            yield from (event for argument in action.arguments for event in read(argument))
        else:
            yield from read(action.value)
            yield ("def", action.target)
    yield from (event for send in transition.sends for value in send.payload for event in read(value))


def flows(walk: Sequence[tuple[str, list[Event]]]) -> set[tuple[str, int, int]]:
    """(variable, place of its definition, place of the use) along a walk, by following every value."""
    found = set()
    holder: dict[str, int] = {}
    for place, (_, happening) in enumerate(walk):
        for what, name in happening:
            if what == "def":
                holder[name] = place
            elif name in holder:
                found.add((name, holder[name], place))
    return found


def naive_du_paths(machine: Machine) -> set[tuple[str, tuple[str, ...]]]:
    """Try all walks whose inner states are all different, from every transition and from the start."""
    graph = graph_of(machine)
    by_id = {each.id: each for each in machine.transitions}
    begin = (START, [("def", "x"), ("def", "y")])
    found = set()
    firsts = [[begin], *([(id, list(events(by_id[id])))] for id in graph.edges)]
    queue = [(walk, [machine.initial if walk[0][0] == START else by_id[walk[0][0]].target]) for walk in firsts]
    for walk, inner in queue:
        ids = tuple(id for id, _ in walk)
        found |= {(name, ids) for name, begun, ended in flows(walk) if begun == 0 and ended == len(walk) - 1}
        if len(set(inner)) == len(inner):
            for each in machine.transitions:
                if each.source == inner[-1]:
                    queue.append(([*walk, (each.id, list(events(each)))], [*inner, each.target]))
    return found


@given(machines())
@settings(max_examples=120)
def test_du_paths_are_the_simple_ways_on_which_a_value_comes_from_its_definition_to_a_use(machine: Machine) -> None:
    found = [(need.variable, need.steps) for need in requirements(machine, "all-du-paths", variables=VARIABLES)]
    assert set(found) == naive_du_paths(machine)
    assert len(set(found)) == len(found)


def ends(needs: Sequence[CoverageRequirement]) -> set[tuple[str, str, str]]:
    return {(need.variable, need.steps[0], need.steps[-1]) for need in needs}


@given(machines())
@settings(max_examples=100)
def test_uses_are_where_du_paths_end_and_definitions_where_they_begin(machine: Machine) -> None:
    paths, uses, definitions = (
        requirements(machine, name, variables=VARIABLES) for name in ("all-du-paths", "all-uses", "all-defs")
    )
    assert ends(uses) == ends(paths)
    assert {(need.variable, need.steps[0]) for need in definitions} == {
        (need.variable, need.steps[0]) for need in paths
    }


@given(machines(), st.data())
@settings(max_examples=120)
def test_a_use_is_met_exactly_when_a_run_brings_the_value_there(machine: Machine, data: st.DataObject) -> None:
    graph = graph_of(machine)
    by_id = {each.id: each for each in machine.transitions}
    state, run = machine.initial, []
    for _ in range(data.draw(st.integers(0, 8))):
        following = [id for id in graph.edges if by_id[id].source == state]
        if not following:
            break
        run.append(data.draw(st.sampled_from(following)))
        state = by_id[run[-1]].target
    walk = [(START, [("def", "x"), ("def", "y")]), *((id, list(events(by_id[id]))) for id in run)]
    states = ["", machine.initial, *(by_id[id].target for id in run)]
    within = flows(walk)
    for tours in ("sidetrips", "direct"):
        if tours == "direct":  # no state comes twice between the definition and the use
            within = {(n, b, e) for n, b, e in within if len(set(states[b + 1 : e + 1])) == e - b}
        met = measure(machine, "all-uses", run, tours=tours, variables=VARIABLES).met
        expected = {(name, walk[begun][0], walk[ended][0]) for name, begun, ended in within}
        assert {(need.variable, need.steps[0], need.steps[-1]) for need in met} == expected
        begun = measure(machine, "all-defs", run, tours=tours, variables=VARIABLES).met
        assert {(need.variable, need.steps[0]) for need in begun} == {(name, first) for name, first, _ in expected}


@given(machines(), st.data())
@settings(max_examples=100)
def test_a_du_path_with_side_trips_brings_the_value_along_all_its_transitions(
    machine: Machine, data: st.DataObject
) -> None:
    graph = graph_of(machine)
    by_id = {each.id: each for each in machine.transitions}
    state, run = machine.initial, []
    for _ in range(data.draw(st.integers(0, 8))):
        following = [id for id in graph.edges if by_id[id].source == state]
        if not following:
            break
        run.append(data.draw(st.sampled_from(following)))
        state = by_id[run[-1]].target
    walk = [(START, [("def", "x"), ("def", "y")]), *((id, list(events(by_id[id]))) for id in run)]
    ids = [id for id, _ in walk]
    states = ["", machine.initial, *(by_id[id].target for id in run)]

    def follows(need: CoverageRequirement, begun: int, ended: int, *, by_state: bool) -> bool:
        inner = need.steps[1:-1]
        if by_state:
            first = machine.initial if need.steps[0] == START else by_id[need.steps[0]].target
            along, wanted = iter(states[begun + 1 : ended + 1]), [first, *(by_id[id].target for id in inner)]
            if begun == ended:
                return len(need.steps) == 1
        else:
            along, wanted = iter(ids[begun + 1 : ended]), list(inner)
        if len(need.steps) == 1 or begun == ended:
            return len(need.steps) == 1 and begun == ended
        return (ids[begun], ids[ended]) == (need.steps[0], need.steps[-1]) and all(step in along for step in wanted)

    for tours in ("sidetrips", "detours"):
        coverage = measure(machine, "all-du-paths", run, tours=tours, variables=VARIABLES)
        expected = {
            need
            for need in coverage.required
            for name, begun, ended in flows(walk)
            if name == need.variable
            and (ids[begun], ids[ended]) == (need.steps[0], need.steps[-1])
            and follows(need, begun, ended, by_state=tours == "detours")
        }
        assert set(coverage.met) == expected


def test_the_order_in_a_transition_is_receive_guard_actions_send() -> None:
    tick = Transition(
        "t", "s", "s", Receive("c", "it"), Binary("<", Name("x"), Name("it")),
        (Assignment("y", Name("x")), Assignment("x", Name("y"))), (Send("d", (Name("x"), Name("remark"))),),
    )  # fmt: skip
    done = access(tick, {"x": "local", "y": "local"})
    assert (done.reads, set(done.within)) == (("x",), {"it", "y", "x"})
    assert done.confirms == done.defines == ("y", "x")


def test_a_received_message_hides_a_variable_of_its_name() -> None:
    tick = Transition("t", "s", "s", Receive("c", "x"), Binary("<", Name("x"), Name("y")))
    assert access(tick, {"x": "local", "y": "local"}).reads == ("y",)


def test_initial_values_are_definitions_of_the_start_only() -> None:
    lamp = parse_model("""
    parcours: model/1
    name: lamp
    components:
      Lamp:
        variables: {n: {type: int, initial: 0, range: [0, 3]}}
        machines:
          light:
            initial: off
            transitions:
              up: {from: off, to: on, guard: n < 3, action: n := n + 1}
              down: {from: on, to: off}
              stay: {from: on, to: on}
    """)
    needs = [str(need) for need in requirements(lamp, "all-uses")]
    assert needs == ["n: (start) -> up", "n: up -> up"]
    assert [str(need) for need in measure(lamp, "all-uses", ["up", "down"]).met] == ["n: (start) -> up"]
    assert measure(lamp, "all-uses", ["down", "up"]).met == ()  # not from the start
    assert measure(lamp, "all-uses", ["stay", "up"]).met == ()  # back in the initial state, but not by a start
    assert measure(lamp, "all-uses", ["up", "down", "up"]).ratio == 1.0


def test_a_du_path_is_toured_between_its_definition_and_its_use_only() -> None:
    x = (Variable("x", "int", 0),)
    machine = Machine("m", "s", ("s", "a", "b"), (
        Transition("set", "s", "a", actions=(Assignment("x", Literal(1)),)),
        Transition("left", "a", "b"), Transition("right", "a", "b"),
        Transition("use", "b", "a", guard=Binary("<", Name("x"), Literal(2))),
    ))  # fmt: skip

    def met(tours: Tours, *run: str) -> list[str]:
        return [str(need) for need in measure(machine, "all-du-paths", run, tours=tours, variables=x).met]

    assert met("sidetrips", "set", "left", "use", "right") == ["x: set left use"]
    assert met("detours", "set", "left", "use") == ["x: set left use", "x: set right use"]
    assert met("sidetrips", "set", "left", "use", "right", "use") == ["x: set left use", "x: set right use"]
    assert met("direct", "set", "left", "use", "right", "use") == ["x: set left use"]


def test_nothing_is_known_of_values_after_a_jump() -> None:
    x = (Variable("x", "int", 0),)
    machine = Machine("m", "a", ("a", "b"), (
        Transition("set", "a", "b", actions=(Assignment("x", Literal(1)),)),
        Transition("stay", "b", "b"),
        Transition("use", "b", "a", guard=Binary("<", Name("x"), Literal(2))),
    ))  # fmt: skip
    assert "x: set -> use" in map(str, measure(machine, "all-uses", ["set", "use"], variables=x).met)
    assert measure(machine, "all-uses", ["set", "set", "stay"], ["use"], variables=x).met == ()
    assert measure(machine, "all-uses", ["use", "use"], variables=x).met == ()


def test_a_variable_without_a_declaration_is_refused() -> None:
    machine = Machine("m", "s", ("s",), (Transition("t", "s", "s", guard=Binary("<", Name("speed"), Literal(1))),))
    with pytest.raises(BadRequest, match=r"transition 't': .*'speed' has none.*\[undeclared-variable\]"):
        requirements(machine, "all-uses")


def test_too_many_du_paths_are_refused_with_the_count_reached() -> None:
    rungs = 30
    x = (Variable("x", "int", 0),)
    ways = tuple(Transition(f"{side}{n}", f"s{n}", f"s{n + 1}") for n in range(rungs) for side in "ab")
    use = Transition("use", f"s{rungs}", f"s{rungs}", guard=Binary("<", Name("x"), Literal(1)))
    machine = Machine("m", "s0", tuple(f"s{n}" for n in range(rungs + 1)), (*ways, use))
    with pytest.raises(BadRequest, match=r"du-paths of 'm': .*stopped at 101.*\[too-many-requirements\]"):
        requirements(machine, "all-du-paths", variables=x, limits=RequirementLimits(count=100))
    assert len(requirements(machine, "all-uses", variables=x)) == 1
