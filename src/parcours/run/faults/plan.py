"""What goes wrong, where, when and how much: plain data that stands in a case, on a command line, or in a file.

All times are whole nanoseconds since the run began. A plan says nothing of chance but its seed: what happens to
which message follows from it (`effects`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import combinations
from math import inf, isfinite
from typing import Literal, TypeAlias, get_args

from parcours.errors import BadRequest, one_of
from parcours.run.faults.corruption import HOWS, How

ChannelKind = Literal["delay", "jitter", "drop", "duplicate", "reorder", "corrupt"]
"""delay: it arrives later by the time given, in order. jitter: by up to that time, in order. drop: it is lost.
duplicate: it arrives twice, the second time later. reorder: it is held back while later ones overtake it. corrupt: its
content is changed."""

ComponentKind = Literal["crash", "freeze", "slow_down"]
"""crash: it is gone for good, and all that waits for it. freeze: it does nothing for a while, then goes on. slow_down:
all it does takes several times as long."""

CHANNEL_KINDS: tuple[ChannelKind, ...] = get_args(ChannelKind)
COMPONENT_KINDS: tuple[ComponentKind, ...] = get_args(ComponentKind)

_NEEDS_AMOUNT = ("delay", "jitter", "reorder")
_TAKES_AMOUNT = (*_NEEDS_AMOUNT, "duplicate")

LONGEST = 86_400 * 10**9
"""No time of a plan may be longer [ns]: a day."""

WORK = 1_000_000
"""What a transition that takes no time costs when its component is slowed down, before the factor [ns]."""

_GREATEST_FACTOR = 1e6


@dataclass(frozen=True, slots=True)
class ChannelFault:
    """What happens to the messages of one channel; `BadRequest` if that is out of range or has no meaning.

    Attributes:
        channel: by the model's name.
        kind: what happens to them.
        probability: that it happens to one of them.
        amount_ns: how long, for those kinds that last [ns].
        how: in which way a message is corrupted.
        from_ns: it happens to messages sent from then on [ns] ...
        until_ns: ... and before then [ns]; None is without end.
        messages: first and last number of those it may happen to, counted on the channel from 0; None is all.

    >>> str(ChannelFault("best_trajectory", "drop", 0.3, from_ns=2 * 10**9, until_ns=5 * 10**9))
    'best_trajectory: drop 30 % from 2 s to 5 s'
    """

    channel: str
    kind: ChannelKind
    probability: float = 1.0
    amount_ns: int = 0
    how: How = "any"
    from_ns: int = 0
    until_ns: int | None = None
    messages: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        where = f"fault of channel {self.channel!r}"
        _require_sound(where, self.channel, self.from_ns, self.until_ns)
        if self.kind not in CHANNEL_KINDS:
            rule = f"what happens to a channel must be a known kind, but {self.kind!r} was given"
            raise BadRequest(where, rule, one_of(str(self.kind), CHANNEL_KINDS), slug="fault-kind")
        if not 0.0 < self.probability <= 1.0:
            share = percent_text(self.probability)
            raise _out_of_range(where, f"its share of messages must be above 0 and at most 100 %, but is {share}")
        needs, takes = self.kind in _NEEDS_AMOUNT, self.kind in _TAKES_AMOUNT
        if not int(needs) <= self.amount_ns <= (LONGEST if takes else 0):
            due = "above 0" if needs else "0 or more" if takes else "left out"
            remedy = f"write for example {self.kind} 200 ms" if needs else ""
            raise _out_of_range(where, f"the time of a {self.kind} must be {due}, but is {self.amount_ns} ns", remedy)
        if self.how not in HOWS or (self.how != "any" and self.kind != "corrupt"):
            rule = f"only a corruption has a way, one of {', '.join(HOWS)}, but {self.kind} has {self.how!r}"
            raise _out_of_range(where, rule)
        if self.messages is not None and not 0 <= self.messages[0] <= self.messages[1]:
            first, last = self.messages
            raise _out_of_range(where, f"the first message must come before the last, but {first} and {last} given")

    def reaches(self, k: int, time: int) -> bool:
        """Return whether it may happen to the k-th message of its channel (from 0), sent at `time` [ns]."""
        if time < self.from_ns or (self.until_ns is not None and time >= self.until_ns):
            return False
        return self.messages is None or self.messages[0] <= k <= self.messages[1]

    def __str__(self) -> str:
        parts = [f"{self.channel}: {self.kind}"]
        if self.how != "any":
            parts.append(self.how)
        if self.probability != 1.0:
            parts.append(percent_text(self.probability))
        if self.amount_ns:
            parts.append(("by " if self.probability != 1.0 else "") + time_text(self.amount_ns))
        if self.messages is not None:
            parts.append(f"messages {self.messages[0]} to {self.messages[1]}")
        if self.from_ns:
            parts.append(f"from {time_text(self.from_ns)}")
        if self.until_ns is not None:
            parts.append(f"to {time_text(self.until_ns)}")
        return " ".join(parts)


@dataclass(frozen=True, slots=True)
class ComponentFault:
    """What happens to one component; `BadRequest` if that is out of range or has no meaning.

    Attributes:
        component: by the model's name.
        kind: what happens to it.
        at_ns: when [ns].
        for_ns: for how long [ns]; None, as of a crash, is without end.
        factor: how many times as long its work takes when slowed down.

    >>> str(ComponentFault("Planner", "freeze", 3 * 10**9, 10**9))
    'Planner: freeze at 3 s for 1 s'
    """

    component: str
    kind: ComponentKind
    at_ns: int = 0
    for_ns: int | None = None
    factor: float = 1.0

    def __post_init__(self) -> None:
        where = f"fault of component {self.component!r}"
        _require_sound(where, self.component, self.at_ns, self.until_ns)
        if self.kind not in COMPONENT_KINDS:
            rule = f"what happens to a component must be a known kind, but {self.kind!r} was given"
            raise BadRequest(where, rule, one_of(str(self.kind), COMPONENT_KINDS), slug="fault-kind")
        if self.kind == "crash" and self.for_ns is not None:
            rule = f"a crash is for good, but {self.for_ns} ns was given"
            raise _out_of_range(where, rule, "write freeze for one that ends")
        slow = self.kind == "slow_down"
        if not (isfinite(self.factor) and (1.0 < self.factor <= _GREATEST_FACTOR if slow else self.factor == 1.0)):
            rule = f"the factor of a slow-down must be above 1 and at most {_GREATEST_FACTOR:g}, and only it has one"
            raise _out_of_range(where, f"{rule}, but {self.kind} has {self.factor:g}")

    @property
    def from_ns(self) -> int:
        """When it begins [ns]."""
        return self.at_ns

    @property
    def until_ns(self) -> int | None:
        """When it is over [ns]; None is never."""
        return None if self.for_ns is None else self.at_ns + self.for_ns

    def __str__(self) -> str:
        factor = f" {_plain(Decimal(repr(float(self.factor))))} x" if self.kind == "slow_down" else ""
        lasts = "" if self.for_ns is None else f" for {time_text(self.for_ns)}"
        return f"{self.component}: {self.kind.replace('_', ' ')}{factor} at {time_text(self.at_ns)}{lasts}"


Fault: TypeAlias = ChannelFault | ComponentFault


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """Everything that goes wrong in a run. Its text has a line each for the seed and every fault.

    Attributes:
        seed: decides what happens to which message.
        faults: in any order.
        work_ns: what one transition of a slowed-down component costs at least before it is multiplied [ns]; on a host
            where work takes no time, a slow-down is `factor` times this for each transition.

    Raises:
        BadRequest: two faults of a kind meet a channel, or any two a component, at the same time.
    """

    seed: int = 0
    faults: tuple[Fault, ...] = ()
    work_ns: int = WORK

    def __post_init__(self) -> None:
        if not 0 <= self.seed < 2**63:
            raise _out_of_range("faults, seed", f"must be from 0 to 2**63 - 1, but is {self.seed}")
        if not 0 < self.work_ns <= LONGEST:
            raise _out_of_range("faults, work", f"must be above 0 and at most a day, but is {self.work_ns} ns")
        for one, other in combinations(self.faults, 2):
            if _collide(one, other):
                rule = f"faults of one channel at the same time must differ in kind, but these do not: {one}; {other}"
                if isinstance(one, ComponentFault):
                    rule = f"a component has one fault at a time, and none after its crash, but: {one}; {other}"
                raise BadRequest("faults", rule, "let one end before the other begins", slug="fault-overlap")

    def __bool__(self) -> bool:
        return bool(self.faults)

    def __str__(self) -> str:
        work = [] if self.work_ns == WORK else [f"work: {time_text(self.work_ns)}"]
        return "\n".join([f"seed: {self.seed}", *work, *map(str, self.faults)])

    @property
    def of_channels(self) -> tuple[ChannelFault, ...]:
        """The faults of channels."""
        return tuple(fault for fault in self.faults if isinstance(fault, ChannelFault))

    @property
    def of_components(self) -> tuple[ComponentFault, ...]:
        """The faults of components, in order of time."""
        found = (fault for fault in self.faults if isinstance(fault, ComponentFault))
        return tuple(sorted(found, key=lambda fault: (fault.at_ns, fault.component)))

    @property
    def begins_ns(self) -> int:
        """When the first fault may strike [ns]; 0 if there is none."""
        return min((fault.from_ns for fault in self.faults), default=0)

    @property
    def until_ns(self) -> int | None:
        """When all faults are over [ns]; None is never. A window of message numbers has no end in time."""
        ends = [fault.until_ns for fault in self.faults]
        return None if None in ends else max((end for end in ends if end is not None), default=0)

    def check(self, channels: Sequence[str], components: Sequence[str]) -> None:
        """Raise BadRequest if a fault names a channel or component that the system does not have."""
        for fault in self.faults:
            if isinstance(fault, ChannelFault):
                what, name, known = "channel", fault.channel, channels
            else:
                what, name, known = "component", fault.component, components
            if name not in known:
                rule = f"no {what} is called {name!r}"
                raise BadRequest(f"fault {str(fault)!r}", rule, one_of(name, known), slug="fault-unknown-name")


def _out_of_range(where: str, rule: str, remedy: str = "") -> BadRequest:
    return BadRequest(where, rule, remedy, slug="fault-range")


def _require_sound(where: str, name: str, start: int, end: int | None) -> None:
    if not name or any(c.isspace() or c in ":;#" or not c.isprintable() for c in name):
        rule = f"a name has at least one character, none of them : ; # or a blank, but {name[:40]!r} given"
        raise BadRequest(where, rule, slug="fault-name")
    if not 0 <= start <= LONGEST or (end is not None and not start < end <= 2 * LONGEST):
        until = "without end" if end is None else f"to {end} ns"
        rule = f"it must begin at 0 or later and end after it begins, but is from {start} ns {until}"
        raise _out_of_range(where, rule)


def _collide(one: Fault, other: Fault) -> bool:
    """Return whether the two say different things of the same."""
    if isinstance(one, ChannelFault) and isinstance(other, ChannelFault):
        if (one.channel, one.kind) != (other.channel, other.kind):
            return False
        (first, last), (others_first, others_last) = one.messages or (0, inf), other.messages or (0, inf)
        if last < others_first or others_last < first:
            return False
    elif not (
        isinstance(one, ComponentFault) and isinstance(other, ComponentFault) and one.component == other.component
    ):
        return False
    end, others_end = one.until_ns, other.until_ns
    return (end is None or other.from_ns < end) and (others_end is None or one.from_ns < others_end)


NANOSECONDS: dict[str, int] = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Unit of time -> how many nanoseconds it has."""


def time_text(time: int) -> str:
    """Return a time [ns] in the greatest unit of which it is at least one.

    >>> time_text(2_000_000_000), time_text(1_500_000), time_text(33_333_333), time_text(0)
    ('2 s', '1.5 ms', '33.333333 ms', '0 s')
    """
    for unit, size in NANOSECONDS.items():
        if time >= size:
            return f"{_plain(Decimal(time) / size)} {unit}"
    return "0 s"


def percent_text(share: float) -> str:
    """Return a share of one in percent.

    >>> percent_text(0.3), percent_text(0.07)
    ('30 %', '7 %')
    """
    return f"{_plain(Decimal(repr(share)) * 100)} %"


def _plain(number: Decimal) -> str:
    """Return the number without exponent and without zeros that say nothing."""
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
