"""Exchangeable components are found by structure, and one case stands for an orbit: Burnside counts agree."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from importlib.resources import files
from itertools import permutations

import pytest

from parcours.abtc import AbstractCase, abstract_cases, case_counts, interchangeable, representatives
from parcours.model import Cefsm, Channel, Component, Machine, Receive, Send, Transition, read_model
from parcours.model.expression import parse_expression

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
OBSTACLES = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))


def served(count: int) -> Cefsm:
    """A hub that asks and is answered by `count` workers, who are called otherwise but are the same."""
    channels, components, asking = [], [], []
    for n in range(count):
        channels += [Channel(f"ask{n}", "Hub", f"W{n}", "T"), Channel(f"tell{n}", f"W{n}", "Hub", "T")]
        asking.append(Transition(f"h{n}a", "idle", "idle", sends=(Send(f"ask{n}"),)))
        asking.append(Transition(f"h{n}b", "idle", "idle", event=Receive(f"tell{n}")))
        hears = Transition(f"w{n}a", f"free{n}", f"busy{n}", event=Receive(f"ask{n}"))
        says = Transition(f"w{n}b", f"busy{n}", f"free{n}", sends=(Send(f"tell{n}"),))
        components.append(Component(f"W{n}", (Machine(f"m{n}", f"free{n}", (f"free{n}", f"busy{n}"), (hears, says)),)))
    hub = Component("Hub", (Machine("m", "idle", ("idle",), tuple(asking)),))
    return Cefsm("served", (hub, *components), tuple(channels))


def movers(count: int) -> Cefsm:
    """Components side by side that can each run two different paths: two machines."""

    def component(n: int) -> Component:
        ring = Machine("ring", "a", ("a", "b"), (Transition(f"r{n}1", "a", "b"), Transition(f"r{n}2", "b", "a")))
        loop = Machine("loop", "c", ("c",), (Transition(f"l{n}", "c", "c"),))
        return Component(f"M{n}", (ring, loop))

    return Cefsm("movers", tuple(component(n) for n in range(count)))


def orbits_by_burnside(labelled: set[tuple[object, ...]], size: int) -> int:
    """The number of orbits under all permutations of the positions: the mean number of fixed points."""
    group = list(permutations(range(size)))
    fixed = sum(tuple(each[at] for at in p) == each for p in group for each in labelled)
    assert fixed % len(group) == 0
    return fixed // len(group)


def test_the_nine_start_vectors_of_three_obstacles_represent_37_and_cannot_be_fewer() -> None:
    found = list(representatives(OBSTACLES, abstract_cases(OBSTACLES)))
    labelled = {vector for case, _ in found for vector in permutations(case.start_vector)}
    assert len(found) == orbits_by_burnside({*labelled}, 3) == 9
    assert sum(size for _, size in found) == len(labelled) == 37
    for case, size in found:
        assert size == len({*permutations(case.start_vector)})


def starting_together(case: tuple[tuple[int, ...], tuple[int, ...]]) -> tuple[object, ...]:
    """What is left of a case when names are forgotten: who starts together, and after whose point the next one."""
    shapes, vector = case
    runs: list[list[int]] = []
    for at, start in enumerate(vector):
        if not at or start != vector[at - 1]:
            runs.append([])
        runs[-1].append(shapes[at])
    steps = sorted({*vector})
    return tuple(
        (start, tuple(sorted(run[:-1] if later else run)), run[-1] if later else None)
        for start, run, later in zip(steps, runs, [*runs[1:], None], strict=True)
    )


@pytest.mark.parametrize("count", [2, 3, 4])
def test_components_with_two_paths_each_keep_one_case_for_each_situation(count: int) -> None:
    model = movers(count)
    cases = list(abstract_cases(model))

    def forgotten(case: AbstractCase) -> tuple[object, ...]:
        shapes = tuple(int(path.name[-1]) for _, path in case.combination.references)
        return starting_together((shapes, case.start_vector))

    kept = list(representatives(model, cases))
    assert Counter(forgotten(case) for case, _ in kept) == Counter({forgotten(case): 1 for case in cases})
    assert len(kept) < len(cases)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_one_worker_of_a_hub_stands_for_all(count: int) -> None:
    model = served(count)
    assert interchangeable(model) == (tuple(f"W{n}" for n in range(count)),)
    cases = list(abstract_cases(model))
    kept = list(representatives(model, cases))
    assert {case.interaction.name for case, _ in kept} == {"ITP1"}
    assert {size for _, size in kept} == {count}
    assert sum(size for _, size in kept) == len(cases) == sum(case_counts(model).values())


def test_no_component_of_ramp_is_like_another() -> None:
    cases = list(abstract_cases(RAMP))
    assert interchangeable(RAMP) == ()
    assert [(case, 1) for case in cases] == list(representatives(RAMP, cases))


def changed(model: Cefsm, **what: object) -> Cefsm:
    """The model of the hub with one thing changed about the last worker's second transition."""
    *others, last = model.components
    (machine,) = last.machines
    first, second = machine.transitions
    second = replace(second, **what)  # type: ignore[arg-type]
    last = replace(last, machines=(replace(machine, transitions=(first, second)),))
    return replace(model, components=(*others, last))


def test_whatever_makes_a_difference_ends_the_likeness() -> None:
    model = served(3)
    two = (("W0", "W1"),)
    assert interchangeable(changed(model, guard=parse_expression("true"))) == two
    assert interchangeable(changed(model, target="busy2")) == two
    assert interchangeable(changed(model, sends=())) == two
    assert interchangeable(changed(model, weight=2.0)) == two
    slow = tuple(replace(each, capacity=2) if each.name == "ask2" else each for each in model.channels)
    assert interchangeable(replace(model, channels=slow)) == two
    hub = model.components[0].machines[0]
    picky = replace(
        hub, states=("idle", "done"), transitions=(*hub.transitions[:-1], replace(hub.transitions[-1], target="done"))
    )
    treated = replace(model, components=(replace(model.components[0], machines=(picky,)), *model.components[1:]))
    assert interchangeable(treated) == two


def test_two_peers_that_talk_with_each_other_are_alike_unless_one_is_the_hub() -> None:
    def peer(name: str, other: str) -> Component:
        says = Transition(f"{name}1", "s", "s", sends=(Send(f"{name}{other}"),))
        hears = Transition(f"{name}2", "s", "s", event=Receive(f"{other}{name}"))
        asks = Transition(f"{name}3", "s", "s", sends=(Send(f"{name}H"),))
        return Component(name, (Machine("m", "s", ("s",), (says, hears, asks)),))

    listens = [Transition(f"H{n}", "s", "s", event=Receive(f"{n}H")) for n in "ABZ"]
    third = Component("Z", (Machine("m", "s", ("s",), (Transition("Z1", "s", "s", sends=(Send("ZH"),)),)),))
    hub = Component("H", (Machine("m", "s", ("s",), tuple(listens)),))
    ends = [("A", "B"), ("B", "A"), ("A", "H"), ("B", "H"), ("Z", "H")]
    channels = tuple(Channel(a + b, a, b, "T") for a, b in ends)
    model = Cefsm("peers", (hub, peer("A", "B"), peer("B", "A"), third), channels)
    assert interchangeable(model) == (("A", "B"),)
    alone = Cefsm("pair", model.components[1:3], channels)
    assert interchangeable(alone) == ()
