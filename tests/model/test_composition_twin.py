"""The state space agrees with a slow, obvious search that asks the step relation at every configuration."""

from __future__ import annotations

from collections import deque

from hypothesis import example, given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel
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
    step,
)
from parcours.model.composition import Space, explore
from parcours.model.expression import Assignment, parse_expression

GUARDS = ["true", "true", "true", "true", "go", "!go", "n > 0", "n < 2 && go", "got.k == 1 || n == 0", "got.k != n"]
VALUES = ["0", "2 - n", "(n + 1) % 3", "n + 1", "got.k"]
SAID = ["n", "1", "(n + 1) % 2"]
BOUND = 400


@st.composite
def models(draw: st.DrawFn) -> Cefsm:
    """Two or three components, one with two machines; queues, rendezvous, loops back to oneself, open inputs."""
    names = "ABC"[: draw(st.integers(2, 3))]
    channels = [
        Channel(f"{a}{b}".lower(), a, b, "M", capacity=draw(st.sampled_from([0, 0, 1, 2])))
        for a in names
        for b in names
        if a != b or draw(st.booleans())
    ]
    channels = [each for each in channels if each.sender != each.receiver or each.sender == "A" or each.capacity]
    channels += [Channel("in", "environment", "A", "M"), Channel("out", names[-1], "environment", "M")]
    components = []
    for owner in names:
        machines = tuple(draw(machine(owner, part, channels)) for part in ("m", "w")[: 2 if owner == "A" else 1])
        own = (Variable("n", "int", 1, domain=range(3)), Variable("go", "bool", None, "input"))
        components.append(Component(owner, machines, own))
    return Cefsm("small", tuple(components), tuple(channels), (MessageClass("M", (Field("k", "int"),)),))


@st.composite
def machine(draw: st.DrawFn, owner: str, name: str, channels: list[Channel]) -> Machine:
    transitions = []
    for at in range(draw(st.integers(2, 5))):
        reads = [each for each in channels if each.receiver == owner]
        taken = draw(st.sampled_from([None, *reads]))
        event = Receive(taken.name, "got") if taken else None
        meets = taken is not None and not taken.capacity and taken.sender != "environment"
        told = [each for each in channels if each.sender == owner and (each.capacity or not meets)]
        sent = draw(st.sampled_from([None, *told]))
        # Two transitions that meet in one component call their messages differently; a fault of a sender that meets
        # stops `enabled`.
        meets = sent is not None and not sent.capacity
        inner = any(each is not None and each.name == "aa" and not each.capacity for each in (taken, sent))
        named = event is not None and not (inner and meets)
        guards = [text for text in GUARDS if named or "got" not in text]
        values = [text for text in VALUES[: 3 if meets or inner else None] if named or "got" not in text]
        guard = draw(st.sampled_from(guards))
        action = Assignment("n", parse_expression(draw(st.sampled_from(values))))
        actions = draw(st.sampled_from([(), (action,)]))
        sends = (Send(sent.name, (parse_expression(draw(st.sampled_from(SAID))),)),) if sent else ()
        ends = draw(st.tuples(st.sampled_from("xy"), st.sampled_from("xxyyz")))
        transitions.append(Transition(f"{owner}{name}{at}", *ends, event, parse_expression(guard), actions, sends))
    return Machine(name, "x", ("x", "y", "z"), tuple(transitions), final=draw(st.sampled_from([(), ("x",)])))


class Naive:
    """What a search finds that keeps whole configurations and works nothing out beforehand."""

    def __init__(self, cefsm: Cefsm) -> None:
        steps = StepRelation(cefsm)
        start = steps.layout.initial()
        self.distance = {start: 0}
        self.edges: list[tuple[Configuration, Move, Configuration]] = []
        self.faults: dict[Move, int] = {}
        self.ends: list[Configuration] = []
        waiting = deque([start])
        while waiting and len(self.distance) <= BOUND:
            here = waiting.popleft()
            moves = steps.enabled(here, {})
            if not moves:
                self.ends.append(here)
            for move in moves:
                try:
                    after = steps.step(here, move)
                except BadModel:
                    self.faults.setdefault(move, self.distance[here])
                    continue
                self.edges.append((here, move, after))
                if after not in self.distance:
                    self.distance[after] = self.distance[here] + 1
                    waiting.append(after)
        self.complete = not waiting


def depth(space: Space, state: int | None) -> int:
    assert state is not None
    return len(space.path_to(state))


def walked(space: Space, state: int | None) -> Configuration:
    """Where the witness leads when the step relation takes it."""
    assert state is not None
    here = space.configuration(0)
    for move in space.path_to(state):
        here = step(space.cefsm, here, move)
    return here


