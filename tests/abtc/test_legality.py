"""Every serialised execution sequence is a run of the model: its step relation takes each event in turn.

A reference is an instance of its own of its component, so the model is unfolded first: one component a
reference, one channel for each pair of references that meet, and everything else left to the environment.
"""

from __future__ import annotations

import random
from dataclasses import replace
from importlib.resources import files

import pytest

from parcours.abtc import AbstractCase, Event, abstract_cases, serialise
from parcours.model import read_model
from parcours.model.stepping import enabled, initial, step
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel, Component, Receive, Send, Transition

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
OBSTACLES = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))


def instance(reference: int, name: str) -> str:
    return f"{name}_{reference}"


def unfolded(cefsm: Cefsm, case: AbstractCase, events: tuple[Event, ...]) -> Cefsm:
    """The model of one case: a component for each reference, wired as its events say."""
    channels: dict[str, Channel] = {}

    def wire(channel: str, sender: int | None, receiver: int | None) -> str:
        name = f"{channel}_{'e' if sender is None else sender}_{'e' if receiver is None else receiver}"
        ends = [ENVIRONMENT if end is None else components[end].name for end in (sender, receiver)]
        channels[name] = replace(cefsm.channel(channel), name=name, sender=ends[0], receiver=ends[1])
        return name

    components: list[Component] = []
    for reference, (_, path) in enumerate(case.combination.references):
        original = cefsm.component(path.component)
        machines = tuple(machine for machine in original.machines if machine.name == path.machine)
        components.append(replace(original, name=instance(reference, original.name), machines=machines))
    wired: list[Component] = []
    for reference, component in enumerate(components):
        (machine,) = component.machines
        mine = {event.transition: event for event in events if event.reference == reference}
        transitions: list[Transition] = []
        for transition in machine.transitions:
            event = mine[transition.id]
            received = transition.event
            if event.receives and received:
                supplier = None if event.receives.event is None else events[event.receives.event].reference
                received = Receive(wire(event.receives.channel, supplier, reference), received.name)
            sends = tuple(
                Send(wire(sent.channel, reference, told.reference if told.to == "reference" else None), sent.payload)
                for sent, told in zip(transition.sends, event.sends, strict=True)
            )
            id = instance(reference, transition.id)
            transitions.append(replace(transition, id=id, event=received, sends=sends))
        wired.append(replace(component, machines=(replace(machine, transitions=tuple(transitions)),)))
    return replace(cefsm, components=tuple(wired), channels=tuple(channels.values()), interactions=())


def replay(cefsm: Cefsm, events: tuple[Event, ...]) -> list[str]:
    """Take the events one by one, each as a move that the step relation enables; return those it refuses."""
    here = initial(cefsm)
    refused = []
    for event in events:
        id = instance(event.reference, event.transition)
        moves = [move for move in enabled(cefsm, here) if move.transition == id]
        if moves:
            here = step(cefsm, here, moves[0])
        else:
            refused.append(id)
    assert refused or all(not queue for queue in here.queues), "a message was left over"
    return refused


@pytest.mark.parametrize("model", [RAMP, OBSTACLES], ids=["components", "obstacles"])
def test_the_step_relation_takes_every_event_of_every_case(model: Cefsm) -> None:
    for case in abstract_cases(model):
        events = serialise(case)
        assert replay(unfolded(model, case, events), events) == [], case.id


def reordered(events: tuple[Event, ...], seed: int) -> tuple[Event, ...]:
    """A random order that keeps what `after` and `before` say, and nothing else."""
    draw = random.Random(seed)
    causes = {event.position: set(event.after) for event in events}
    for event in events:
        if event.before is not None:
            causes[event.before].add(event.position)
    order: list[Event] = []
    while causes:
        position = draw.choice([position for position, waits in causes.items() if not waits & causes.keys()])
        del causes[position]
        order.append(events[position])
    return tuple(order)


def test_any_order_that_keeps_after_and_before_is_a_run_too() -> None:
    for seed, case in enumerate(abstract_cases(RAMP)):
        events = serialise(case)
        order = reordered(events, seed)
        assert order != events
        assert replay(unfolded(RAMP, case, events), order) == [], case.id


def test_the_step_relation_refuses_a_receive_before_its_send() -> None:
    case = next(abstract_cases(RAMP))
    events = serialise(case)
    send = next(event for event in events if event.transition == "p15" and event.reference == 0)
    receive = next(event for event in events if event.transition == "p22")
    early = [
        event for event in events if event is not receive and event.reference == 1 and event.position < receive.position
    ]
    order = (*early, receive, *(event for event in events if event not in (*early, receive)))
    assert order.index(receive) < order.index(send)
    assert replay(unfolded(RAMP, case, events), order)[0] == "p22_1"
