"""The golden twin: what the original sends, to the byte, beside what a mutant sends; and where they part first."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from parcours.errors import ParcoursError
from parcours.run.trace import Trace, TraceEvent

if TYPE_CHECKING:
    from parcours.run.recording import PayloadCodec

View = Callable[[str, object], Mapping[str, object] | None]
_SHORT = 60  # characters of a value that are shown


def print_of(trace: Trace, codec: PayloadCodec) -> bytes:
    """Return a digest of what a trace says and of its payloads' bytes; times are left out."""
    digest = hashlib.sha256()
    for event in trace.events:
        said = (event.kind, event.component, event.transition, event.channel, event.text)
        digest.update("\0".join(said).encode("utf-8", "backslashreplace") + b"\1")
        if event.payload is not None:
            _add(digest, _flat(codec, event.channel, event.payload))
    return digest.digest()[:16]


def _flat(codec: PayloadCodec, channel: str, payload: object) -> Sequence[object]:
    try:
        return codec.flatten(channel, payload)
    except (ParcoursError, TypeError, ValueError, AttributeError, KeyError, IndexError, OverflowError):
        return (repr(payload),)  # a mutant may send anything


def _add(digest: Any, values: Sequence[object]) -> None:
    for value in values:
        digest.update(value.tobytes() if isinstance(value, np.ndarray | np.generic) else repr(value).encode())
        digest.update(b"\2")


def difference_of(original: Trace, mutant: Trace, codec: PayloadCodec, view: View) -> str:
    """Return the first event of a mutant that differs from the original's, and in which field of its message.

    Args:
        view: reads the model's fields from a payload.
    """
    for before, after in zip_longest(original.events, mutant.events):
        if before is None or after is None or _said(before) != _said(after):
            return f"{_named(after)} in the place of {_named(before)}"
        if before.payload is None and after.payload is None:
            continue
        flat = [_flat(codec, one.channel, one.payload) for one in (before, after)]
        if _bytes(flat[0]) != _bytes(flat[1]):
            return _field(before, after, flat, view)
    return ""


def fact_of(before: object, after: object) -> str:
    """Return the first of two cases' facts that differs: pairs of names and values; empty if none does."""
    for one, other in zip_longest(_pairs(before), _pairs(after), fillvalue=("", "nothing")):
        if one != other:
            return f"{one[0] or other[0]} is {other[1]:.{_SHORT}}, was {one[1]:.{_SHORT}}"
    return ""


def _pairs(facts: object) -> list[tuple[str, str]]:
    listed = facts if isinstance(facts, tuple) else (("facts", repr(facts)),)
    return [(str(one[0]), str(one[1])) for one in listed]


def _said(event: TraceEvent) -> tuple[str, ...]:
    return event.kind, event.component, event.transition, event.channel, event.text


def _named(event: TraceEvent | None) -> str:
    if event is None:
        return "nothing"
    return " ".join(part for part in (event.component, event.kind, event.transition or event.channel) if part)


def _bytes(values: Sequence[object]) -> list[object]:
    return [one.tobytes() if isinstance(one, np.ndarray | np.generic) else repr(one) for one in values]


def _field(before: TraceEvent, after: TraceEvent, flat: Sequence[Sequence[object]], view: View) -> str:
    what = after.channel or f"report of {after.transition}"
    try:
        seen = [view(one.channel, one.payload) for one in (before, after)]
    except (ParcoursError, TypeError, ValueError):
        return f"{what}: it is no message of the model any more"
    if seen[0] is not None and seen[1] is not None:
        found = next(_parted(seen[0], seen[1], what), None)
        if found is not None:
            return found
        return f"{what}: in what the model does not name"
    found = next(_parted(list(flat[0]), list(flat[1]), what), None)
    return found or what


def _parted(before: object, after: object, where: str) -> Iterator[str]:
    """Yield where two messages differ, in their order."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for name in {**before, **after}:
            yield from _parted(before.get(name), after.get(name), f"{where}.{name}")
    elif isinstance(before, list | tuple) and isinstance(after, list | tuple):
        if len(before) != len(after):
            yield f"{where} has {len(after)} items, had {len(before)}"
        for k, (one, other) in enumerate(zip(before, after, strict=False)):
            yield from _parted(one, other, f"{where}[{k}]")
    elif repr(before) != repr(after):
        yield f"{where} is {after!r:.{_SHORT}}, was {before!r:.{_SHORT}}"
