"""Traces against small models: what deviates, where it is found, what was expected, and what is nobody's fault."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import get_args

import pytest

from parcours.errors import BadRequest
from parcours.model import parse_model
from parcours.model.structure import Machine, Transition
from parcours.run.trace import Kind, Trace, TraceEvent
from parcours.verdict.conformance import Checker, Conformance, check
from parcours.verdict.judgement import Verdict

SHOP = parse_model("""
parcours: model/1
name: shop
messages:
  Order: {fields: {size: {type: int}}}
  Bill: {fields: {price: {type: int}}}
channels:
  order: {from: Client, to: Server, message: Order, topic: /shop}
  bill: {from: Server, to: Client, message: Bill, topic: /shop}
  news: {from: Server, to: Client, message: Bill, capacity: 3}
components:
  Client:
    machines:
      buying:
        initial: hungry
        transitions:
          buy: {from: hungry, to: waiting, message: order(3)}
          pay: {from: waiting, to: hungry, event: bill(b)}
          read: {from: hungry, to: hungry, event: news(n)}
  Server:
    variables:
      ordered: {type: int, initial: 0, range: [0, 100]}
    machines:
      serving:
        initial: idle
        transitions:
          accept: {from: idle, to: cooking, event: order(o), guard: o.size > 0, action: ordered := o.size}
          refuse: {from: idle, to: idle, event: order(o), guard: o.size <= 0}
          serve: {from: cooking, to: idle, message: bill(ordered * 2)}
          tell: {from: idle, to: idle, message: news(1)}
