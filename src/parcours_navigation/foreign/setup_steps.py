"""Does the steps of a binding between cases: parameters, services, messages, lifecycle nodes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Literal

from parcours.errors import HostFailure
from parcours.run.binding.domains import within
from parcours.run.binding.structure import Action, Value
from parcours.run.hosts.foreign.session import Session
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
                session.host.graph.set_parameter(_named(action), _value(session, action, where))
            case "wait":
                _wait(session, action, where)
            case "life":
                _lead(session, action, where)
            case _:
                compiled = session.host.compile()
                data = compiled.types.packed(compiled.calls[key, position].message(_known(session)))
                if action.kind == "call":
                    _call(session, action, data, where)
                else:
                    _publish(session, action, data, where)


def _named(action: Action) -> str:
    """Return the name of what a step is about, on its domain."""
    return within(action.name, action.domain)


def _known(session: Session) -> dict[str, object]:
    """Return the names that formulas may use between cases, with their values."""
    return {**PLACES, "wall_time": time.time(), **dict(session.host.binding.constants)}


def _value(session: Session, action: Action, where: str) -> Value:
    if action.formula is None:
        return action.value
    known = _known(session)
    for place in action.formula.places:
        if str(place) not in known:
            rule = f"a name must have a value between cases, but {str(place)!r} has none"
            raise HostFailure(where, rule, slug="binding-value")
    return action.formula.value({place: known[str(place)] for place in action.formula.places}, where)  # type: ignore[return-value]


def _listed(value: Value) -> object:
    """Return a value with lists for tuples, as graphs give it back."""
    return [_listed(one) for one in value] if isinstance(value, tuple) else value


def _poll_until(session: Session, done: Callable[[], object], seconds: float) -> None:
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        session.poll(session.now() + 20_000_000)


def _wait(session: Session, action: Action, where: str) -> None:
    wanted, graph = _listed(action.value), session.host.graph
    _poll_until(session, lambda: graph.parameter(_named(action)) == wanted, action.timeout)
    if (found := graph.parameter(_named(action))) != wanted:
        rule = f"{_named(action)} must become {wanted!r} within {action.timeout:g} s, but is {found!r}"
        raise HostFailure(where, rule, slug="foreign-step")


def _lead(session: Session, action: Action, where: str) -> None:
    state, graph, until = str(action.value), session.host.graph, time.monotonic() + action.timeout
    while not graph.lead(_named(action), state):
        session.poll(session.now() + 20_000_000)
        if time.monotonic() > until:
            rule = f"{_named(action)} must become {state} within {action.timeout:g} s, but does not"
            raise HostFailure(where, rule, slug="foreign-step")


def _call(session: Session, action: Action, data: bytes, where: str) -> None:
    host = session.host
    if not host.graph.knows_service(action.type):
        raise HostFailure(where, f"{action.type} must be known, but is not", slug="unknown-message-type")
    answers: list[tuple[bytes | None, str]] = []
    caller, until = host.graph.call(_named(action), action.type), time.monotonic() + action.timeout
    _poll_until(session, lambda: caller.is_matched, action.timeout)
    caller.ask(data, lambda answer, why: answers.append((answer, why)))
    _poll_until(session, lambda: answers, until - time.monotonic())
    answer, why = answers[0] if answers else (None, f"no answer within {action.timeout:g} s")
    if answer is None:
        raise HostFailure(where, f"{action.name} must answer, but: {why}", slug="foreign-step")


def _publish(session: Session, action: Action, data: bytes, where: str) -> None:
    host = session.host
    publisher = host.graph.publish(_named(action), action.type, queue=16, latch=True)
    if publisher is None:
        raise HostFailure(where, f"{action.type} must be known, but is not", slug="unknown-message-type")
    _poll_until(session, lambda: publisher.peers, _READERS)
    publisher.send(data)
    session.poll(session.now() + 10_000_000)
    host.graph.leave(_named(action))
