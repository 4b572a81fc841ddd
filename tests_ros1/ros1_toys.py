"""Toy components as programs of ROS 1 nodes: the battery's, and a client that asks a service; their transports."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from parcours.model.structure import Cefsm, Channel
from parcours.run.hosts.battery import Counting, Sink, Source, ToyStep
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.ros1.packing import Ros1Codec, Ros1NodeProgram
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.port import Link, Step


@dataclass(frozen=True)
class Field:
    """A field of a toy's message."""

    name: str
    kind: str
    doc: str = "a toy's"


FORMS = {
    "numbers": [Field("number", "int")],
    "seen": [Field("number", "int")],
    "ask": [Field("letters", "ints"), Field("padding", "floats")],
    "answer": [Field("count", "int")],
}


def flatten(channel: str, payload: Any) -> Sequence[object]:
    """A number, or the letters of a text with as many floats behind as its length in kilobytes."""
    if channel != "ask":
        return (payload,)
    return np.array([ord(letter) for letter in payload]), np.zeros(128 * (len(payload) - 1))


def restore(channel: str, values: Sequence[Any]) -> object:
    """Return the number, or the text."""
    return values[0] if channel != "ask" else "".join(map(chr, values[0]))


CODEC = Ros1Codec(FORMS, flatten, restore)

MODEL = Cefsm(
    "toys",
    (),
    (
        Channel("ask", "Client", "Counting", "Question", "/counting"),
        Channel("answer", "Counting", "Client", "Answer", "/counting"),
        Channel("seen", "Client", "environment", "Seen", "/seen"),
    ),
)
"""A client, a server, and what the client has seen."""


class Client:
    """Asks three times, one a millisecond, and passes every answer on to the tester.

    Args:
        letters: of the first question; a kilobyte each. The second has twice as many, the third three times.
    """

    name = "Client"

    def __init__(self, letters: int = 1) -> None:
        self._letters, self._asked = letters, 0

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Pass it on."""
        yield ToyStep("p", (("seen", message),))

    def next_wake(self) -> int | None:
        """The next question."""
        return 1_000_000 * self._asked if self._asked < 3 else None

    def wake(self, now: int) -> Iterator[Step]:
        """Ask."""
        self._asked += 1
        yield ToyStep("a", (("ask", "x" * self._letters * self._asked),))

    def reset(self) -> None:
        """Begin again."""
        self._asked = 0


_MAKERS: dict[str, Any] = {
    "Source": partial(Source, period=1_000_000),
    "Many": partial(Source, bursts=1000, period=1_000_000),
    "Sink": Sink,
    "Counting": Counting,
    "Client": Client,
    "Loud": partial(Client, letters=10_000),
}


def node_program(component: str) -> Ros1NodeProgram:
    """Return the node program of a toy."""
    return Ros1NodeProgram(Plain(component, _MAKERS), CODEC)


def many(component: str) -> Ros1NodeProgram:
    """Return the program of a toy; a Source sends 2000 numbers, 2000 a second, a Client's questions are of 10 MB."""
    return Ros1NodeProgram(Plain({"Source": "Many", "Client": "Loud"}.get(component, component), _MAKERS), CODEC)


def transport_of(
    some: Sequence[Link],
    names: Sequence[str],
    *,
    model: Cefsm | None = None,
    kind: str = "node_program",
    master: str | None = None,
) -> Ros1Transport:
    """Return the transport of toys; links that the model does not have are topics of their own names."""
    channels = interfaces(model or Cefsm("none", (), ()), also=some)
    nodes = nodes_of(some, names, f"tests_ros1.ros1_toys:{kind}")
    return Ros1Transport(nodes, channels, CODEC, ["tests_ros1.ros1_toys"], master=master, package="toys")