def can_still_take(twin: Naive, cefsm: Cefsm, channel: str) -> set[Configuration]:
    events = {each.id: each.event for component in cefsm.components for each in component.transitions()}
    able: set[Configuration] = set()
    grown = True
    while grown:
        grown = False
        for here, move, after in twin.edges:
            event = events[move.transition]
            if here not in able and (after in able or (event is not None and event.channel == channel)):
                able.add(here)
                grown = True
    return able


def doubtful() -> Cefsm:
    """The environment may say more than `n` can hold, and nobody ever sends what Am1 waits for."""
    takes = Transition("Am0", "x", "x", Receive("in", "got"), actions=(Assignment("n", parse_expression("got.k")),))
    waits = Transition("Am1", "x", "y", Receive("ba", "got"))
    a = Component("A", (Machine("m", "x", ("x", "y"), (takes, waits)),), (Variable("n", "int", 1, domain=range(3)),))
    b = Component("B", (Machine("m", "x", ("x",), (Transition("Bm0", "x", "x"),)),))
    channels = (Channel("ba", "B", "A", "M"), Channel("in", "environment", "A", "M"))
    return Cefsm("doubtful", (a, b), channels, (MessageClass("M", (Field("k", "int"),)),))


def test_nothing_is_called_dead_where_not_every_value_was_tried() -> None:
    space = explore(doubtful())
    assert space.complete and space.doubts and not space.exact
    assert not [each for each in space.findings if each.kind == "dead-transition"]


@given(models())
@example(doubtful())
@settings(max_examples=150)
def test_states_moves_and_findings_are_those_of_a_naive_search(cefsm: Cefsm) -> None:
    twin = Naive(cefsm)
    space = explore(cefsm, max_states=BOUND)
    if not twin.complete:
        assert not space.complete or space.n_states <= BOUND
        return
    assert space.complete and space.n_states == len(twin.distance)
    everything = [space.configuration(state) for state in range(space.n_states)]
    assert set(everything) == set(twin.distance)
    assert [twin.distance[each] for each in everything] == [depth(space, n) for n in range(space.n_states)]
    edges = [
        (everything[source], space.moves[label], everything[target])
        for source, label, target in zip(space.sources, space.labels, space.targets, strict=True)
    ]
    assert len(edges) == len(twin.edges) and set(edges) == set(twin.edges)
    check_findings(cefsm, twin, space)


def check_findings(cefsm: Cefsm, twin: Naive, space: Space) -> None:
    found = {kind: [each for each in space.findings if each.kind == kind] for kind in ("deadlock", "rest")}
    assert sum(each.count for kind in found.values() for each in kind) == len(twin.ends)
    final = {(c.name, m.name): {*m.final} for c in cefsm.components for m in c.machines}
    left = {(c.name, m.name): {t.source for t in m.transitions} for c in cefsm.components for m in c.machines}
    resting = [
        end
        for end in twin.ends
        if not any(end.queues)
        and all(
            state in final[name] or state not in left[name]
            for name, state in zip(space.packing.layout.machines, end.states, strict=True)
        )
    ]
    assert sum(each.count for each in found["rest"]) == len(resting)
    faults = {each.move: depth(space, each.state) for each in space.findings if each.kind == "model-fault"}
    assert faults == twin.faults
    for each in space.findings:
        if each.state is not None:
            assert walked(space, each.state) == space.configuration(each.state)
    if twin.faults:
        return
    for at, channel in enumerate(space.packing.layout.channels):
        able = can_still_take(twin, cefsm, channel)
        lost = [each for each in twin.distance if each.queues[at] and each not in able]
        said = [each for each in space.findings if each.kind.endswith("reception") and f"of {channel}" in each.message]
        assert sum(each.count for each in said) == len(lost)
        if lost:
            assert min(depth(space, each.state) for each in said) == min(map(twin.distance.__getitem__, lost))
    taken = {id for _, move, _ in twin.edges for id in (move.transition, move.partner)}
    stood = {(at, state) for here in twin.distance for at, state in enumerate(here.states)}
    dead = {
        f"no run takes {t.id} of {owner}"
        for at, (owner, name) in enumerate(space.packing.layout.machines)
        for m in cefsm.component(owner).machines
        if m.name == name
        for t in m.transitions
        if t.id not in taken and (at, t.source) in stood
    }
    # Of values that were not tried nobody knows what they let happen (docs/composition.md).
    assert {each.message for each in space.findings if each.kind == "dead-transition"} == (
        dead if space.exact else set()
    )
