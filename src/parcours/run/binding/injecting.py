"""What a binding says of the tester's messages, compiled for their type, and values by name to a message."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from parcours.errors import BadModel, HostFailure
from parcours.model.documents import Mapping as Tree
from parcours.model.documents import Node, Scalar
from parcours.model.documents import Sequence as Listed
from parcours.model.expression import INT, REAL, Type
from parcours.model.expression.typing import accepts
from parcours.model.finding import Finding
from parcours.model.nodes import shown
from parcours.run.binding.access import Access, compile_place
from parcours.run.binding.formulas import Formula
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.places import Place
from parcours.run.binding.quantities import plain
from parcours.run.binding.readings import TYPE_OF
from parcours.run.binding.structure import Binding, Injection


@dataclass(frozen=True, slots=True)
class Writer:
    """Makes messages of one type: a base, then places set to the values of formulas."""

    type: str
    types: MessageTypes
    base: tuple[tuple[Access, object, int], ...]
    """(place, value, index that `[*]` means), in order."""
    set: tuple[tuple[Access, Formula], ...]
    where: str

    def message(self, values: Mapping[str, object], items: Sequence[Mapping[str, object]] = ()) -> object:
        """Return a new message.

        Args:
            values: a value for each name that the formulas use, e.g. {"robot.x": 0.5}.
            items: further values for each item of a list: a place with `[*]` is set once for each.

        Raises:
            HostFailure: a name has no value, or a value does not fit its field.
            BadModel: a formula cannot be computed, as when it divides by zero.
        """
        made = self.types.create(self.type)
        for access, value, index in self.base:
            access.write(made, value, index)
        for access, formula in self.set:
            rounds = items if access.place.is_each else [{}]
            for index, more in enumerate(rounds):
                access.write(made, self._value(formula, values, more), index)
        return made

    def _value(self, formula: Formula, values: Mapping[str, object], more: Mapping[str, object]) -> object:
        found: dict[Place, object] = {}
        for place in formula.places:
            name = str(place)
            if name not in more and name not in values:
                rule = f"a name must have a value when a message is made, but {name!r} has none"
                raise HostFailure(self.where, rule, "give it as an input of the case", slug="binding-value")
            found[place] = more[name] if name in more else values[name]
        return formula.value(found, self.where)


def compile_injection(
    binding: Binding, injection: Injection, type_: str, types: MessageTypes, where: str
) -> tuple[Writer, list[Finding]]:
    """Return what makes messages of a type, and what is wrong with it: each finding with its line.

    Args:
        binding: whose constants the formulas may use.
        injection: what the binding says.
        type_: the message's type; it must be known to `types`.
        types: what is known of message types.
        where: what the injection belongs to, for messages.
    """
    compiling = _Compiling(binding, type_, types, where)
    if injection.base is not None:
        compiling.base(injection.base, ())
    for place, formula in injection.set:
        compiling.set(place, formula)
    return Writer(type_, types, tuple(compiling.values), tuple(compiling.formulas), where), compiling.found


class _Compiling:
    def __init__(self, binding: Binding, type_: str, types: MessageTypes, where: str) -> None:
        self.binding, self.type, self.types, self.where = binding, type_, types, where
        self.found: list[Finding] = []
        self.values: list[tuple[Access, object, int]] = []
        self.formulas: list[tuple[Access, Formula]] = []
        self.constants = dict(binding.constants)
        self.trial = types.create(type_)

    def place(self, place: Place, line: int) -> Access | None:
        try:
            return compile_place(place, self.type, self.types, self.where)
        except BadModel as error:
            self.found.append(Finding(self.binding.source, line, "error", error.slug, str(error.rule), error.remedy))
        return None

    def base(self, node: Node, steps: tuple[str | int, ...]) -> None:
        """Take up the leaves of a tree of plain data, each with the place it names."""
        if isinstance(node, Tree):
            for key, value in node.items:
                self.base(value, (*steps, key.text))
        elif isinstance(node, Listed) and any(not isinstance(item, Scalar) for item in node.items):
            for index, item in enumerate(node.items):
                self.base(item, (*steps, index))
        else:
            access = self.place(Place(steps), node.line)
            if access is not None:
                self.leaf(access, node)

    def leaf(self, access: Access, node: Node) -> None:
        value = node.text if isinstance(node, Scalar) and access.type.name == "text" else plain(node)
        try:
            access.write(self.trial, value)
        except HostFailure:
            rule = f"a value must fit its field, but {access.place} is {access.slot} and this is {shown(node)}"
            self.found.append(Finding(self.binding.source, node.line, "error", "message-value", rule))
            return
        self.values.append((access, value, 0))

    def set(self, place: Place, formula: Formula) -> None:
        access = self.place(place, formula.line)
        if access is None:
            return
        known = self.constants
        types = {p: TYPE_OF[type(known[str(p)])] if str(p) in known else REAL for p in formula.places}
        try:
            given = formula.type(types, f"{str(place)!r} of {self.where}")
        except BadModel as error:
            self.found.append(Finding(self.binding.source, formula.line, "error", error.slug, error.rule, error.remedy))
            return
        wanted = Type(access.type.name) if place.is_each else access.type
        if not accepts(wanted, given) and {wanted, given} != {INT, REAL}:
            rule = f"a formula must fit its field, but {place} is {access.slot} and {str(formula)!r} is {given}"
            self.found.append(Finding(self.binding.source, formula.line, "error", "binding-field-type", rule))
            return
        self.formulas.append((access, formula))
