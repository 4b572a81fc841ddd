"""What happened in a case, or what is to happen in it, as the steps of a sequence chart."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence

from parcours.abtc import Event
from parcours.model.structure import Cefsm
from parcours.report.sequences import ChartRow
from parcours.run.trace import Trace

_TESTER = "environment"


def steps_of(trace: Trace) -> list[ChartRow]:
    """Return the steps of a trace: messages where they are received, transitions, losses, deviations.

    Messages of a channel are received in the order in which they were sent; those that nobody received come last.
    """
    sent: defaultdict[str, deque[tuple[str, bool]]] = defaultdict(deque)
    steps = []
    for event in trace.events:
        queue = sent[event.channel]
        match event.kind:
            case "send":
                queue.append((event.component or _TESTER, False))
            case "hold" if queue:
                queue[-1] = (queue[-1][0], True)
            case "receive":
                sender, held = queue.popleft() if queue else (_TESTER, False)
                steps.append(ChartRow("message", sender, event.channel, event.component, held))
            case "take":
                steps.append(ChartRow("deed", event.component, event.transition))
            case "deviation":
                steps.append(ChartRow("wrong", event.component or _TESTER, event.text))
            case "drop":
                steps.append(ChartRow("lost", event.component or _TESTER, f"{event.channel}: lost"))
    lost = [
        ChartRow("lost", sender, f"{channel}: not received") for channel, queue in sent.items() for sender, _ in queue
    ]
    wrong = steps[-1:] if steps and steps[-1].kind == "wrong" else []
    return [*steps[: len(steps) - len(wrong)], *lost, *wrong]


def steps_to_be(cefsm: Cefsm, events: Sequence[Event]) -> list[ChartRow]:
    """Return the steps of an abstract case: each transition in its order, with the message that it takes up."""
    names = [f"{event.component}#{event.reference}" for event in events]
    sent: defaultdict[str, deque[str]] = defaultdict(deque)
    steps = []
    for event, name in zip(events, names, strict=True):
        transition = cefsm.transition(event.transition)[2]
        if transition.event is not None:
            queue = sent[transition.event.channel]
            steps.append(ChartRow("message", queue.popleft() if queue else _TESTER, transition.event.channel, name))
        steps.append(ChartRow("deed", name, event.transition))
        for send in transition.sends:
            sent[send.channel].append(name)
    return steps
