"""Orders of an abstract case: all, drawn ones and those of PCT keep what the case demands, and come again by name."""

from __future__ import annotations

import random
from collections import Counter
from importlib.resources import files

import pytest

from parcours.abtc import (
    AbstractCase,
    Event,
    Order,
    abstract_cases,
    count_sequences,
    find_case,
    in_order,
    order_names,
    order_of_case,
    parse_orders,
    serialise,
)
from parcours.abtc.ordering import by_priorities
from parcours.errors import BadRequest
from parcours.model import read_model

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
CASES = [
    case for case in abstract_cases(RAMP) if 5 < len(serialise(case)) < 12 and count_sequences(order_of_case(case)) > 3
][:6]


def key(events: tuple[Event, ...]) -> tuple[tuple[int, str], ...]:
    return tuple((event.reference, event.transition) for event in events)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_all_orders_are_there_once_and_each_is_one_that_the_case_allows(case: AbstractCase) -> None:
    events, order = serialise(case), order_of_case(case)
    names = order_names(case.id, events, parse_orders("all"), seed=1)
    found = [in_order(case.id, events, name, seed=1) for name in names]
    assert len({key(one) for one in found}) == len(names) == count_sequences(order)
    assert key(events) in {key(one) for one in found}
    for one in found:
        spelled = [f"{event.path}#{event.reference} {event.transition}" for event in one]
        if len(set(spelled)) == len(spelled):
            assert not order.fault(spelled)
        for at, event in enumerate(one):
            assert event.position == at and (not at or at - 1 in event.after)
            assert event.before is None or event.before > at
            got = event.receives
            if got is not None and got.event is not None:
                assert got.event < at and got.channel in {sent.channel for sent in one[got.event].sends}


@pytest.mark.parametrize("asked", ["3", "pct:1:4", "pct:3:5"])
def test_drawn_orders_differ_and_come_again_by_name_and_seed(asked: str) -> None:
    case = max(CASES, key=lambda one: count_sequences(order_of_case(one)))
    events = serialise(case)
    names = order_names(case.id, events, parse_orders(asked), seed=7)
    found = {name: key(in_order(case.id, events, name, seed=7)) for name in names}
    assert len(set(found.values())) == len(found) >= 1
    assert found == {name: key(in_order(case.id, events, name, seed=7)) for name in reversed(names)}
    assert in_order(case.id, events, "", seed=7) == events


def test_where_no_more_are_wanted_than_there_are_all_are_taken() -> None:
    case = CASES[0]
    n = count_sequences(order_of_case(case))
    assert order_names(case.id, serialise(case), parse_orders(str(n)), 1) == tuple(map(str, range(n)))


def test_pct_finds_what_takes_d_events_in_an_order_of_their_own_as_often_as_it_promises() -> None:
    paths = [["a1", "a2", "a3", "a4"], ["b1", "b2", "b3", "b4"]]
    order = Order.of(paths)
    a2, b2, a3 = (order.names.index(name) for name in ("a2", "b2", "a3"))
    draw, hits = random.Random(3), Counter[int]()
    for _ in range(5000):
        for depth in (1, 2):
            run = by_priorities(order, depth, draw)
            assert sorted(run) == list(range(8)) and not order.fault(order.spelled(run))
            hits[depth] += run.index(a2) < run.index(b2) < run.index(a3)  # b2 between a2 and a3
    assert hits[1] == 0, "paths whose priorities never change run one after the other"
    assert hits[2] / 5000 == pytest.approx(1 / (2 * 8), abs=0.01), "1 / (n k^(d - 1)), here exactly"


def test_more_than_ten_thousand_are_refused_and_some_are_offered() -> None:
    case = next(one for one in abstract_cases(RAMP) if count_sequences(order_of_case(one)) > 10_000)
    with pytest.raises(BadRequest, match=r"at most 10000.*more.*--orders 100.*orders-many"):
        order_names(case.id, serialise(case), parse_orders("all"), 1)
    assert len(order_names(case.id, serialise(case), parse_orders("20"), 1)) == 20


@pytest.mark.parametrize("text", ["", "some", "0", "10001", "pct", "pct:0", "pct:3:0", "-1", "all,2"])
def test_what_asks_for_no_orders_is_refused(text: str) -> None:
    with pytest.raises(BadRequest, match="orders-form"):
        parse_orders(text)


@pytest.mark.parametrize("name", ["99999", "x", "draw.", "pct0.1", "1/2", "draw.1.2"])
def test_a_name_of_no_order_is_refused(name: str) -> None:
    case = find_case(RAMP, CASES[0].id)
    with pytest.raises(BadRequest, match="order-unknown"):
        in_order(case.id, serialise(case), name, 1)
