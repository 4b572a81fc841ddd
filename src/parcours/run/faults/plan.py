"""What shall go wrong, where, when and how much: plain data that stands in a case, on a command line, or in a file.

All times are whole nanoseconds since the run began. A plan says nothing of chance but its seed: what happens to
which message follows from it (`effects`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import combinations
from math import isfinite
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

GREATEST_FACTOR = 1e6

WORK = 1_000_000
"""What a transition that takes no time costs when its component is slowed down, before the factor [ns]."""


@dataclass(frozen=True, slots=True)
class ChannelFault:
    """What happens to the messages of one channel.

    Attributes:
        channel: by the model's name.
        kind: what happens to them.
        probability: that it happens to one of them.
        amount_ns: how long, for those kinds that last [ns].
        how: in which way a message is corrupted.
        from_ns: it happens to messages sent from then on [ns] ...
        until_ns: ... and before then [ns]; None is without end.
        messages: first and last number of those it may happen to, counted on the channel from 0; None is all.

    Raises:
        BadRequest: a value is out of its range, or has no meaning for the kind.

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
        _require_name(where, self.channel)
        if self.kind not in CHANNEL_KINDS:
            rule = f"what happens to a channel must be a known kind, but {self.kind!r} was given"
            raise BadRequest(where, rule, one_of(str(self.kind), CHANNEL_KINDS), slug="fault-kind")
        if not 0.0 < self.probability <= 1.0:
            rule = f"its share of messages must be above 0 and at most 100 %, but is {percent_text(self.probability)}"
            raise BadRequest(where, rule, slug="fault-range")
        due = "above 0" if self.kind in _NEEDS_AMOUNT else "0 or more" if self.kind in _TAKES_AMOUNT else "left out"
        least = 1 if self.kind in _NEEDS_AMOUNT else 0
        if not least <= self.amount_ns <= (LONGEST if self.kind in _TAKES_AMOUNT else 0):
            rule = f"the time of a {self.kind} must be {due}, but is {self.amount_ns} ns"
            remedy = f"write for example {self.kind} 200 ms" if self.kind in _NEEDS_AMOUNT else ""
            raise BadRequest(where, rule, remedy, slug="fault-range")
        if self.how not in HOWS or (self.how != "any" and self.kind != "corrupt"):
            rule = f"only a corruption has a way, one of {', '.join(HOWS)}, but {self.kind} has {self.how!r}"
            raise BadRequest(where, rule, slug="fault-range")
        _require_window(where, self.from_ns, self.until_ns)
        if self.messages is not None and not 0 <= self.messages[0] <= self.messages[1]:
            rule = f"the first message must come before the last, but {self.messages[0]} and {self.messages[1]} given"
            raise BadRequest(where, rule, slug="fault-range")

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
    """What happens to one component.

    Attributes:
        component: by the model's name.
        kind: what happens to it.
        at_ns: when [ns].
        for_ns: for how long [ns]; None, as of a crash, is without end.
        factor: how many times as long its work takes when slowed down.

    Raises:
        BadRequest: a value is out of its range, or has no meaning for the kind.

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
        _require_name(where, self.component)
        if self.kind not in COMPONENT_KINDS:
            rule = f"what happens to a component must be a known kind, but {self.kind!r} was given"
            raise BadRequest(where, rule, one_of(str(self.kind), COMPONENT_KINDS), slug="fault-kind")
        if self.kind == "crash" and self.for_ns is not None:
            rule = f"a crash is for good, but {self.for_ns} ns was given"
            raise BadRequest(where, rule, "write freeze for one that ends", slug="fault-range")
        slow = self.kind == "slow_down"
        if not (isfinite(self.factor) and (1.0 < self.factor <= GREATEST_FACTOR if slow else self.factor == 1.0)):
            rule = f"the factor of a slow-down must be above 1 and at most {GREATEST_FACTOR:g}, and only it has one"
            raise BadRequest(where, f"{rule}, but {self.kind} has {self.factor:g}", slug="fault-range")
        _require_window(where, self.at_ns, self.until_ns)

    @property
    def until_ns(self) -> int | None:
        """When it is over [ns]; None is never."""
        return None if self.for_ns is None else self.at_ns + self.for_ns

    def __str__(self) -> str:
        parts = [f"{self.component}: {self.kind.replace('_', ' ')}"]
        if self.kind == "slow_down":
            parts.append(f"{plain(Decimal(repr(float(self.factor))))} x")
        parts.append(f"at {time_text(self.at_ns)}")
        if self.for_ns is not None:
            parts.append(f"for {time_text(self.for_ns)}")
        return " ".join(parts)


Fault: TypeAlias = ChannelFault | ComponentFault


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """All that shall go wrong in a run. Its text has a line each for the seed and every fault.

    Attributes:
        seed: decides what happens to which message.
        faults: in any order.
        work_ns: what one transition of a slowed-down component costs at least before it is multiplied [ns]; on a host
            where work takes no time, a slow-down is `factor` times this for each transition.

    Raises:
        BadRequest: two faults of a kind meet a channel, or any two a component, at the same time.

    >>> plan = FaultPlan(7, (ChannelFault("obstacles", "delay", amount_ns=200_000_000),))
    >>> print(plan)
    seed: 7
    obstacles: delay 200 ms
    """

    seed: int = 0
    faults: tuple[Fault, ...] = ()
    work_ns: int = WORK

    def __post_init__(self) -> None:
        if not 0 <= self.seed < 2**63:
            raise BadRequest("faults, seed", f"must be from 0 to 2**63 - 1, but is {self.seed}", slug="fault-range")
        if not 0 < self.work_ns <= LONGEST:
            rule = f"must be above 0 and at most a day, but is {self.work_ns} ns"
            raise BadRequest("faults, work", rule, slug="fault-range")
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
        return min((f.from_ns if isinstance(f, ChannelFault) else f.at_ns for f in self.faults), default=0)

    @property
    def until_ns(self) -> int | None:
        """When all faults are over [ns]; None is never. A window of message numbers has no end in time."""
        ends = [fault.until_ns for fault in self.faults]
        return None if None in ends else max((end for end in ends if end is not None), default=0)

    def check(self, channels: Sequence[str], components: Sequence[str]) -> None:
        """Refuse what the system does not have.

        Raises:
            BadRequest: a fault names a channel or component that is not among the given.
        """
        for fault in self.faults:
            if isinstance(fault, ChannelFault):
                _require_known("channel", fault.channel, channels, str(fault))
            else:
                _require_known("component", fault.component, components, str(fault))

    def to_json(self) -> dict[str, object]:
        """Return the plan as it stands in a case file: seed, cost of work and one line of text a fault."""
        return {"seed": self.seed, "work_ns": self.work_ns, "faults": [str(fault) for fault in self.faults]}


NO_FAULTS = FaultPlan()


def _require_known(what: str, given: str, known: Iterable[str], line: str) -> None:
    names = list(known)
    if given not in names:
        rule = f"no {what} is called {given!r}"
        raise BadRequest(f"fault {line!r}", rule, one_of(given, names), slug="fault-unknown-name")


def _require_name(where: str, name: str) -> None:
    if not name or any(c.isspace() or c in ":;#" or not c.isprintable() for c in name):
        rule = f"a name has at least one character, none of them : ; # or a blank, but {name[:40]!r} given"
        raise BadRequest(where, rule, slug="fault-name")


def _require_window(where: str, begin: int, end: int | None) -> None:
    if not 0 <= begin <= LONGEST or (end is not None and not begin < end <= 2 * LONGEST):
        until = "without end" if end is None else f"to {end} ns"
        rule = f"it must begin at 0 or later and end after it begins, but is from {begin} ns {until}"
        raise BadRequest(where, rule, slug="fault-range")


def _collide(one: Fault, other: Fault) -> bool:
    """Return whether the two say different things of the same."""
    if isinstance(one, ChannelFault) and isinstance(other, ChannelFault):
        if (one.channel, one.kind) != (other.channel, other.kind):
            return False
        if one.messages is not None and other.messages is not None and (
            one.messages[1] < other.messages[0] or other.messages[1] < one.messages[0]
        ):  # fmt: skip
            return False
        return _meet(one.from_ns, one.until_ns, other.from_ns, other.until_ns)
    if isinstance(one, ComponentFault) and isinstance(other, ComponentFault) and one.component == other.component:
        return _meet(one.at_ns, one.until_ns, other.at_ns, other.until_ns)
    return False


def _meet(begin: int, end: int | None, other_begin: int, other_end: int | None) -> bool:
    return (end is None or other_begin < end) and (other_end is None or begin < other_end)


NANOSECONDS: dict[str, int] = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Unit of time -> how many nanoseconds it has."""


