"""What the templates of a written UPPAAL file share: variables, channels, queues, constants and the unit of time."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field

from parcours.model.expression import Apply, Assignment, Binary, Expression, FieldAccess, Literal, Name, Unary, names
from parcours.model.expression.syntax import walk
from parcours.model.structure import CLOCK, ENVIRONMENT, Cefsm, Channel, Component, Send, Transition, Variable
from parcours_formats.guard_languages.values import is_natural, naturals_of
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames

TESTER = "Environment"
"""The template that stands for the tester: one location, and an edge for each channel of the environment."""


@dataclass(frozen=True, slots=True)
class SharedChannel:
    """How a channel is written: its name, and a variable of a type for each field that its messages have there.

    Messages wait in a queue of a capacity above 0, which is a counter; others meet, unless nobody reads them.
    """

    name: str
    capacity: int
    meets: bool
    slots: dict[str, tuple[str, str]]


class Shared:
    """The global part of one written file; `losses` grows."""

    def __init__(self, cefsm: Cefsm) -> None:
        self.cefsm = cefsm
        self.losses = Losses()
        self.names = UniqueNames((*WORDS, TESTER))
        self.scale = scale_of(cefsm)
        if self.scale != 1:
            self.losses.add("model", 0, f"the unit of time is 1/{self.scale} s there")
        variables = [(component, each) for component in cefsm.components for each in component.variables]
        words = [str(word) for _, each in variables if each.type == "enum" for word in each.domain]
        self.numbers = {word: self.names.identifier(word) for word in dict.fromkeys(words)}
        classes = {message.name: message for message in cefsm.messages}
        self.fields = {channel.name: classes[channel.message].fields for channel in cefsm.channels}
        read = {each.event.channel for part in cefsm.components for each in part.transitions() if each.event}
        named = {channel.name: self.names.identifier(channel.name) for channel in cefsm.channels}
        self.links = {each.name: self._link(each, named[each.name], each.name in read) for each in cefsm.channels}
        self.variables: dict[str, dict[str, str]] = {component.name: {} for component in cefsm.components}
        for component, variable in variables:
            self._name(component, variable)

    def declarations(self) -> Iterator[str]:
        """Yield the lines of the global declarations."""
        for number, name in enumerate(self.numbers.values()):
            yield f"const int {name} = {number};"
        for link in self.links.values():
            if link.capacity:
                yield f"int[0,{link.capacity}] {link.name};"
            elif link.meets:
                yield f"chan {link.name};"
            length = f"[{link.capacity + 1}]" if link.capacity else ""
            for slot, type_ in link.slots.values():
                yield f"{type_} {slot}{length};"
        for component in self.cefsm.components:
            if len(component.machines) > 1:
                yield from self.declared(component)

    def declared(self, component: Component) -> Iterator[str]:
        """Yield the declarations of the variables of a component."""
        for variable in component.variables:
            name = self.variables[component.name].get(variable.name)
            if name is None or variable.role == "input":
                continue
            if variable.type == CLOCK:
                yield f"clock {name};"
            elif variable.type == "bool":
                yield f"bool {name} = {'true' if variable.initial else 'false'};"
            elif variable.type == "enum":
                yield f"int[0,{len(self.numbers) - 1}] {name} = {self.numbers[str(variable.initial)]};"
            else:
                yield f"int{_bounds(variable)} {name} = {variable.initial};"

    def rendering(
        self, component: Component, transition: Transition | None = None, *, guard: bool = False
    ) -> Rendering:
        """Return how the names of a component are written, and those of the message a transition receives."""
        known = dict(self.variables[component.name])
        event = transition.event if transition is not None else None
        if event is not None and event.name:
            link = self.links[event.channel]
            # A queue holds its message before the edge is taken, so that a guard may read it; a rendezvous does not.
            for part, (slot, _) in link.slots.items() if link.capacity or not guard else ():
                known[f"{event.name}.{part}"] = f"{slot}[0]" if link.capacity else slot
        clocks = {each.name for each in component.variables if each.type == CLOCK}
        return Rendering(known, self.numbers, naturals_of(component), clocks, self.scale)

    def selections(self, component: Component, transition: Transition) -> list[str]:
        """Return a selection for each input that a transition reads: the tester's choice."""
        said = [transition.guard] if transition.guard is not None else []
        said += [action.value for action in transition.actions if isinstance(action, Assignment)]
        said += [value for send in transition.sends for value in send.payload]
        used = {name for node in said for name in names(node)}
        inputs = [each for each in component.variables if each.role == "input" and each.name in used]
        known = self.variables[component.name]
        return [f"{known[each.name]} : int{_bounds(each) or '[0,1]'}" for each in inputs if each.name in known]

    def waits(self, taken: str, sends: Iterable[Send]) -> list[str]:
        """Return the conditions on queues: a message is there, and there is room for what is sent."""
        guards = [f"{self.links[taken].name} > 0"] if taken and self.links[taken].capacity else []
        for name, count in Counter(send.channel for send in sends if self.links[send.channel].capacity).items():
            guards.append(f"{self.links[name].name} <= {self.links[name].capacity + (name == taken) - count}")
        return guards

    def payload(self, send: Send) -> list[tuple[str, Expression]]:
        """Return where each part of a message goes: the slots of its channel."""
        link, fields = self.links[send.channel], self.fields[send.channel]
        if len(send.payload) != len(fields) or not (link.meets or link.capacity):
            return []
        at = f"[{link.name}]" if link.capacity else ""
        parts = zip(fields, send.payload, strict=True)
        return [(link.slots[part.name][0] + at, value) for part, value in parts if part.name in link.slots]

    def shifted(self, name: str) -> list[str]:
        """Return the updates that take the first message out of a queue."""
        #   slot   [ a | b | c | - ]  queue = 3      one element more than the capacity, so that the last
        #            /   /   /                       move reads inside the array
        #   slot   [ b | c | - | - ]  queue = 2
        link = self.links[name]
        slots = [slot for slot, _ in link.slots.values()]
        moves = [f"{slot}[{at}] = {slot}[{at + 1}]" for slot in slots for at in range(link.capacity)]
        return [*moves, f"{link.name}--"] if link.capacity else []

    def tester(self) -> list[str]:
        """Return the synchronisations of the tester: it is always ready."""
        outer = [each for each in self.cefsm.channels if ENVIRONMENT in (each.sender, each.receiver)]
        met = [(self.links[each.name], "!" if each.sender == ENVIRONMENT else "?") for each in outer]
        return [link.name + sign for link, sign in met if link.meets]

    def _link(self, channel: Channel, name: str, is_read: bool) -> SharedChannel:
        where, line, fields = f"channel {channel.name!r}", channel.line, self.fields[channel.name]
        is_outer = ENVIRONMENT in (channel.sender, channel.receiver)
        capacity = channel.capacity if is_read and not is_outer else 0
        if capacity:
            self.losses.add(
                where, line, f"the queue of {capacity} is a counter there, and does not come back as a channel"
            )
        elif is_outer and channel.capacity:
            self.losses.add(where, line, "has no capacity there: the tester is always ready")
        if name != channel.name:
            self.losses.add(where, line, f"is called {name!r} there")
        if channel.topic:
            self.losses.add(where, line, f"its topic {channel.topic!r} is not written")
        if fields:
            what = f"messages are variables there, and the class {channel.message!r} does not come back"
            self.losses.add(where, line, what)
        slots: dict[str, tuple[str, str]] = {}
        for part in fields:
            if is_outer or part.type not in ("bool", "int") or part.shape:
                rule = f"its field {part.name!r} is not written: what the tester or a message of that type says is open"
                self.losses.add(where, line, rule)
            else:
                slots[part.name] = self.names.identifier(f"{name}_{part.name}"), part.type
        return SharedChannel(name, capacity, not capacity and (channel.receiver == ENVIRONMENT or is_read), slots)

    def _name(self, component: Component, variable: Variable) -> None:
        where = f"variable '{component.name}.{variable.name}'"
        if variable.type not in ("bool", "int", "enum", CLOCK):
            self.losses.add(where, variable.line, f"a variable of type {variable.type} is not written")
            return
        if variable.role == "input" and variable.type == "int" and not variable.domain:
            self.losses.add(where, variable.line, "an input without a range is not written: it cannot be selected")
            return
        if variable.role == "input":
            self.losses.add(where, variable.line, "an input is a selection at each edge that reads it")
        if variable.type == "enum":
            self.losses.add(where, variable.line, "its values are numbers there")
        if variable.type == "int" and not variable.domain:
            self.losses.add(where, variable.line, "has no range; there it goes from -32768 to 32767")
        if variable.unit not in ("1", "s" if variable.type == CLOCK else "1"):
            self.losses.add(where, variable.line, f"its unit {variable.unit!r} is not written")
        name = self.names.identifier(variable.name)
        if name != variable.name:
            self.losses.add(where, variable.line, f"is called {name!r} there")
        self.variables[component.name][variable.name] = name


