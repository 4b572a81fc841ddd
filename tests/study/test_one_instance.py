"""One instance of a component a case: answers go to the visit that asked, strays and early messages find faults."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

import pytest

from parcours.abtc import as_one_instance, serialise
from parcours.model.model_file import parse_model
from parcours.run.enforcement import instance_name
from parcours.study import took
from parcours.study.components.results import PER_CASE, PER_VISIT
from parcours.study.components.running import functional_here
from parcours.study.components.simple import Took
from parcours.study.components.study import ComponentStudy
from parcours.study.components.systems import python_system
from parcours.study.parameters import settings_of
from parcours.verdict.judgement import Verdict

MODEL = """
parcours: model/1
name: desk
messages:
  Ticket: {fields: {id: {type: int}}}
channels:
  call: {from: environment, to: Client, message: Ticket}
  ask: {from: Client, to: Server, message: Ticket}
  answer: {from: Server, to: Client, message: Ticket}
  told: {from: Client, to: environment, message: Ticket}
components:
  Client:
    variables: {asked: {type: int, initial: 0}}
    machines:
      talk:
        initial: free
        transitions:
          c1: {from: free, to: waiting, event: call(it), message: ask(it), action: "asked := it.id"}
          c2: {from: waiting, to: free, event: answer(it), guard: it.id == asked, message: told(it)}
  Server:
    machines:
      serve:
        initial: idle
        transitions:
          s1: {from: idle, to: busy, event: ask(it), message: answer(it)}
          s2: {from: busy, to: idle}
"""


class Client:
    """Calls that come while it waits for an answer wait for their turn; answers to others are ignored."""

    name = "Client"
    accepts_any = loses_calls = forgets = False

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.asked: int | None = None
        self.calls: deque[Any] = deque()

    def handle(self, channel: str | None, message: Any, now: int) -> Iterator[Took]:
        if channel == "call":
            if self.asked is None or not self.loses_calls:
                self.calls.append(message)
        elif channel == "answer" and self.asked is not None and (self.accepts_any or message["id"] == self.asked):
            self.asked = None
            yield took("c2", told=message)
        if self.asked is None and self.calls:
            message = self.calls.popleft()
            self.asked = message["id"]
            yield took("c1", ask=message)

    def next_wake(self) -> int | None:
        return None

    def wake(self, now: int) -> Iterator[Took]:
        yield from ()


class AcceptsAny(Client):
    accepts_any = True


class LosesCalls(Client):
    loses_calls = True


class Server:
    def ask(self, message: Any) -> Took:
        return took("s1", answer=message)

    def s2(self) -> Took:
        return took("s2")


class KeepsTheFirst(Server):
    first: Any = None

    def ask(self, message: Any) -> Took:
        self.first = self.first or message
        return took("s1", answer=self.first)


def desk(client: type = Client, server: type = Server) -> ComponentStudy:
    return ComponentStudy("desk", parse_model(MODEL, "desk.yaml"), python_system(Client=client, Server=server))


def verdicts(study: ComponentStudy, instances: str) -> list[tuple[Verdict, str]]:
    settings = settings_of(study.parameters, {"instances": instances})
    runs = [functional_here(study, case, settings) for case in study.plan(1).cases()]
    return [(run.judgement.verdict, run.judgement.why) for run in runs]


@pytest.mark.parametrize("instances", [PER_VISIT, PER_CASE])
def test_a_desk_without_faults_passes_however_many_instances_there_are(instances: str) -> None:
    assert {verdict for verdict, _ in verdicts(desk(), instances)} == {Verdict.PASS}


@pytest.mark.parametrize(
    "study", [desk(AcceptsAny), desk(LosesCalls)], ids=["it accepts any answer", "it loses a message while it waits"]
)
def test_faults_of_conversations_are_found_where_a_case_has_one_instance_only(study: ComponentStudy) -> None:
    assert {verdict for verdict, _ in verdicts(study, PER_VISIT)} == {Verdict.PASS}
    found = verdicts(study, PER_CASE)
    assert Verdict.FAIL in {verdict for verdict, _ in found}
    assert all("Client#0" in why for verdict, why in found if verdict is Verdict.FAIL)


def test_an_answer_goes_to_the_visit_that_asked() -> None:
    study = desk()
    for case in study.plan(1).cases():
        events = study.visits(case, {"instances": PER_CASE}).events
        assert {instance_name(event) for event in events} == {"Client#0", "Server#1"}
        of = {event.position: event for event in events}
        (answered,) = [
            event
            for event in events
            if event.receives and event.transition == "c2" and event.receives.event is not None
        ]
        served = of[answered.receives.event]  # type: ignore[union-attr, index]
        asked = [event for event in events[: answered.position] if event.transition == "c1"]
        assert served.transition == "s1" and [event.position for event in asked] == [served.receives.event]  # type: ignore[union-attr]


def test_each_event_of_the_case_is_kept_and_comes_after_what_it_receives() -> None:
    for abstract in desk().abstracts.values():
        events = serialise(abstract)
        one = as_one_instance(events).events
        assert sorted((e.component, e.transition) for e in one) == sorted((e.component, e.transition) for e in events)
        assert all(e.receives is None or e.receives.event is None or e.receives.event < e.position for e in one)
        assert [event.position for event in one] == [*range(len(one))]