""")


SERVER = SHOP.component("Server")
CAT = Machine("cat", "asleep", ("asleep",), (Transition("stroke", "asleep", "asleep"),))


def trace(*lines: str) -> Trace:
    """One event a line: `Client take buy`, or `Client send order 0`; a number before it is its time [ms]."""
    events, time = [], 0
    for line in lines:
        words = line.split()
        if words[0].isdigit():
            time = int(words.pop(0))
        component, kind, name, *rest = words
        number = int(rest[0]) if rest else -1
        is_take = kind == "take"
        payload = {"price": int(rest[1])} if len(rest) > 1 else None
        event = TraceEvent(
            time * 1_000_000, _KINDS[kind], component, name if is_take else "", "" if is_take else name, number, "",
            payload,
        )  # fmt: skip
        events.append(event)
    return Trace("wall", tuple(events))


_KINDS: dict[str, Kind] = {kind: kind for kind in get_args(Kind)}

ROUND = (
    "Client take buy", "Client send order 0", "Server receive order 0", "Server take accept",
    "Server take serve", "Server send bill 1", "Client receive bill 1", "Client take pay",
)  # fmt: skip


def price(channel: str, payload: object) -> Mapping[str, object] | None:
    return payload if isinstance(payload, dict) else None


def found_at(found: Conformance, line: int, words: str) -> None:
    assert found.judgement.verdict is Verdict.FAIL
    assert found.deviation is not None
    assert found.deviation.position == line
    assert words in found.deviation.rule


def test_what_the_model_does_conforms() -> None:
    found = check(trace(*ROUND, *ROUND[:1], "Client send order 2"), SHOP)
    assert found.judgement.passed
    assert found.judgement.why == "10 events of Client, Server are as the model allows"
    assert (found.deviation, found.expected, found.path) == (None, (), ())


@pytest.mark.parametrize(
    ("lines", "at", "words"),
    [
        (("Client take pay",), 0, "pay cannot be taken here"),
        ((*ROUND[:2], "Client take pay"), 2, "pay needs a message of bill, but none was there to take up"),
        ((*ROUND[:2], "Client take buy"), 2, "buy cannot be taken here"),
        (("Client take buy", "Client take pay"), 1, "pay came before what the last transition must send"),
        (("Client send order 0",), 0, "order was sent, but no transition taken sends it"),
        (("Client take buy", "Client send bill 0"), 1, "bill is no channel that Client sends on"),
        (("Server receive order 0",), 0, "a message is sent before it is received, but message 0 of order was not"),
        ((*ROUND[:3], "Server receive order 0"), 3, "received once, but message 0 of order was received or lost"),
        ((*ROUND[:4], "Server take refuse"), 4, "refuse cannot be taken here"),
        ((*ROUND[:3], "Server take refuse"), 3, "refuse cannot be taken here"),
        ((*ROUND[:2], "Client receive order 0"), 2, "Server receives order, not Client"),
        (("environment send bill 0", ROUND[0], "Client receive bill 0"), 2, "received bill before it had sent what it"),
        ((*ROUND[:6], "Server take explode"), 6, "explode is no transition of Server"),
        ((*ROUND[:1],), 1, "the trace ends before it has sent what it must"),
        ((*ROUND[:2], "environment send order 1", "Server receive order 1"), 3, "messages keep their order"),
    ],
)  # fmt: skip
def test_the_first_event_that_the_model_does_not_allow_is_named(lines: tuple[str, ...], at: int, words: str) -> None:
    found_at(check(trace(*lines), SHOP), at, words)


def test_messages_overtake_nobody_on_their_channel() -> None:
    tell = ("Server take tell", "Server send news 0", "Server take tell", "Server send news 1")
    assert check(trace(*tell, "Client receive news 0", "Client receive news 1"), SHOP).judgement.passed
    found_at(check(trace(*tell, "Client receive news 1"), SHOP), 4, "message 1 of news was received before message 0")


def test_a_message_that_was_dropped_need_not_come_and_must_not() -> None:
    tell = ("Server take tell", "Server send news 0", "Server take tell", "Server send news 1", "Client drop news 0")
    assert check(trace(*tell, "Client receive news 1"), SHOP).judgement.passed
    found_at(check(trace(*tell, "Client receive news 0"), SHOP), 5, "received or lost before")


def test_a_service_takes_one_question_at_a_time_and_a_topic_loses_old_news() -> None:
    asking = ("Client take buy", "Client send order 0", "environment send order 1", "environment send order 2")
    assert check(trace(*asking[:3]), SHOP).judgement.passed
    found_at(check(trace(*asking), SHOP), 3, "order holds 1, but one more was sent before it was taken up")
    news = [line for k in range(5) for line in ("Server take tell", f"Server send news {k}")]
    assert check(trace(*news), SHOP).judgement.passed


def test_what_a_message_says_decides_what_its_receiver_may_do() -> None:
    checker = Checker(SHOP)
    for event in trace(*ROUND[:5]).events:
        assert checker.observe(event) is None
    assert [str(each) for each in checker.expected()] == ["receive bill", "send bill(price = 6)"]


def test_a_deviation_is_in_doubt_where_nobody_said_what_a_message_held() -> None:
    order = "environment send order 0"
    found = check(trace(order, *ROUND[2:5], "Server send bill 1 7"), SHOP, fields=price)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    assert found.deviation is not None
    assert "o.size" in found.deviation.doubt


@pytest.mark.parametrize(("price_sent", "passes"), [(6, True), (7, False)])
def test_observed_fields_are_compared_with_the_model(price_sent: int, passes: bool) -> None:
    found = check(trace(*ROUND[:5], f"Server send bill 1 {price_sent}"), SHOP, fields=price)
    assert found.judgement.passed is passes
    if not passes:
        found_at(found, 5, "bill was sent with price = 7, which is not what the model says")
        assert [str(each) for each in found.expected] == ["send bill(price = 6)"]


def test_without_fields_only_the_channel_of_a_message_counts() -> None:
    assert check(trace(*ROUND[:5], "Server send bill 1 7"), SHOP).judgement.passed


def test_the_path_is_that_of_the_component_that_deviated() -> None:
    found = check(trace(*ROUND, "Server take serve"), SHOP)
    assert found.path == ("accept", "serve")
    assert [str(each) for each in found.expected] == ["receive order", "take tell"]
    assert str(found.deviation) == (
        "event 8 at 0.000 ms, Server: serve cannot be taken here;"
        " expected: receive order, take tell; after accept serve"
    )


def test_online_the_first_deviation_stays() -> None:
    checker = Checker(SHOP)
    first = [checker.observe(event) for event in trace("Client take pay", *ROUND).events]
    assert first[0] is not None
    assert all(each is first[0] for each in first)
    assert checker.expected() == first[0].expected


def test_online_and_offline_find_the_same() -> None:
    lines = trace(*ROUND, "Server take serve")
    checker = Checker(SHOP, component=["Client", "Server"])
    for event in lines.events:
        checker.observe(event)
    assert checker.finish() == check(lines, SHOP).deviation


def test_components_that_are_not_followed_may_do_anything() -> None:
    lines = trace("Client take pay", "Client send order 0", "Server receive order 0", "Server take accept")
    assert check(lines, SHOP, component="Server").judgement.passed
    assert not check(lines, SHOP).judgement.passed


def test_what_the_model_does_not_name_is_counted_and_passed_over() -> None:
    found = check(trace("Robot send cmd_vel 0", "Client receive cmd_vel 0", *ROUND), SHOP)
    assert found.judgement.passed
    assert found.n_outside == 2


def test_a_numbered_instance_runs_one_machine_of_its_own() -> None:
    assert check(trace("Server#0 take tell", "Server#0 send news 0", "Server#2 take tell", "Server#2 send news 1"), SHOP).judgement.passed  # noqa: E501  # fmt: skip
    found_at(check(trace("Server#0 take serve"), SHOP), 0, "serve cannot be taken here")


def test_a_numbered_instance_may_run_all_machines_for_a_whole_case() -> None:
    both = ("Server#0 take stroke", "Server#0 receive order 0", "Server#0 take accept", "Server#0 take stroke")
    begun = ("Client#1 take buy", "Client#1 send order 0", *both)
    two = replace(SHOP, components=(SHOP.components[0], replace(SERVER, machines=(*SERVER.machines, CAT))))
    assert check(trace(*begun), two).judgement.passed
    found_at(check(trace(*begun, "Server#0 take accept"), two), 6, "accept cannot be taken here")
    found_at(check(trace("Server#0 take stroke", "Server#0 take serve"), two), 1, "serve cannot be taken here")


def test_between_instances_the_tester_hands_on_in_an_order_of_its_own() -> None:
    lines = (
        "Client#0 take buy", "Client#0 send order 0", "Client#1 take buy", "Client#1 send order 1",
        "Server#2 receive order 1", "Server#2 take accept", "Server#3 receive order 0", "Server#3 take accept",
    )  # fmt: skip
    assert check(trace(*lines), SHOP).judgement.passed


def test_between_the_same_two_instances_messages_keep_their_order() -> None:
    tell = ("Server#0 take tell", "Server#0 send news 0", "Server#0 take tell", "Server#0 send news 1")
    assert check(trace(*tell, "Client#1 receive news 1", "Client#2 receive news 0"), SHOP).judgement.passed
    found = check(trace(*tell, "Client#1 receive news 1", "Client#1 receive news 0"), SHOP)
    found_at(found, 5, "message 0 of news was received late")


def test_what_an_instance_sends_into_a_gate_takes_no_room() -> None:
    paid = ("environment send bill 5", "Client#0 receive bill 5", "Client#0 take pay")
    again = ("Client#0 take buy", "Client#0 send order 1")
    assert check(trace("Client#0 take buy", "Client#0 send order 0", *paid, *again), SHOP).judgement.passed


def test_where_the_host_stopped_the_case_nothing_is_decided() -> None:
    found = check(trace(*ROUND[:2], "Client deviation order"), SHOP)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    assert "the host stopped the case" in found.judgement.why


def test_a_trace_without_the_models_components_is_inconclusive() -> None:
    for lines in ((), ("Robot take turn",), ("environment send order 0",)):
        assert check(trace(*lines), SHOP).judgement.verdict is Verdict.INCONCLUSIVE


def test_names_that_do_not_exist_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"must be a component of 'shop', but is 'Cook'.*unknown-part"):
        Checker(SHOP, component="Cook")
    with pytest.raises(BadRequest, match=r"only a channel can be late, but 'bil' is not one; did you mean 'bill'"):
        Checker(SHOP, quiescence={"bil": 1})
    with pytest.raises(BadRequest, match=r"must be a known name, but 'everything' was given.*unknown-observation"):
        Checker(SHOP, observes="everything")  # type: ignore[arg-type]
    with pytest.raises(BadRequest, match=r"a timeout is above 0, but 0 ns is given"):
        Checker(SHOP, quiescence={"bill": 0})
