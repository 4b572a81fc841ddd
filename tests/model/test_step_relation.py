"""The step relation agrees with a slow, obvious interpreter, on queues, rendezvous and the tester too."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel, BadRequest
from parcours.model import (
    Cefsm,
    Channel,
    Component,
    Configuration,
    Field,
    Machine,
    MessageClass,
    Move,
    Receive,
    Send,
    StepRelation,
    Transition,
    Variable,
    enabled,
    initial,
    parse_model,
    read_model,
    step,
)
from parcours.model.expression import Assignment, evaluate, parse_expression

GUARDS = ["true", "go", "!go", "n > 0", "n < 2 && go", "got.k == 1 || n == 0", "kind == 'a'", "kind == 'b' && go"]
VALUES = ["0", "2 - n", "(n + 1) % 3", "min(n, 1)"]


@st.composite
def small_models(draw: st.DrawFn) -> Cefsm:
    channels = (
        Channel("ab", "A", "B", "M", capacity=draw(st.integers(1, 2))),
        Channel("ba", "B", "A", "M", capacity=1),
        Channel("out", "A", "environment", "M"),
    )
    components = []
    for owner, reads, writes in (("A", "ba", ["ab", "out"]), ("B", "ab", ["ba"])):
        transitions = []
        for at in range(draw(st.integers(1, 4))):
            event = draw(st.sampled_from([None, Receive(reads, "got")]))
            guard = draw(st.sampled_from([text for text in GUARDS if event or "got" not in text]))
            value = parse_expression(draw(st.sampled_from(VALUES + (["got.k"] if event else []))))
            actions = draw(st.sampled_from([(), (Assignment("n", value),)]))
            said = parse_expression(draw(st.sampled_from(["n", "1", "(n + 1) % 2"])))
            sends = draw(st.sampled_from([(), *((Send(name, (said,)),) for name in writes)]))
            ends = draw(st.tuples(st.sampled_from("xy"), st.sampled_from("xy")))
            transitions.append(Transition(f"{owner}{at}", *ends, event, parse_expression(guard), actions, sends))
        own = (
            Variable("n", "int", 1, domain=range(3)),
            Variable("go", "bool", None, "input"),
            Variable("kind", "enum", None, "input", ("a", "b")),
        )
        components.append(Component(owner, (Machine("m", "x", ("x", "y"), tuple(transitions)),), own))
    return Cefsm("small", tuple(components), channels, (MessageClass("M", (Field("k", "int"),)),))


def obvious(model: Cefsm, here: Configuration) -> set[tuple[str, Configuration]]:
    # Try every transition with every value of every input; queues are "ab" and "ba", variables A.n and B.n.
    found, names = set(), [channel.name for channel in model.channels[:2]]
    order = [
        name
        for name in names
        if any(t.event and t.event.channel == name for c in model.components for t in c.transitions())
    ]
    for slot, component in enumerate(model.components):
        for transition, go, kind in product(component.transitions(), (False, True), "ab"):
            if here.states[slot] != transition.source:
                continue
            queues = dict(zip(order, here.queues, strict=True))
            local: dict[str, object] = {"n": here.values[slot], "go": go, "kind": kind}
            if transition.event is not None:
                if not queues.get(transition.event.channel):
                    continue
                message, *rest = queues[transition.event.channel]
                queues[transition.event.channel] = tuple(rest)
                local["got"] = dict(message)
            assert transition.guard is not None
            if not evaluate(transition.guard, local):
                continue
            for action in transition.actions:
                assert isinstance(action, Assignment)
                local[action.target] = evaluate(action.value, local)
            full = False
            for send in transition.sends:
                if send.channel in queues:
                    queues[send.channel] = (*queues[send.channel], (("k", evaluate(send.payload[0], local)),))
                    full |= len(queues[send.channel]) > model.channel(send.channel).capacity
            if full:
                continue
            states, values = list(here.states), list(here.values)
            states[slot], values[slot] = transition.target, local["n"]
            after = Configuration(tuple(states), tuple(values), tuple(queues[name] for name in order))
            found.add((transition.id, after))
    return found


@given(small_models(), st.randoms(use_true_random=False))
@settings(deadline=None)
def test_a_walk_sees_at_every_step_what_the_obvious_interpreter_sees(model: Cefsm, source: object) -> None:
    here = initial(model)
    for _ in range(6):
        moves = enabled(model, here)
        after = [(move.transition, step(model, here, move)) for move in moves]
        assert set(after) == obvious(model, here)
        assert len(after) == len(set(moves))
        if not after:
            break
        here = after[source.randrange(len(after))][1]  # type: ignore[attr-defined]


def test_obstacles_reach_every_combination_of_standing_and_moving() -> None:
    model = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))
    seen, border = {initial(model)}, [initial(model)]
    while border:
        here = border.pop()
        for move in enabled(model, here):
            after = step(model, here, move)
            if after not in seen:
                seen.add(after)
                border.append(after)
    assert len(seen) == 2**3


PAIR = """
parcours: model/1
name: pair
messages: {Note: {fields: {k: {type: int}, sure: {type: bool}}}}
channels:
  tell: {from: A, to: B, message: Note, capacity: 1}
  lost: {from: B, to: A, message: Note}
  news: {from: environment, to: A, message: Note}
