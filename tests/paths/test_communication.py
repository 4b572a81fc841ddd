from __future__ import annotations

from itertools import pairwise

import pytest

from parcours.errors import BadRequest
from parcours.model import parse_model
from parcours.model.composition import explore
from parcours.paths import RequirementLimits, measure, requirements
from parcours.paths.covering import cover_demand
from parcours.paths.criteria.composed import composition_demand, composition_graph

SHOP = parse_model("""
parcours: model/1
name: shop
messages:
  Order: {fields: {}}
  Bill: {fields: {}}
channels:
  ask: {from: environment, to: Client, message: Order}
  order: {from: Client, to: Server, message: Order, capacity: 2}
  pay: {from: Server, to: Client, message: Bill, capacity: 0}
  log: {from: Server, to: environment, message: Bill}
  unused: {from: Client, to: Server, message: Bill}
components:
  Client:
    machines:
      buy:
        initial: idle
        transitions:
          c1: {from: idle, to: waiting, event: ask(it), message: order}
          c2: {from: waiting, to: waiting, message: order}
          c3: {from: waiting, to: idle, event: pay(bill)}
          c4: {from: waiting, to: waiting, event: pay(bill)}
  Server:
    machines:
      sell:
        initial: ready
        transitions:
          s1: {from: ready, to: busy, event: order(it)}
          s2: {from: busy, to: ready, message: pay; log}
          s3: {from: busy, to: busy, event: order(it)}
""")


def met(criterion: str, *run: str) -> list[str]:
    return [str(need) for need in measure(SHOP, criterion, run).met]


def test_every_used_channel_and_every_class_it_carries_is_required() -> None:
    assert [str(need) for need in requirements(SHOP, "channel")] == ["ask", "order", "pay", "log"]
    assert [str(need) for need in requirements(SHOP, "message")] == ["Order", "Bill"]


def test_a_rendezvous_is_a_sending_transition_with_a_receiving_one() -> None:
    assert [str(need) for need in requirements(SHOP, "rendezvous")] == [
        "c1 -> s1", "c1 -> s3", "c2 -> s1", "c2 -> s3", "s2 -> c3", "s2 -> c4",
    ]  # fmt: skip


def test_too_many_rendezvous_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"rendezvous of 'shop': .*at most 5,.*\[too-many-requirements\]"):
        requirements(SHOP, "rendezvous", limits=RequirementLimits(count=5))


def test_two_machines_of_a_component_meet_but_none_meets_itself() -> None:
    pair = parse_model("""
    parcours: model/1
    name: pair
    messages: {Hi: {fields: {}}}
    channels: {hi: {from: Both, to: Both, message: Hi, capacity: 0}}
    components:
      Both:
        machines:
          one: {initial: a, transitions: {s1: {from: a, to: a, message: hi}, r1: {from: a, to: a, event: hi(it)}}}
          two: {initial: b, transitions: {s2: {from: b, to: b, message: hi}, r2: {from: b, to: b, event: hi(it)}}}
    """)
    assert [str(need) for need in requirements(pair, "rendezvous")] == ["s1 -> r2", "s2 -> r1"]


def test_a_queue_gives_its_oldest_message_first() -> None:
    assert met("rendezvous", "c1", "c2", "s1", "s3") == ["c1 -> s1", "c2 -> s3"]


def test_a_queue_that_was_sent_more_than_it_holds_has_lost_the_oldest() -> None:
    assert met("rendezvous", "c1", "c2", "c2", "s1") == ["c2 -> s1"]


def test_a_message_counts_when_it_is_delivered() -> None:
    assert met("channel", "c1") == ["ask"]
    assert met("channel", "c1", "s1") == ["ask", "order"]
    assert met("channel", "c1", "s1", "s2") == ["ask", "order", "log"]  # nobody has received the bill
    assert met("channel", "c1", "s1", "s2+c3") == ["ask", "order", "pay", "log"]
    assert met("message", "c1") == ["Order"]


def test_what_one_run_sends_another_does_not_receive() -> None:
    assert measure(SHOP, "rendezvous", ["c1"], ["s1"]).met == ()


