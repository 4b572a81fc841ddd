"""The processes host: nodes live, are driven, are watched, and leave nothing behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import pytest

from parcours.run.hosts.battery import DUTIES, Counting, Host, Sink, Source
from parcours.run.hosts.processes import ProcessFabric
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.resident import Plain, nodes_of
from parcours.run.hosts.seats import Answer
from parcours.run.port import Component, Link


def toys(component: str) -> Plain:
    return Plain(component, {"Source": partial(Source, period=1_000_000), "Sink": Sink, "Counting": Counting})


def toy_host(components: Sequence[Component], links: Sequence[Link], tester: Answer) -> Host:
    names = [part.name for part in components]
    fabric = ProcessFabric(nodes_of(links, names, "parcours.run.hosts.toys:resident"), ["parcours.run.hosts.toys"])
    return RealTimeHost(fabric, links, toys(""), environment=tester)


@pytest.mark.parametrize("duty", DUTIES.values(), ids=DUTIES)
def test_it_does_what_every_host_owes(duty: Callable[..., None]) -> None:
    duty(toy_host)
