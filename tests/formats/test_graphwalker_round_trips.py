"""GraphWalker's formats there and back: JSON, GraphML and DOT give back what they hold; losses name the rest."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest
from hypothesis import assume, given, settings
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
    Transition,
    Variable,
    findings,
)
from parcours.model.expression import Assignment, Call, Expression, Name, evaluate, parse_expression
from parcours.model.formats import ForeignModel, Loss, Writing
from parcours.model.structure import CLOCK
from parcours_formats import dot, graphml, graphwalker

FORMATS = {"graphwalker": graphwalker, "graphml": graphml, "dot": dot}
WORDS = ("slow", "a;b", "x]y[", "it's", "/* no */ // comment", 'WEIGHT=3 "q"', "", "ü\n")
KINDS = ("bool", "int", "real", "text")
GUARDS = {
    "bool": ("{0}", "!{0}", "{0} != {1} && true", "!({0} && {1}) || {0} == {1}"),
    "int": ("{0} < 3", "{0} * 2 - {1} >= -1", "abs({0}) % 2 == 0", "-(-{0}) == max({0}, {1})", "!({0} <= {1})"),
    "real": ("{0} <= 0.5", "floor({0}) + 1 > {1} / 2", "hypot({0}, {1}) < 5 || {0} == 0.25"),
    "text": ("{0} == 'slow'", "{0} != {1}", "'x]y[' == {0}"),
}
VALUES = {
    "bool": ("!{0}", "{0} && {1}", "true"),
    "int": ("{0} + 1", "min({0}, 2 * {1})", "-7"),
    "real": ("{0} / 2", "sqrt(abs({0})) - {1}", "0.5"),
    "text": ("'slow'", "{0}", "'a;b'"),
}
names = st.sampled_from(["x", "y", "n", "new", "global_", "Start", "in", "v_1"])
labels = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=5) | st.sampled_from(
    [
        "idle",
        "goal reached",
        "Start",
        "start",
        "v_Home",
        "e_Go",
        "a/b",
        "INIT",
        "<html>",
        "#1",
        "//",
        "7th",
        '"',
        "\\",
        "[x]",
    ]
)


def distinct(of: st.SearchStrategy[str], least: int, most: int) -> st.SearchStrategy[list[str]]:
    return st.lists(of, min_size=least, max_size=most, unique=True)


@st.composite
def models(draw: st.DrawFn) -> Cefsm:
    """Models with everything GraphWalker has words for, and now and then with something it has none for."""
    ids = iter(draw(distinct(labels, 12, 12)))
    components = []
    for owner in draw(distinct(st.sampled_from(["A", "B", "Start", "idle"]), 1, 2)):
        kinds = {name: draw(st.sampled_from(KINDS)) for name in draw(distinct(names, 0, 4))}
        values: dict[str, st.SearchStrategy[object]] = {
            "bool": st.booleans(),
            "int": st.integers(-9, 9),
            "real": st.sampled_from([0.0, -2.5, 1e22, 3.0]),
            "text": st.sampled_from(WORDS),
        }
        variables = tuple(
            Variable(name, kind, draw(values[kind]), "local", (), draw(units)) for name, kind in kinds.items()
        )
        machines = []
        for name in draw(distinct(labels, 1, 2)):
            states = draw(distinct(labels, 1, 3))
            transitions = []
            for id in [next(ids) for _ in range(draw(st.integers(0, 3)))]:
                pairs = [(a, b) for a in kinds for b in kinds if kinds[a] == kinds[b]]
                guard, actions = None, list[Assignment | Call]()
                if draw(halves) and pairs:
                    a, b = draw(st.sampled_from(pairs))
                    guard = parse_expression(draw(st.sampled_from(GUARDS[kinds[a]])).format(a, b))
                for a, b in draw(st.lists(st.sampled_from(pairs), max_size=2)) if pairs else ():
                    value = draw(st.sampled_from(VALUES[kinds[a]])).format(a, b)
                    actions.append(Assignment(a, parse_expression(value)))
                if draw(st.integers(0, 4)) == 4:
                    actions.append(Call("pause"))
                source, target = draw(st.sampled_from(states)), draw(st.sampled_from(states))
                duration = draw(st.sampled_from([None, None, (0.0, 2.0)]))
                weight = draw(st.sampled_from([1.0, 1.0, 0.0, 0.1, 3.0]))
                transitions.append(Transition(id, source, target, None, guard, tuple(actions), (), duration, weight))
            final = (states[-1],) if draw(st.booleans()) else ()
            machines.append(Machine(name, draw(st.sampled_from(states)), tuple(states), tuple(transitions), final))
        components.append(Component(owner, tuple(machines), variables, draw(st.sampled_from(["", "a title"]))))
    return Cefsm(draw(labels), tuple(components), doc=draw(st.sampled_from(["", "what it is"])))


units = st.sampled_from(["1", "1", "m/s"])
halves = st.booleans()


def lost(losses: tuple[Loss, ...], *said: str) -> bool:
    return any(all(part in str(loss) for part in said) for loss in losses)


def meaning(guard: Expression | None, variables: tuple[Variable, ...], values: list[dict[str, object]]) -> list[object]:
    """What a guard or value is under each valuation: the same list, the same meaning."""
    if guard is None:
        return [True] * len(values)
    found: list[object] = []
    for valuation in values:
        try:
            found.append(evaluate(guard, valuation))
        except BadModel as error:
            found.append(error.slug)
    return found


def valuations(one: Component, other: Component) -> Iterator[tuple[dict[str, object], dict[str, object]]]:
    """The same random values for the variables of a component under the names of both."""
    source = random.Random(1)
    for _ in range(12):
        pools: dict[str, list[object]] = {
            "bool": [True, False],
            "int": [-3, -1, 0, 1, 2, 8],
            "real": [-1.5, 0.0, 0.25, 0.5, 3.0],
            "text": list(WORDS),
        }
        drawn = [source.choice(pools[each.type]) for each in one.variables]
        yield (
            {each.name: value for each, value in zip(one.variables, drawn, strict=True)},
            {each.name: value for each, value in zip(other.variables, drawn, strict=True)},
        )


def assert_same(model: Cefsm, back: ForeignModel, writing: Writing) -> None:
    """The model that was read is the one that was written but for what the losses name."""
    losses = (*writing.losses, *back.losses)
    assert [each.name for each in back.cefsm.components] == [each.name for each in model.components]
    for one, other in zip(model.components, back.cefsm.components, strict=True):
        assert len(one.variables) == len(other.variables)
        for variable, found in zip(one.variables, other.variables, strict=True):
            assert found.name == variable.name or lost(losses, variable.name, found.name)
            assert found.initial == variable.initial
            assert found.type == ("enum" if found.domain else variable.type)
            assert variable.unit == "1" or lost(losses, variable.name, "unit")
        assert [each.name for each in other.machines] == [each.name for each in one.machines]
        for machine, read in zip(one.machines, other.machines, strict=True):
            place = dict(zip(machine.states, read.states, strict=True))
            assert all(new == old or lost(losses, repr(old), repr(new)) for old, new in place.items())
            assert read.initial == place[machine.initial]
            assert read.final == tuple(map(place.get, machine.final)) or lost(losses, repr(machine.name), "final")
            uneven = {each.source for each in machine.transitions if each.weight != 1}
            for was, now in zip(machine.transitions, read.transitions, strict=True):
                assert now.id == was.id or lost(losses, repr(was.id), repr(now.id))
                assert (now.source, now.target) == (place[was.source], place[was.target])
                pairs = list(valuations(one, other))
                before, after = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
                assert meaning(was.guard, one.variables, before) == meaning(now.guard, other.variables, after)
                steps = [each for each in was.actions if isinstance(each, Assignment)]
                assert len(steps) == len(now.actions)
                for step, taken in zip(steps, now.actions, strict=True):
                    assert isinstance(taken, Assignment)
                    assert meaning(step.value, one.variables, before) == meaning(taken.value, other.variables, after)
                assert len(steps) == len(was.actions) or lost(losses, repr(was.id), "pause()")
                assert was.duration is None or lost(losses, repr(was.id), "duration")
                total = sum(each.weight for each in machine.transitions if each.source == was.source)
                share = was.weight / total if was.source in uneven and total else was.weight
                assert total == 0 or now.weight == pytest.approx(share, abs=1e-9)
    for component in model.components:
        assert not component.title or lost(losses, component.name, "title")
    assert not model.doc or lost(losses, "doc")
    assert back.cefsm.name == model.name or lost(losses, repr(model.name), "name")


@pytest.mark.parametrize("format", FORMATS)
@given(model=models())
@settings(max_examples=30)
def test_what_is_written_reads_back_but_for_what_the_losses_name(format: str, model: Cefsm) -> None:
    assume(all(finding.severity != "error" for finding in findings(model)))
    module = FORMATS[format]
    writing = module.write(model)
    assert_same(model, module.read(writing.text, "model.file"), writing)


def test_every_thing_that_has_no_words_there_is_a_loss() -> None:
    clock = Variable("c", CLOCK, None)
    event = Receive("ask", "it")
    busy = Transition(
        "p1", "a", "b", event, parse_expression("it.n > 1 && k < 2"), (Assignment("k", Name("k")),), (Send("tell"),)
    )
    timed = Transition("p2", "b", "a", None, parse_expression("c < 2 || k == 1"), duration=(1.0, 2.0))
    machine = Machine("m", "a", ("a", "b"), (busy, timed), invariants=(("b", parse_expression("c <= 5")),))
    classes = (MessageClass("Q", ()),)
    variables = (
        Variable("k", "int", 0, domain=range(9)),
        clock,
        Variable("q", "Q", None),
        Variable("o", "bool", None, "input"),
    )
    channels = (Channel("ask", "environment", "C", "Q"), Channel("tell", "C", "environment", "Q"))
    model = Cefsm("x", (Component("C", (machine,), variables),), channels, classes, interactions=(("i", ("C", "C")),))
    losses = graphwalker.write(model).losses
    for said in (
        "ask",
        "tell",
        "it.n > 1",
        "c < 2 || k == 1",
        "c <= 5",
        "1.0 to 2.0",
        "C.c",
        "C.q",
        "C.o",
        "0 to 8",
        "'i'",
    ):
        assert lost(losses, said), said
    assert "k < 2" in graphwalker.write(model).text