def test_a_path_of_a_composition_ends_where_nothing_waits_and_all_machines_may_stop() -> None:
    space = explore(SHOP)
    graph = composition_graph(space)
    assert (len(graph.states), len(graph.edges)) == (space.n_states, space.n_transitions)
    stops = [space.configuration(state) for state in graph.finals]
    assert {(here.states, sum(map(len, here.queues))) for here in stops} == {(("idle", "ready"), 0)}


def test_a_path_of_a_composition_may_also_end_where_it_can_no_longer_stop() -> None:
    count = parse_model("""
    parcours: model/1
    name: count
    components:
      Count:
        variables: {n: {type: int, initial: 0, range: [0, 2]}}
        machines:
          c: {initial: a, transitions: {
            up: {from: a, to: b, guard: n < 2, action: n := n + 1}, down: {from: b, to: a, guard: n < 2}}}
    """)
    space = explore(count)
    finals = [space.configuration(state) for state in composition_graph(space).finals]
    assert {(here.states[0], here.values[0]) for here in finals} == {("a", 0), ("a", 1), ("b", 2)}


@pytest.mark.parametrize("criterion", ["channel", "message", "rendezvous"])
def test_a_cover_of_the_composition_meets_each_communication_that_can_happen(criterion: str) -> None:
    asked, unmet = composition_demand(explore(SHOP), criterion)
    required = requirements(SHOP, criterion)
    assert {goal.requirement for goal in asked.goals} | set(unmet) == set(required)
    paths = [[asked.graph.edges[edge] for edge in path] for path in cover_demand(asked).paths]
    assert measure(SHOP, criterion, *paths).missed == unmet == ()


def test_each_walk_of_a_rendezvous_delivers_what_its_first_transition_sends() -> None:
    space = explore(SHOP)
    asked, _ = composition_demand(space, "rendezvous")
    for goal in asked.goals:
        before = [str(move) for move in space.path_to(int(asked.graph.sources[goal.walk[0]]))]
        assert goal.requirement not in measure(SHOP, "rendezvous", before).met
        walk = [asked.graph.edges[edge] for edge in goal.walk]
        assert goal.requirement in measure(SHOP, "rendezvous", before + walk).met
        assert goal.requirement not in measure(SHOP, "rendezvous", before + walk[:-1]).met
        assert all(asked.graph.targets[a] == asked.graph.sources[b] for a, b in pairwise(goal.walk))
        first, last = (set(asked.graph.edges[edge].split("+")) for edge in (goal.walk[0], goal.walk[-1]))
        assert goal.requirement.steps[0] in first
        assert goal.requirement.steps[1] in last


def test_a_rendezvous_that_no_configuration_allows_is_told_apart() -> None:
    dumb = parse_model("""
    parcours: model/1
    name: dumb
    messages: {Hi: {fields: {}}}
    channels: {hi: {from: A, to: B, message: Hi}}
    components:
      A: {machines: {a: {initial: s, transitions: {a1: {from: s, to: t, message: hi}}}}}
      B: {machines: {b: {initial: s, transitions: {
        b1: {from: s, to: t, event: hi(it)}, b2: {from: t, to: s, event: hi(it)}}}}}
    """)
    asked, unmet = composition_demand(explore(dumb), "rendezvous")
    assert [str(goal.requirement) for goal in asked.goals] == ["a1 -> b1"]
    assert [str(need) for need in unmet] == ["a1 -> b2"]


def test_graph_criteria_look_at_the_whole_composition() -> None:
    space = explore(SHOP)
    asked, unmet = composition_demand(space, "edge-pair")
    paths = [[asked.subject.graph.edges[edge] for edge in path] for path in cover_demand(asked).paths]
    assert unmet == ()
    assert measure(asked.graph, "edge", *paths).missed == ()
    assert measure(SHOP, "edge", *paths).missed == ()


def test_a_composition_that_was_not_explored_to_its_end_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"composition of 'shop': .*\[open-composition\]"):
        composition_graph(explore(SHOP, max_states=3))
