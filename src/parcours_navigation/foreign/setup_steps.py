"""The steps of a binding between cases -> parameters set and awaited, services called, messages sent."""

from __future__ import annotations

import time
from typing import Literal

from parcours.errors import HostFailure
from parcours.run.binding.decoding import encoded
from parcours.run.binding.structure import Action
from parcours.run.hosts.ros1.ends import Kind
from parcours.run.hosts.ros1.foreign_master import plain_value
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.tester_messages import Maker
from parcours_navigation.foreign.world import GOAL, START

_READERS = 0.3
"""So long it is waited for who may hear a message that is published once [s]."""


def act(session: Session, maker: Maker, key: Literal["before_case", "after_case"]) -> None:
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
                writer = session.host.compile().calls[key, position]
                data = encoded(writer.message(_values()))
                if action.kind == "call":
                    _call(session, action, data, where)
                else:
                    _publish(session, action, data)


def _values() -> dict[str, object]:
    names = ("x", "y", "heading")
    values: dict[str, object] = {f"start.{name}": value for name, value in zip(names, START, strict=True)}
    values |= {f"goal.{name}": value for name, value in zip(names, GOAL, strict=True)}
    return values | {"wall_time": time.time()}


def _value(session: Session, action: Action, where: str) -> object:
    if action.formula is None:
        return plain_value(action.value)
    known = _values() | dict(session.host.binding.constants)
    for place in action.formula.places:
        if str(place) not in known:
            rule = f"a name must have a value between cases, but {str(place)!r} has none"
            raise HostFailure(where, rule, slug="binding-value")
    return action.formula.value({place: known[str(place)] for place in action.formula.places}, where)


def _wait(session: Session, action: Action, where: str) -> None:
    until = time.monotonic() + action.timeout
    while (found := session.host.master.parameter(action.name)) != plain_value(action.value):
        if time.monotonic() > until:
            rule = (
                f"{action.name} must become {plain_value(action.value)!r} within {action.timeout:g} s, but is {found!r}"
            )
            raise HostFailure(where, rule, slug="foreign-step")
        session.poll(session.now() + 20_000_000)


def _call(session: Session, action: Action, data: bytes, where: str) -> None:
    host = session.host
    kind = host.types.service(action.type)
    if kind is None:
        raise HostFailure(where, f"{action.type} must be known, but is not", slug="unknown-message-type")
    answers: list[tuple[bytes | None, str]] = []
    host.middle.call(action.name, kind).ask(data, lambda answer, why: answers.append((answer, why)))
    until = time.monotonic() + action.timeout
    while not answers and time.monotonic() < until:
        session.poll(session.now() + 20_000_000)
    answer, why = answers[0] if answers else (None, f"no answer within {action.timeout:g} s")
    if answer is None:
        raise HostFailure(where, f"{action.name} must answer, but: {why}", slug="foreign-step")


def _publish(session: Session, action: Action, data: bytes) -> None:
    host = session.host
    kind = host.types.kind(action.type) or Kind(action.type, "*")
    publisher = host.middle.publish(action.name, kind, latch=True)
    until = time.monotonic() + _READERS
    while not publisher.peers and time.monotonic() < until:
        session.poll(session.now() + 10_000_000)
    publisher.send(data)
    session.poll(session.now() + 10_000_000)
    host.middle.leave([action.name])
