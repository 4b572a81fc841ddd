"""Packs a configuration into one integer: a small number for each machine's state, each value, each queue's content.

    queue c | queue b | value y | value x | state B | state A
    ........|........|..0000010|......01|....0011|....0001      least bits: the first machine

Whatever stands somewhere is numbered when it is first met. A step then adds a constant to the integer, the same
wherever it is taken, and what a machine sees of a configuration is the integer under a mask.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Generic, TypeVar

from parcours.model.configuration import Configuration, Layout, Message
from parcours.model.structure import Machine, Variable

Thing = TypeVar("Thing")

Content = tuple[Message, ...]
"""The messages in a queue, the oldest first."""

WIDEST = 32
"""Bits of a cell whose content has no known bound: more numbers than any memory holds configurations."""


class PackedField(Generic[Thing]):
    """A field of the packed integer: what can stand there, numbered in the order of meeting it.

    The first thing met has number 0, so that the initial configuration is the integer 0.
    """

    def __init__(self, shift: int, bits: int) -> None:
        self.shift, self.mask = shift, ((1 << bits) - 1) << shift
        self.things: list[Thing] = []
        self._numbers: dict[Thing, int] = {}

    def number(self, thing: Thing) -> int:
        """Return the number of a thing, a new one if it was never met."""
        found = self._numbers.setdefault(thing, len(self.things))
        if found == len(self.things):
            self.things.append(thing)
        return found

    def at(self, packed: int) -> Thing:
        """Return what stands here in a packed configuration."""
        return self.things[(packed & self.mask) >> self.shift]

    def put(self, thing: Thing, packed: int) -> int:
        """Return what to add to a packed configuration so that the thing stands here."""
        return (self.number(thing) << self.shift) - (packed & self.mask)


class Packing:
    """The cells of one model.

    Attributes:
        layout: what stands where in a configuration.
        machines: the machines, in the order of `Configuration.states`.
        states: a cell for each machine.
        values: a cell for each variable, in the order of `Configuration.values`.
        queues: a cell for each channel that holds messages, in the order of `Configuration.queues`.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.machines = tuple(machine for component in layout.cefsm.components for machine in component.machines)
        spoken = _spoken(layout)
        widths = [_bits(len(_states(machine))) for machine in self.machines]
        widths += [_bits(_size(variable)) for _, variable in layout.variables]
        widths += [WIDEST if name in spoken else _bits(layout.capacity[name] + 1) for name in layout.channels]
        shifts = [0, *accumulate(widths)]
        places = iter(zip(shifts, widths, strict=False))
        self.states: list[PackedField[str]] = [PackedField(*next(places)) for _ in self.machines]
        self.values: list[PackedField[object]] = [PackedField(*next(places)) for _ in layout.variables]
        self.queues: dict[str, PackedField[Content]] = {name: PackedField(*next(places)) for name in layout.channels}
        self.pack(layout.initial())

    def pack(self, configuration: Configuration) -> int:
        """Return the integer of a configuration; the initial one is 0."""
        packed = sum(cell.put(each, 0) for cell, each in zip(self.states, configuration.states, strict=True))
        packed += sum(cell.put(each, 0) for cell, each in zip(self.values, configuration.values, strict=True))
        queues = zip(self.queues.values(), configuration.queues, strict=True)
        return packed + sum(cell.put(content, 0) for cell, content in queues)

    def unpack(self, packed: int) -> Configuration:
        """Return the configuration of an integer that `pack` returned or a step led to."""
        states = tuple(cell.at(packed) for cell in self.states)
        values = tuple(cell.at(packed) for cell in self.values)
        return Configuration(states, values, tuple(cell.at(packed) for cell in self.queues.values()))


def _states(machine: Machine) -> set[str]:
    return {machine.initial, *machine.states, *(each.target for each in machine.transitions)}


def _size(variable: Variable) -> int:
    return 2 if variable.type == "bool" else len(variable.domain)


def _bits(size: int) -> int:
    # Of a cell for `size` things; 0 stands for a number that is not known.
    return max(1, min(WIDEST, (size - 1).bit_length())) if size else WIDEST


def _spoken(layout: Layout) -> set[str]:
    # The channels whose messages may differ; a queue of the others is known by its length.
    return {
        send.channel
        for site in layout.sites.values()
        for send, content in zip(site.transition.sends, site.contents, strict=True)
        if content.fields
    }
