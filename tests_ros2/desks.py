"""Two toys that talk by a service: an Asker passes questions on to an Oracle, and what it is told to the tester."""

from __future__ import annotations

from collections.abc import Iterator

from parcours.model.structure import Cefsm, Channel
from parcours.run.hosts.battery import ToyStep
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.node_program import Plain
from parcours.run.port import ENVIRONMENT, Link, LinkKind, Step

LINKS = (
    Link("go", ENVIRONMENT, "Asker", 1000),
    Link("question", "Asker", "Oracle", 1, LinkKind.SERVICE),
    Link("answer", "Oracle", "Asker", 1, LinkKind.SERVICE),
    Link("told", "Asker", ENVIRONMENT, 1000),
)
CHANNELS = interfaces(
    Cefsm(
        "desks",
        (),
        (
            Channel("question", "Asker", "Oracle", "Question", "/oracle"),
            Channel("answer", "Oracle", "Asker", "Answer", "/oracle"),
        ),
    ),
    LINKS,
)


class Asker:
    """Asks what it is told to, and tells what is answered."""

    name = "Asker"

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Pass on."""
        if channel is not None:
            yield ToyStep("a1", (("question" if channel == "go" else "told", message),))

    def next_wake(self) -> int | None:
        """Never."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Nothing."""
        return iter(())

    def reset(self) -> None:
        """There is nothing to forget."""


class Oracle(Asker):
    """Answers a number with it, a list with each of its entries, and a text not at all."""

    name = "Oracle"

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Answer."""
        answers = message if isinstance(message, list) else [] if isinstance(message, str) else [message]
        if channel is not None:
            yield ToyStep("o1", tuple(("answer", one) for one in answers))


def node_program(component: str) -> Plain:
    """Return the node program of a toy."""
    return Plain(component, {"Asker": Asker, "Oracle": Oracle})
