"""Holds what travels against the message classes of the model, before anything runs.

The model's classes are the definition. How a study shows its payloads, and how a host makes bytes of them, must agree:

    specimen ──── shown ────► of the channel's class: all its fields, of their types and shapes
       │ encode, decode: the host's own bytes
       ▼
    what came ─── shown ────► the same
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.model.fitting import misfit
from parcours.model.structure import Cefsm, MessageClass
from parcours.run.hosts.node_program import Codec

Shown = Callable[[str, object], Mapping[str, object] | None]  # (channel, payload) -> the model's fields

Specimens = Callable[
    [], Iterable[tuple[str, object]]
]  # payloads as they are sent, by channel; several of one may differ


def require_carried(model: Cefsm, shown: Shown, specimens: Specimens, codec: Codec | None = None) -> None:
    """Do nothing if what travels is what the model says.

    Args:
        codec: of the host's messages; None in simulated time, where payloads travel as they are.

    Raises HostFailure: some does not, all of which is named.
    """
    if wrong := list(uncarried(model, shown, specimens, codec)):
        rule = "what travels must be what the model's classes say, but " + "; ".join(wrong)
        raise HostFailure("messages", rule, "change the class in the model, or what is sent", slug="message-carried")


def uncarried(model: Cefsm, shown: Shown, specimens: Specimens, codec: Codec | None = None) -> Iterator[str]:
    """Yield what does not agree: the channel, its class in the model, and what travels instead."""
    classes = {message.name: message for message in model.messages}
    left = {one.name: classes[one.message] for one in model.carriers if one.message in classes}
    declared = dict(left)
    for channel, payload in specimens():
        left.pop(channel, None)
        if channel in declared and (wrong := _wrong(classes, declared[channel], shown, channel, payload, codec)):
            yield f"on {channel!r} {wrong}"
    for channel, message in left.items():
        yield f"on {channel!r} nothing travels that could be a {message.name}"


def _wrong(
    classes: Mapping[str, MessageClass], declared: MessageClass, shown: Shown, channel: str, payload: object,
    codec: Codec | None,
) -> str:  # fmt: skip
    try:
        sent = shown(channel, payload)
        if wrong := misfit(classes, declared, sent, whole=True):
            return wrong
        if codec is None:
            return ""
        came = shown(channel, codec.decode(channel, codec.encode(channel, payload)))
    except BadRequest as error:
        return f"a {declared.name} does not travel: {error.where}: {error.rule}"
    except ParcoursError:
        raise
    except Exception as error:  # what shows payloads is the study's own
        return f"a {declared.name} does not travel: {type(error).__name__}: {error}"
    return _difference(sent, came, declared.name)


def _difference(sent: object, came: object, where: str) -> str:
    """Return the first place where what came is not what was sent; empty if there is none."""
    if isinstance(sent, Mapping) and isinstance(came, Mapping):
        keys = [name for name in sent if name not in came]
        if keys:
            return f"{where}.{keys[0]} is lost on its way"
        pairs = ((value, came[name], f"{where}.{name}") for name, value in sent.items())
    elif isinstance(sent, list) and isinstance(came, list) and len(sent) == len(came):
        pairs = ((one, other, f"{where}[{k}]") for k, (one, other) in enumerate(zip(sent, came, strict=True)))
    else:
        return "" if sent == came else f"{where} is sent as {sent!r:.60}, but comes as {came!r:.60}"
    return next((wrong for one in pairs if (wrong := _difference(*one))), "")