components:
  A:
    variables:
      n: {type: int, initial: 0, range: [0, 3]}
      fast: {type: bool, role: input}
    machines:
      m:
        initial: x
        transitions:
          a1: {from: x, to: y, action: n := n + 1, message: "tell(n, fast)"}
          a2: {from: y, to: x, event: news(it), guard: it.sure && it.k > n}
  B:
    variables: {sum: {type: int, initial: 0}, sure: {type: bool, initial: false}}
    machines:
      m:
        initial: u
        transitions:
          b1: {from: u, to: u, event: tell(it), guard: "it.k > 0", message: lost,
               action: sum := sum + it.k; sure := it.sure}
"""


def moves(model: Cefsm, here: Configuration, **more: object) -> list[str]:
    return [str(move) for move in enabled(model, here, **more)]  # type: ignore[arg-type]


def test_a_message_carries_its_values_and_open_inputs_give_one_move_each() -> None:
    model = parse_model(PAIR)
    here = initial(model)
    slow, fast = enabled(model, here)
    assert (slow.inputs, fast.inputs) == ((("A.fast", False),), (("A.fast", True),))
    sent = step(model, here, fast)
    assert sent.queues == (((("k", 1), ("sure", True)),),)
    received = step(model, sent, enabled(model, sent)[-1])
    assert received.values == (1, 1, True) and received.queues == ((),)


def test_a_full_queue_blocks_and_an_unread_channel_does_not() -> None:
    model = parse_model(PAIR)
    here = initial(model)
    for _ in range(2):
        here = step(model, here, enabled(model, here)[0])
        assert moves(model, here).count("b1") <= 1
    assert here.states[0] == "x" and here.queues != ((),)
    assert moves(model, here) == ["b1"]
    assert moves(model, here, opened={"tell"}) == ["a1", "b1", "b1"]


def test_the_tester_supplies_what_the_guard_needs() -> None:
    model = parse_model(PAIR)
    here = step(model, initial(model), enabled(model, initial(model))[0])
    asked = [move for move in enabled(model, here) if move.transition == "a2"]
    assert [name for name, _ in asked[0].inputs] == ["A.it.k", "A.it.sure"] and len(asked) == 1
    assert [move for move in enabled(model, here, {"A.it.sure": False}) if move.transition == "a2"] == []
    assert step(model, here, asked[0]).states == ("x", "u")


def test_inputs_that_are_given_decide() -> None:
    model = parse_model(PAIR)
    [move] = enabled(model, initial(model), {"A.fast": True})
    assert move.inputs == (("A.fast", True),)
    assert step(model, initial(model), move).queues == (((("k", 1), ("sure", True)),),)
    with pytest.raises(BadRequest, match=r"did you mean 'A\.fast'"):
        enabled(model, initial(model), {"A.fats": True})
    with pytest.raises(BadRequest, match="unknown-input"):
        enabled(model, initial(model), {"A.n": 2})


def test_opened_channels_are_played_by_the_tester_at_both_ends() -> None:
    model = parse_model(PAIR)
    here = initial(model)
    assert "b1" not in moves(model, here) and "b1" in moves(model, here, opened={"tell"})
    sent, *_ = enabled(model, here, opened={"tell"})
    assert step(model, here, sent, opened={"tell"}).queues == ((),)
    with pytest.raises(BadRequest, match="only channels"):
        enabled(model, here, opened={"tlel"})


def test_a_value_that_leaves_its_domain_is_an_error_that_names_the_variable() -> None:
    model = parse_model(PAIR)
    here = replace(initial(model), values=(3, 0, False))
    with pytest.raises(BadModel, match=r"'A.n' must stay in its domain 0 .. 3"):
        step(model, here, enabled(model, here, opened={"tell"})[0], opened={"tell"})


RENDEZVOUS = PAIR.replace("capacity: 1", "capacity: 0")


def test_a_rendezvous_is_one_step_of_two() -> None:
    model = parse_model(RENDEZVOUS)
    here = initial(model)
    assert moves(model, here) == ["a1+b1", "a1+b1"]
    slow, fast = enabled(model, here)
    assert step(model, here, slow).values == (1, 1, False) and step(model, here, fast).values == (1, 1, True)
    assert step(model, here, fast).states == ("y", "u")


def test_a_rendezvous_waits_for_the_guard_of_the_partner() -> None:
    model = parse_model(RENDEZVOUS.replace("it.k > 0", "it.k > 1"))
    assert moves(model, initial(model)) == []


@pytest.mark.parametrize(
    ("text", "move", "why"),
    [
        (PAIR, Move("a2"), "starts in 'y'"),
        (PAIR, Move("b1"), "nothing to receive"),
        (PAIR, Move("zz"), "does not"),
        (PAIR, Move("a1", "b1"), "a rendezvous has two"),
        (RENDEZVOUS, Move("a1"), "a rendezvous has two"),
        (RENDEZVOUS, Move("b1"), "waits for a rendezvous"),
        (
            PAIR.replace("from: x, to: y,", "from: x, to: y, guard: fast,"),
            Move("a1", "", (("A.fast", False),)),
            "guard",
        ),
    ],
)
def test_an_impossible_move_says_why(text: str, move: Move, why: str) -> None:
    model = parse_model(text)
    with pytest.raises(BadRequest, match=why):
        step(model, initial(model), move)


def test_two_equal_models_do_not_share_their_tables() -> None:
    one, two = parse_model(PAIR), parse_model(PAIR.replace("n := n + 1", "n := n + 2"))
    assert [
        step(model, initial(model), StepRelation(model).enabled(initial(model), {})[0]).values[0]
        for model in (one, two)
    ] == [1, 2]