def time_text(time: int) -> str:
    """Return a time [ns] in the greatest unit of which it is at least one.

    >>> time_text(2_000_000_000), time_text(1_500_000), time_text(33_333_333), time_text(0)
    ('2 s', '1.5 ms', '33.333333 ms', '0 s')
    """
    for unit, size in NANOSECONDS.items():
        if time >= size:
            return f"{plain(Decimal(time) / size)} {unit}"
    return "0 s"


def time_of(number: str, unit: str) -> int | None:
    """Return the time [ns], or None if it is no whole number of nanoseconds.

    >>> time_of("1.5", "ms"), time_of("0.5", "ns")
    (1500000, None)
    """
    time = Decimal(number) * NANOSECONDS[unit]
    return int(time) if time == int(time) else None


def percent_text(share: float) -> str:
    """Return a share of one in percent.

    >>> percent_text(0.3), percent_text(0.07)
    ('30 %', '7 %')
    """
    return f"{plain(Decimal(repr(share)) * 100)} %"


def share_of(number: str) -> float:
    """Return the share of one that a percentage is.

    >>> share_of("30")
    0.3
    """
    return float(Decimal(number) / 100)


def plain(number: Decimal) -> str:
    """Return the number without exponent and without zeros that say nothing.

    >>> plain(Decimal("5.0")), plain(Decimal("1E+2"))
    ('5', '100')
    """
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