def _bounds(variable: Variable) -> str:
    return f"[{variable.domain[0]},{variable.domain[-1]}]" if isinstance(variable.domain, range) else ""


WORDS = frozenset(
    re.findall(
        r"\w+",
        """after_update and assign before_update bool branchpoint broadcast break case chan clock commit const continue
        default do double dynamic else enum exists exit false for forall gantt guard hybrid if imply import init int
        invariant meta not numOf or postcondition priority process progress query rate return scalar select
        simulation spawn state string struct sum switch sync system trans true type typedef urgent void while xor abs
        fabs fmod fint floor ceil sqrt pow exp log sin cos tan deadlock location""",
    )
)
"""Names that mean something in UPPAAL and cannot be given."""

LARGEST_SCALE = 9
"""Most decimals of a second that the unit of time may have: nanoseconds."""

_LEVELS = {"||": 1, "&&": 2, "==": 3, "!=": 3, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 6, "-": 6, "*": 7, "/": 7, "%": 7}
_COMPARING = ("==", "!=", "<", "<=", ">", ">=")


class UnsayableError(Exception):
    """What UPPAAL cannot say, in words."""


@dataclass(frozen=True, slots=True)
class Rendering:
    """How the names and constants of one machine are written."""

    names: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, str] = field(default_factory=dict)
    naturals: Set[str] = frozenset()
    clocks: Set[str] = frozenset()
    scale: int = 1

    def text(self, node: Expression) -> str:
        """Return an expression in UPPAAL's C.

        >>> from parcours.model.expression import parse_expression
        >>> rendering = Rendering(naturals={"n"}, clocks={"t"}, scale=1000)
        >>> rendering.text(parse_expression("t >= 0.25 && max(n, 2) % 3 == floor(n / 2)"))
        't >= 250 && (n >? 2) % 3 == n / 2'
        """
        return self._of(node, 0, 1)

    def constant(self, value: float) -> str:
        """Return a number of units of time. Raises UnsayableError if it is not whole."""
        units = value * self.scale
        if abs(units - round(units)) > 1e-6 * max(1.0, abs(units)):
            raise UnsayableError(f"{value} s is no whole number of its units of time")
        return str(round(units))

    def _of(self, node: Expression, level: int, scale: int) -> str:
        own = 9
        match node:
            case Literal(bool() as value):
                text = "true" if value else "false"
            case Literal(str() as value):
                if value not in self.numbers:
                    raise UnsayableError("it has no texts")
                text = self.numbers[value]
            case Literal(int() | float() as value):
                text = self.constant(value) if scale > 1 else self._number(value)
            case Name() | FieldAccess():
                text = self._named(node)
            case Unary(operator, operand):
                text, own = operator + self._of(operand, 8, scale), 8
            case Binary(operator, left, right):
                text, own = self._binary(operator, left, right, scale)
            case Apply(function, arguments):
                text, own = self._applied(function, arguments)
        return f"({text})" if own < level else text

    def _number(self, value: int | float) -> str:
        if isinstance(value, float) and not value.is_integer():
            raise UnsayableError(f"it computes with whole numbers, not {value!r}")
        return str(int(value))

    def _named(self, node: Expression) -> str:
        if isinstance(node, Name) and node.id not in self.names:
            return node.id
        if str(node) not in self.names:
            raise UnsayableError(f"it cannot read {node}")
        return self.names[str(node)]

    def _binary(self, operator: str, left: Expression, right: Expression, scale: int) -> tuple[str, int]:
        own = _LEVELS[operator]
        if operator in _COMPARING:
            if (names(left) | names(right)) & self.clocks:
                scale = self.scale
            first, second = self._of(left, own + 1, scale), self._of(right, own + 1, scale)
            return f"{first} {operator} {second}", own
        if operator == "/":
            raise UnsayableError("it divides whole numbers only")
        if scale > 1 and operator in "*%":
            raise UnsayableError("it only adds to clocks")
        text = f"{self._of(left, own, scale)} {operator} {self._of(right, own + 1, scale)}"
        if operator == "%" and not is_natural(left, self.naturals):
            if not (isinstance(right, Literal) and is_natural(right, self.naturals)):
                raise UnsayableError("the sign of its remainder is that of the dividend")
            # C takes the sign of the dividend: |a % d| < d, so that one more d makes it positive.
            divisor = self._of(right, own + 1, scale)
            return f"({text} + {divisor}) % {divisor}", own
        return text, own

    def _applied(self, function: str, arguments: tuple[Expression, ...]) -> tuple[str, int]:
        match function, arguments:
            case "floor", (Binary("/", left, right),) if all(is_natural(each, self.naturals) for each in (left, right)):
                return f"{self._of(left, 7, 1)} / {self._of(right, 8, 1)}", 7
            case (("min" | "max"), _):
                sign = " <? " if function == "min" else " >? "
                return sign.join(self._of(each, 6, 1) for each in arguments), 5
            case "abs", (argument,):
                return f"abs({self._of(argument, 0, 1)})", 9
            case _:
                raise UnsayableError(f"it has no function {function!r}")


def scale_of(cefsm: Cefsm) -> int:
    """Return the units of time a second in which every time of a model is whole, as far as nanoseconds go."""
    times: list[float] = []
    for component in cefsm.components:
        clocks = {variable.name for variable in component.variables if variable.type == CLOCK}
        for machine in component.machines:
            conditions = [condition for _, condition in machine.invariants]
            for transition in machine.transitions:
                times += [time for time in transition.duration or () if math.isfinite(time)]
                conditions += [transition.guard] if transition.guard is not None else []
                for action in transition.actions:
                    if isinstance(action, Assignment) and action.target in clocks:
                        times += _numbers(action.value)
            for condition in conditions:
                if names(condition) & clocks:
                    times += _numbers(condition)
    # UPPAAL's clocks compare with integers only: 0.25 s becomes 250 units of a millisecond.
    scale = 1
    while scale < 10**LARGEST_SCALE and any(abs(time * scale - round(time * scale)) > 1e-6 for time in times):
        scale *= 10
    return scale


def _numbers(node: Expression) -> list[float]:
    return [
        float(each.value)
        for each in walk(node)
        if isinstance(each, Literal) and isinstance(each.value, int | float) and not isinstance(each.value, bool)
    ]
