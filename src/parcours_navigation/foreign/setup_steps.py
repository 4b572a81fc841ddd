"""Does the steps of a binding between cases: sets and awaits parameters, calls services, publishes messages."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Literal

from parcours.errors import HostFailure
from parcours.run.binding.decoding import encoded
from parcours.run.binding.structure import Action
from parcours.run.hosts.ros1.ends import Kind
from parcours.run.hosts.ros1.foreign_master import plain_value
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.world import PLACES

_READERS = 0.3
"""How long to wait for those who may hear a message that is published once [s]."""


def act(session: Session, key: Literal["before_case", "after_case"]) -> None:
    """Do the steps under a key, one after the other.

    Raises:
        HostFailure: a parameter does not become what is awaited, or a call fails.
    """
    binding = session.host.binding
    actions = binding.before_case if key == "before_case" else binding.after_case
    for position, action in enumerate(actions):
        where = f"{binding.source}:{action.line}: {key}"
        match action.kind:
            case "set":
                session.host.master.set_parameters({action.name: _value(session, action, where)})
            case "wait":
                _wait(session, action, where)
            case _:
                data = encoded(session.host.compile().calls[key, position].message(_known(session)))
                if action.kind == "call":
                    _call(session, action, data, where)
                else:
                    _publish(session, action, data)


def _known(session: Session) -> dict[str, object]:
    """Return the names that formulas may use between cases, with their values."""
    return {**PLACES, "wall_time": time.time(), **dict(session.host.binding.constants)}


def _value(session: Session, action: Action, where: str) -> object:
    if action.formula is None:
        return plain_value(action.value)
    known = _known(session)
    for place in action.formula.places:
        if str(place) not in known:
            rule = f"a name must have a value between cases, but {str(place)!r} has none"
            raise HostFailure(where, rule, slug="binding-value")
    return action.formula.value({place: known[str(place)] for place in action.formula.places}, where)


def _poll_until(session: Session, done: Callable[[], object], seconds: float) -> None:
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        session.poll(session.now() + 20_000_000)


def _wait(session: Session, action: Action, where: str) -> None:
    wanted, master = plain_value(action.value), session.host.master
    _poll_until(session, lambda: master.parameter(action.name) == wanted, action.timeout)
    if (found := master.parameter(action.name)) != wanted:
        rule = f"{action.name} must become {wanted!r} within {action.timeout:g} s, but is {found!r}"
        raise HostFailure(where, rule, slug="foreign-step")


def _call(session: Session, action: Action, data: bytes, where: str) -> None:
    host = session.host
    kind = host.types.service(action.type)
    if kind is None:
        raise HostFailure(where, f"{action.type} must be known, but is not", slug="unknown-message-type")
    answers: list[tuple[bytes | None, str]] = []
    host.middle.call(action.name, kind).ask(data, lambda answer, why: answers.append((answer, why)))
    _poll_until(session, lambda: answers, action.timeout)
    answer, why = answers[0] if answers else (None, f"no answer within {action.timeout:g} s")
    if answer is None:
        raise HostFailure(where, f"{action.name} must answer, but: {why}", slug="foreign-step")


def _publish(session: Session, action: Action, data: bytes) -> None:
    host = session.host
    kind = host.types.kind(action.type) or Kind(action.type, "*")
    publisher = host.middle.publish(action.name, kind, latch=True)
    _poll_until(session, lambda: publisher.peers, _READERS)
    publisher.send(data)
    session.poll(session.now() + 10_000_000)
    host.middle.leave([action.name])
