"""Serialised execution sequences are counted, drawn and listed as a search over all total orders finds them."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from importlib.resources import files
from itertools import islice, permutations
from math import factorial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.abtc import (
    Order,
    abstract_cases,
    combinations,
    count_sequences,
    interaction_paths,
    order_of,
    order_of_case,
    sample_sequences,
    sequences,
    serialise,
    side_by_side,
)
from parcours.errors import BadRequest
from parcours.model import Cefsm, Channel, Component, Machine, Receive, Send, Transition, read_model
from parcours.paths import InternalPath, internal_paths

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
OBSTACLES = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))
PATHS = {path.name: path for paths in internal_paths(RAMP).values() for path in paths}
MOVES = [path for paths in internal_paths(OBSTACLES).values() for path in paths]


@st.composite
def orders(draw: st.DrawFn) -> Order:
    """Up to four short paths with waits and meetings that follow one hidden total order, so never a circle."""
    lengths = draw(st.lists(st.integers(0, 3), min_size=1, max_size=4).filter(lambda found: sum(found) <= 7))
    places = [(path, at) for path, length in enumerate(lengths) for at in range(length)]
    hidden = draw(st.permutations([path for path, _ in places]))
    rank = {}
    seen: Counter[int] = Counter()
    for number, path in enumerate(hidden):
        rank[path, seen[path]] = number
        seen[path] += 1
    pairs = [(a, b) for a in places for b in places if a[0] != b[0] and rank[a] < rank[b]]
    before = draw(st.lists(st.sampled_from(pairs), max_size=3)) if pairs else []
    near = [(a, b) for a, b in pairs if rank[b] == rank[a] + 1]
    together = draw(st.lists(st.sampled_from(near), max_size=1)) if near else []
    before = [pair for pair in before if not {*pair} & {place for both in together for place in both}]
    return Order.of([[f"{path}{at}" for at in range(length)] for path, length in enumerate(lengths)], before, together)


def brute(order: Order) -> list[tuple[int, ...]]:
    """Every total order of the events, kept if no event comes before one that it needs."""
    return [
        line
        for line in permutations(range(len(order.names)))
        if all(line.index(need) < line.index(event) for event, needs in enumerate(order.needs) for need in needs)
    ]


@given(orders())
@settings(max_examples=120)
def test_count_and_list_are_those_of_all_permutations(order: Order) -> None:
    expected = brute(order)
    assert list(sequences(order)) == expected  # permutations come in lexicographic order, too
    assert count_sequences(order) == len(expected)
    legal = {order.spelled(line) for line in expected}
    assert {order.spelled(drawn) for drawn in sample_sequences(order, 20, seed=3)} <= legal
    for line in islice(permutations(order.names), 50):
        assert (order.fault(line) == "") == (line in legal)


@pytest.mark.parametrize(
    ("paths", "whole", "changes"),
    [
        ("tp12 tp21", 462, 20),
        ("tp12 tp31", 462, 20),
        ("tp11 tp51", 56, 10),
        ("tp11 tp41 tp42", 18_480, 756),
        ("tp41 tp42 tp11 tp51", 114_354_240, 166_320),
    ],
)
def test_the_sizes_of_the_interactions_of_the_study(paths: str, whole: int, changes: int) -> None:
    chosen = [PATHS[name] for name in paths.split()]
    assert count_sequences(side_by_side(chosen)) == whole
    assert count_sequences(side_by_side(chosen, changes_only=True)) == changes


LONGEST = ("tp61", "tp11", "tp12", "tp21", "tp31", "tp41", "tp42")
"""All paths of the components of ITP5."""


def test_the_longest_interaction_has_4e22_sequences() -> None:
    chosen = [PATHS[name] for name in LONGEST]
    assert f"{count_sequences(side_by_side(chosen)):.2e}" == "4.08e+22"
    assert f"{count_sequences(side_by_side(chosen, changes_only=True)):.2e}" == "1.17e+13"


def test_three_obstacles_have_90_sequences_and_1680_of_their_states() -> None:
    assert count_sequences(side_by_side(MOVES)) == 90
    assert count_sequences(Order.of([path.states for path in MOVES])) == 1680


@given(st.lists(st.integers(0, 40), max_size=8))
def test_independent_paths_give_the_multinomial(lengths: list[int]) -> None:
    expected = factorial(sum(lengths))
    for length in lengths:
        expected //= factorial(length)
    assert count_sequences(Order.of([[f"{n}"] * length for n, length in enumerate(lengths)])) == expected


def test_the_rendezvous_of_a_combination_are_kept_whichever_sequence_is_drawn() -> None:
    for interaction in interaction_paths(RAMP):
        (combination,) = combinations(RAMP, interaction).kept
        order = order_of(RAMP, combination)
        assert 0 < count_sequences(order) < count_sequences(side_by_side([p for _, p in combination.references]))
        drawn = [order.spelled(each) for each in sample_sequences(order, 5, seed=1)]
        for each in drawn:
            for hop, met in enumerate(combination.meetings):
                for meeting in met:
                    if not meeting.stand_in:
                        check_meeting(each, hop, meeting.sender, meeting.receiver, meeting.channel)


def check_meeting(
    events: tuple[str, ...], hop: int, sender: InternalPath, receiver: InternalPath, channel: str
) -> None:
    """The first receive of a channel comes after the first send of the visit before."""
    sends = [t.id for t in sender.transitions if any(send.channel == channel for send in t.sends)]
    receives = [t.id for t in receiver.transitions if t.event and t.event.channel == channel]
    at = [number for number, event in enumerate(events) if event.split()[1] in sends and event.startswith(sender.name)]
    to = [number for number, event in enumerate(events) if event.split()[1] in receives]
    assert min(at) < max(to)


def test_the_sequence_of_a_case_is_one_of_those_that_its_order_allows() -> None:
    for case in islice(abstract_cases(RAMP), 19):
        order = order_of_case(case)
        events = [f"{event.path}#{event.reference} {event.transition}" for event in serialise(case)]
        assert order.fault(events) == ""
        assert count_sequences(order) >= 1


def test_a_rendezvous_without_a_queue_is_one_event() -> None:
    def model(capacity: int) -> Cefsm:
        asks = Machine("m", "s", ("s",), (Transition("a", "s", "s", sends=(Send("ask"),)),))
        hears = Machine("m", "s", ("s",), (Transition("b", "s", "s", event=Receive("ask")),))
        link = (Channel("ask", "A", "B", "T", capacity=capacity), Channel("back", "B", "A", "T"))
        return Cefsm("m", (Component("A", (asks,)), Component("B", (hears,))), link, interactions=(("I", ("A", "B")),))

    for capacity, names, number in ((0, ("tp11#0 a+tp21#1 b",), 1), (1, ("tp11#0 a", "tp21#1 b"), 1)):
        cefsm = model(capacity)
        (combination,) = combinations(cefsm, interaction_paths(cefsm)[-1]).kept
        order = order_of(cefsm, combination)
        assert order.names == names and count_sequences(order) == number


def test_every_sequence_is_equally_likely_to_be_drawn() -> None:
    order = Order.of([["a1", "a2", "a3"], ["b1", "b2"], ["c1"]], [((0, 0), (1, 0))])
    every = list(sequences(order))
    drawn = Counter(sample_sequences(order, 200 * len(every), seed=5))
    assert set(drawn) == set(every) and len(every) > 30
    squares = sum((drawn[each] - 200) ** 2 / 200 for each in every)
    degrees = len(every) - 1
    assert squares < degrees + 4 * (2 * degrees) ** 0.5  # four standard deviations of chi-square


def test_the_same_seed_draws_the_same_sequences() -> None:
    order = side_by_side([PATHS["tp12"], PATHS["tp21"]])
    assert list(sample_sequences(order, 9, seed=4)) == list(sample_sequences(order, 9, seed=4))
    assert list(sample_sequences(order, 9, seed=4)) != list(sample_sequences(order, 9, seed=5))


def test_sequences_are_listed_in_constant_memory() -> None:
    order = side_by_side([PATHS[name] for name in LONGEST])
    listing = sequences(order)
    next(listing)
    tracemalloc.start()
    for _ in islice(listing, 20_000):
        pass
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100_000


def test_too_many_positions_are_refused_before_memory_is_gone() -> None:
    chain = [[f"{n}.{at}" for at in range(9)] for n in range(9)]
    knot = Order.of(chain, [((n, 0), (n + 1, 1)) for n in range(8)])
    with pytest.raises(BadRequest, match=r"9 paths that wait for each other may have at most 5000.*too-many-positions"):
        count_sequences(knot, most_positions=5000)
    assert len(next(sequences(knot))) == 81  # one by one they need no count


def test_paths_that_wait_for_each_other_in_a_circle_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"some of a1\+b2, a2, b1 do.*circular-order"):
        Order.of([["a1", "a2"], ["b1", "b2"]], together=[((0, 0), (1, 1))], before=[((0, 1), (1, 0))])


def test_equal_names_are_told_apart() -> None:
    assert Order.of([["a", "b"], ["a", "a#1"]]).names == ("a#2", "b", "a#3", "a#1")
