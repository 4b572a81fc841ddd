"""Reads and writes a place in messages of one type."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import cast

from parcours.errors import BadModel, HostFailure, one_of
from parcours.model.expression import REAL, Type
from parcours.run.binding.message_types import TIMES, FieldType, MessageTypes, limits
from parcours.run.binding.places import EVERY, MAX_ITEMS, Place, Step, path_text

_QUATERNION = ("x", "y", "z", "w")


@dataclass(frozen=True, slots=True)
class Access:
    """A place that is known to exist in messages of a type. `slot` is what lies there, `type` what a formula sees."""

    place: Place
    message: str
    slot: FieldType
    type: Type
    types: MessageTypes

    def read(self, message: object) -> object:
        """Return the value at the place: a number, text, list or message.

        Raises:
            HostFailure: the message has too few items for an index.
        """
        value = self._read(message, 0)
        if not self.place.lens:
            return value
        if self.place.is_each:
            return [self._seen(item) for item in cast(Iterable[object], value)]
        return self._seen(value)

    def write(self, message: object, value: object, index: int = 0) -> None:
        """Put a value at the place; lists grow where an index lies behind their end.

        Args:
            message: of the type that the place was compiled for.
            value: a bool, number or text, or a list of these, as the place's type demands.
            index: which item `[*]` means.

        Raises:
            HostFailure: the value is not of the place's type, or out of its range.
        """
        self._write(message, FieldType(self.message), self.place.steps, value, index)

    def _read(self, current: object, first: int) -> object:
        steps = self.place.steps
        for at in range(first, len(steps)):
            step = steps[at]
            if step == EVERY:
                items = cast(Iterable[object], current)
                found: list[object] = []
                for item in items:
                    value = self._read(item, at + 1)
                    if EVERY in steps[at + 1 :]:
                        found.extend(cast(list[object], value))
                    else:
                        found.append(value)
                return found
            if isinstance(step, str):
                current = getattr(current, step)
                continue
            listed = cast(list[object], current)
            try:
                current = listed[step]
            except IndexError:
                rule = f"a message must reach to {path_text(steps[: at + 1])!r}, but has {len(listed)} items there"
                remedy = "correct the binding or the sender"
                raise HostFailure(self.message, rule, remedy, slug="message-size") from None
        return current.tolist() if hasattr(current, "tolist") else current  # ROS 2 has arrays of numpy

    def _seen(self, value: object) -> float:
        if self.place.lens == "yaw":
            x, y, z, w = (float(getattr(value, name)) for name in _QUATERNION)
            return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        seconds, nanoseconds = _time_names(value)
        return float(getattr(value, seconds)) + 1e-9 * float(getattr(value, nanoseconds))

    def _write(self, current: object, slot: FieldType, steps: tuple[Step, ...], value: object, index: int) -> object:
        if not steps:
            return self._stored(current, slot, value)
        step, rest = steps[0], steps[1:]
        if isinstance(step, str) and step != EVERY:
            fields = self.types.fields(slot.item) or {}
            inner = self._write(getattr(current, step), fields[step], rest, value, index)
            setattr(current, step, inner)
            return current
        items = list(cast(Iterable[object], current))
        at = index if step == EVERY else int(step)
        while at >= len(items) and slot.length == 0 and at <= MAX_ITEMS:
            items.append(self._new(slot.item))
        if not -len(items) <= at < len(items):
            raise self._refused(f"{slot} has no item {at}")
        items[at] = self._write(items[at], FieldType(slot.item), rest, value, index)
        return items

    def _new(self, item: str) -> object:
        slot = FieldType(item)
        if slot.is_message:
            return self.types.create(item)
        return {"bool": False, "real": 0.0, "text": ""}.get(slot.type.name, 0)

    def _stored(self, current: object, slot: FieldType, value: object) -> object:
        if self.place.lens:
            return self._through_lens(current, value)
        if slot.length is None and slot.is_message and isinstance(value, self.types.class_of(slot.item) or ()):
            return copy.deepcopy(value)
        if slot.length is None:
            return self._scalar(slot, value)
        if not isinstance(value, list | tuple) or (slot.length and len(value) != slot.length):
            raise self._refused(f"{slot} takes a list{f' of {slot.length}' if slot.length else ''}, not {value!r:.60}")
        return [self._scalar(FieldType(slot.item), item) for item in value]

    def _scalar(self, slot: FieldType, value: object) -> object:
        kind, bounds = slot.type.name, limits(slot.item)
        if bounds is not None and isinstance(value, float) and value.is_integer():
            value = int(value)
        if bounds is not None and type(value) is int and bounds[0] <= value <= bounds[1]:
            return value
        if kind == "real" and isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        if (kind == "bool" and isinstance(value, bool)) or (kind == "text" and isinstance(value, str)):
            return value
        raise self._refused(f"{slot} does not take {value!r:.60}")

    def _through_lens(self, current: object, value: object) -> object:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self._refused(f"{self.place.lens} takes a number, not {value!r:.60}")
        if self.place.lens == "yaw":
            turned = (0.0, 0.0, math.sin(0.5 * value), math.cos(0.5 * value))
            for name, part in zip(_QUATERNION, turned, strict=True):
                setattr(current, name, part)
            return current
        whole, rest = divmod(round(value * 1e9), 1_000_000_000)
        for name, part in zip(_time_names(current), (whole, rest), strict=True):
            setattr(current, name, part)
        return current

    def _refused(self, said: str) -> HostFailure:
        where, rule = f"{self.message}, {self.place}", f"a value must fit its field, but {said}"
        return HostFailure(where, rule, "correct what the binding sets there", slug="message-value")


def _time_names(value: object) -> tuple[str, str]:
    return ("secs", "nsecs") if hasattr(value, "secs") else ("sec", "nanosec")


def compile_place(place: Place, message: str, types: MessageTypes, where: str) -> Access:
    """Return the access to a place in messages of a type.

    Args:
        place: where in the message.
        message: the type's name, e.g. `geometry_msgs/Twist`; it must be known to `types`.
        types: what is known of message types.
        where: what the place belongs to, for the error message.

    Raises:
        BadModel: the type has no such field, a step needs a list where none is, or a lens another type.

    >>> class Bool:
    ...     __slots__ = ["data"]
    ...     _slot_types = ["bool"]
    >>> types = MessageTypes({"std_msgs/Bool": Bool}.get)
    >>> str(compile_place(Place(("data",)), "std_msgs/Bool", types, "here").type)
    'bool'
    >>> compile_place(Place(("date",)), "std_msgs/Bool", types, "here")
    Traceback (most recent call last):
    parcours.errors.BadModel: here: a place must exist, but std_msgs/Bool has no 'date' in 'date'; did you mean \
