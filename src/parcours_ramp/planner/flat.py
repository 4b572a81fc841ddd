"""Fields of a flat form, checked as they are given; and arrays of records as counts, columns and counted parts.

What comes from outside is refused where it could make compiled code read beyond an array: by counts that do not add up
or exceed what a record holds, and by numbers that are not finite.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_ramp.planner.messages import many

_PLACES = np.arange(1024)
_SCALARS: dict[str, type] = {"float": float, "int": int, "bool": bool}
_NUMBERS: dict[str, type] = {"floats": np.float64, "ints": np.int64}
_WORD = 8  # Bytes of every number in a record


@dataclass(frozen=True, slots=True)
class FormField:
    """One field of a form: its name, kind and meaning; arrays have `width` values an entry, `endless` may be infinite.

    A float is an IEEE double, an int has 64 bits; floats and ints are arrays of these.
    """

    name: str
    kind: Literal["float", "int", "bool", "floats", "ints"]
    doc: str
    width: int = 1
    endless: bool = False


class Given:
    """The values given for a channel, by the names of its fields; each of its kind, and finite where it must be."""

    def __init__(self, channel: str, form: Sequence[FormField], values: Sequence[object]) -> None:
        self.channel = channel
        self.values: dict[str, Any] = {}
        self._fields = {field.name: field for field in form}
        if len(values) != len(form):
            raise refusal(channel, "", f"has {len(form)} fields, but {len(values)} were given", "wire-fields")
        for field, value in zip(form, values, strict=True):
            self.values[field.name] = self._checked(field, value)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def _checked(self, field: FormField, value: object) -> object:
        kind = field.kind
        if kind in ("floats", "ints"):
            return self._array(field, value)
        if type(value) is not _SCALARS[kind]:
            self.refuse(field.name, f"must be of kind {kind}, but {value!r:.60} was given", "wire-kind")
        if isinstance(value, float) and not (math.isfinite(value) or (field.endless and value == value)):
            self.refuse(field.name, f"must be finite, but {value} was given", "wire-finite")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            self.refuse(field.name, f"must fit into 64 bits, but {value} was given", "wire-range")
        return value

    def _array(self, field: FormField, value: object) -> NDArray[Any]:
        wanted = _NUMBERS[field.kind]
        if isinstance(value, memoryview):
            if len(value) % (_WORD * field.width):
                rule = f"takes {field.width} values of {_WORD} bytes an entry, but {len(value)} bytes were given"
                self.refuse(field.name, rule, "wire-counts")
            numbers = np.frombuffer(value, "<f8" if wanted is np.float64 else "<i8")
        else:
            numbers = self._converted(field, value, wanted)
        if wanted is np.float64 and numbers.size:
            sound = ~np.isnan(numbers) if field.endless else np.isfinite(numbers)
            if np.count_nonzero(sound) != numbers.size:
                at = int(np.argmin(sound))
                self.refuse(field.name, f"must be finite, but its value {at} is {numbers[at]}", "wire-finite")
        return numbers

    def _converted(self, field: FormField, value: object, wanted: Any) -> NDArray[Any]:
        try:
            if not isinstance(value, np.ndarray):
                if not isinstance(value, list | tuple | array):
                    raise TypeError
                value = np.array(value) if len(value) else np.zeros(0, wanted)
            numbers = value.astype(wanted, order="C", casting="equiv", copy=False)
        except (TypeError, ValueError, OverflowError):
            given = f"{type(value).__name__} {value!r:.60}"
            self.refuse(field.name, f"must be an array of 64-bit {field.kind}, but {given} was given", "wire-kind")
        if numbers.ndim != 1 or numbers.size % field.width:
            rule = f"takes {field.width} values an entry in one dimension, but has shape {numbers.shape}"
            self.refuse(field.name, rule, "wire-counts")
        return numbers

    def refuse(self, field: str, rule: str, slug: str) -> NoReturn:
        """Raise BadRequest about a field."""
        raise refusal(self.channel, field, rule, slug)

    def within(self, field: str, least: int, most: int, value: int | None = None, *, slug: str = "wire-range") -> None:
        """Refuse the number (or the value given for it) unless it lies from `least` to `most`."""
        given = self[field] if value is None else value
        if not least <= given <= most:
            self.refuse(field, f"must lie from {least} to {most}, but {given} was given", slug)

    def all_within(
        self, field: str, least: int, most: int, values: NDArray[np.int64], slug: str = "wire-range"
    ) -> None:
        """Refuse the array for these values of it unless all lie from `least` to `most`."""
        outside = (values < least) | (values > most)
        if np.count_nonzero(outside):
            self.within(field, least, most, int(values[outside][0]), slug=slug)

    def as_many(self, field: str, n: int, others: str) -> None:
        """Refuse the array unless it has n entries."""
        width = self._fields[field].width
        if self[field].size != n * width:
            rule = f"must have {n} x {width} values to go with {others}, but has {self[field].size}"
            self.refuse(field, rule, "wire-counts")


def refusal(channel: str, field: str, rule: str, slug: str) -> BadRequest:
    """Return the complaint about a field of a message, or about all of it if no field is named."""
    where = f"message on channel {channel!r}" + (f", field {field!r}" if field else "")
    return BadRequest(where, rule, "send what `parcours_ramp.planner.wire.FORMS` says", slug=slug)


@dataclass(frozen=True, slots=True)
class Part:
    """A field that holds some numbers of every record, by their columns: the record seen as a row of 64-bit words."""

    field: FormField
    columns: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CountedPart:
    """A field that holds, of a block of entries in every record, as many as the record has.

    The block begins at the column `begin` and has room for `most` entries of `whole` words, of which the field takes
    its width from the word `first` on; `count` is the place of the entries' number among the record's counts.
    """

    field: FormField
    count: int
    begin: int
    most: int
    whole: int = 1
    first: int = 0

    def entries(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return the block as a view, shape (records, most, width)."""
        block = rows[:, self.begin : self.begin + self.most * self.whole]
        return block.reshape(len(rows), self.most, self.whole)[..., self.first : self.first + self.field.width]

    def held(self, counts: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which entries of the block the records have, shape (records, most)."""
        return _PLACES[: self.most] < counts[:, self.count, None]


def columns(kind: Any, *names: str) -> NDArray[np.intp]:
    """Return the columns at which the named fields of a record layout lie."""
    places = [(kind.fields[name][1] // _WORD, kind.fields[name][0].itemsize // _WORD) for name in names]
    return np.concatenate([np.arange(begin, begin + n) for begin, n in places])


class RecordLayout:
    """How an array of records travels: as counts (its first part), columns and counted parts.

    Args:
        counts: how many entries a record has in its counted parts.
    """

    def __init__(self, kind: Any, ends: Sequence[tuple[int, int]], most: int, counts: Part,
                 *parts: Part | CountedPart) -> None:  # fmt: skip
        self._kind, self._ends, self._most = np.result_type(many(kind, 0)), ends, most
        self._least, self._greatest = (np.array(end, np.int64) for end in zip(*ends, strict=True))
        self._counts, self._parts = counts, (counts, *parts)
        self._words = kind.itemsize // _WORD
        self.fields = tuple(part.field for part in self._parts)
        self._no_records = many(kind, 0)
        self._nothing: tuple[NDArray[Any], ...] = tuple(np.zeros(0, _NUMBERS[field.kind]) for field in self.fields)

    def flatten(self, channel: str, records: object) -> tuple[NDArray[Any], ...]:
        """Return the parts of an array of records, or of one record."""
        table = np.ascontiguousarray(records)
        if table.itemsize != self._kind.itemsize:
            rule = f"takes records of {self._kind.itemsize} bytes, but {type(records).__name__} was given"
            raise refusal(channel, self.fields[0].name, rule, "wire-payload")
        if not len(table):
            return self._nothing
        rows = self._rows(table)
        counts = rows["ints"].take(self._counts.columns, 1)
        held: dict[int, NDArray[np.bool_]] = {}
        found = []
        for part in self._parts:
            numbers = rows[part.field.kind]
            if isinstance(part, Part):
                found.append(numbers.take(part.columns, 1).ravel())
            else:
                if part.count not in held:
                    held[part.count] = part.held(counts)
                found.append(part.entries(numbers)[held[part.count]].ravel())
        return tuple(found)

    def restore(self, given: Given) -> Any:
        """Return the records whose parts were given."""
        if not any(given[field.name].size for field in self.fields):
            return self._no_records
        first = self._counts.field
        counts = given[first.name].reshape(-1, first.width)
        n = len(counts)
        given.within(first.name, 0, self._most, n, slug="wire-counts")
        if n == 0:  # and something is in the other fields
            for field in self.fields:
                given.as_many(field.name, 0, first.name)
        if np.count_nonzero((counts < self._least) | (counts > self._greatest)):
            for column, (least, most) in zip(counts.T, self._ends, strict=True):
                given.all_within(first.name, least, most, column, "wire-counts")
        sums = counts.sum(0).tolist()
        memory = np.zeros(n * self._words)
        rows = self._rows(memory)
        held: dict[int, NDArray[np.bool_]] = {}
        for part in self._parts:
            field = part.field
            if isinstance(part, Part):
                given.as_many(field.name, n, first.name)
                rows[field.kind][:, part.columns] = given[field.name].reshape(n, field.width)
            else:
                given.as_many(field.name, sums[part.count], first.name)
                if part.count not in held:
                    held[part.count] = part.held(counts)
                part.entries(rows[field.kind])[held[part.count]] = given[field.name].reshape(-1, field.width)
        return memory.view(self._kind).view(np.recarray)

    def _rows(self, table: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Return the same memory as floats and as ints, one record per row."""
        flat = table.view(np.int64)
        ints = flat.reshape(len(flat) // self._words, self._words)
        return {"floats": ints.view(np.float64), "ints": ints}