'data'? Known: data [binding-field]
    """
    slot, rank = FieldType(message), 0
    for at, step in enumerate(place.steps):
        so_far = path_text(place.steps[: at + 1])
        if isinstance(step, str) and step != EVERY:
            fields = types.fields(slot.item) if slot.length is None else {}
            if not fields:
                kind = f"{path_text(place.steps[:at]) or message} is {slot}, which has no fields"
                remedy = "" if slot.length is None else "name an item: [0], or every item: [*]"
                rule = f"a place must exist, but {kind}, in {str(place)!r}"
                raise BadModel(where, rule, remedy, slug="binding-field")
            if step not in fields:
                rule = f"a place must exist, but {slot.item} has no {step!r} in {str(place)!r}"
                raise BadModel(where, rule, one_of(step, list(fields)), slug="binding-field")
            slot = fields[step]
            continue
        if slot.length is None:
            rule = f"an index needs a list, but {so_far.rpartition('[')[0]!r} is {slot}"
            raise BadModel(where, rule, "delete the index", slug="binding-field")
        if isinstance(step, int) and slot.length and not -slot.length <= step < slot.length:
            rule = f"an index must lie in its list, but {so_far!r} does not: it is {slot}"
            raise BadModel(where, rule, slug="binding-field")
        rank += step == EVERY
        slot = FieldType(slot.item)
    return Access(place, message, slot, _seen_type(place, slot, rank, where), types)


def _seen_type(place: Place, slot: FieldType, rank: int, where: str) -> Type:
    if not place.lens:
        return Type(slot.type.name, rank=slot.type.rank + rank)
    fits = slot.item in TIMES if place.lens == "seconds" else slot.item.endswith("/Quaternion")
    if not fits or slot.length is not None:
        wanted = "a time or duration" if place.lens == "seconds" else "a quaternion"
        rule = f"{place.lens} works on {wanted}, but {path_text(place.steps)!r} is {slot}"
        raise BadModel(where, rule, slug="binding-field")
    return Type(REAL.name, rank=rank)
