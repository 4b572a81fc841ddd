"""Oracles that know the answer: a second, slow and obvious function for a service, and relations between two runs.

reference   request ---> component ---> answer          relation   supply --> case --> messages
                    \\--> function ----> the same?                     | change           | expect
                                                                  supply' -> case --> messages'  the same?
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from parcours.abtc import Event
from parcours.model.formulas import reverse
from parcours.model.structure import ENVIRONMENT, Cefsm
from parcours.run.trace import REPEAT, Trace, TraceEvent
from parcours.study.components.systems import arguments
from parcours.study.loading import load
from parcours.study.parameters import Settings
from parcours.suite import Case
from parcours.verdict.contracts import View, plain
from parcours.verdict.judgement import Judgement, Verdict

Function = Callable[[object], object]

TOLERANCE = 1e-9
"""How far numbers may be apart that count as equal, absolutely or as a share of the greater one."""


@dataclass(frozen=True, slots=True)
class Beyond:
    """What a wanted number may be of which only the side of another number is known."""

    bound: float
    is_above: bool

    def __str__(self) -> str:
        return f"{'more' if self.is_above else 'less'} than {self.bound!r}"


def above(bound: float) -> Beyond:
    """Want any number greater than this one.

    >>> difference({"duration": 2.0}, {"duration": above(2.5)}, 1e-9)
    '.duration is 2.0, but must be more than 2.5'
    """
    return Beyond(bound, True)


def below(bound: float) -> Beyond:
    """Want any number less than this one."""
    return Beyond(bound, False)


def difference(given: object, wanted: object, tolerance: float) -> str:
    """Return the first place where a message differs from the wanted one; empty if none does.

    What the wanted one lacks, or has as None, may be anything.

    >>> difference({"way": [1.0, 2.5]}, {"way": [1.0, 2.0]}, 1e-9)
    '.way[1] is 2.5, but must be 2.0'
    """
    found = _parted(given, wanted, tolerance)
    return f"it{found}" if found.startswith(" ") else found


def _parted(given: object, wanted: object, tolerance: float) -> str:
    """Return where it differs and what it holds, such as `.way[1] is 2.5, but must be 2.0`."""
    if wanted is None:
        return ""
    if _is_number(given) and _is_number(wanted):
        if math.isclose(given, wanted, rel_tol=tolerance, abs_tol=tolerance):  # type: ignore[arg-type]
            return ""
    elif isinstance(wanted, list | tuple) and isinstance(given, list | tuple):
        if len(given) != len(wanted):
            return f" has {len(given)} items, but must have {len(wanted)}"
        for k, (one, other) in enumerate(zip(given, wanted, strict=True)):
            if found := _parted(one, other, tolerance):
                return f"[{k}]{found}"
        return ""
    elif isinstance(wanted, Mapping) and isinstance(given, Mapping):
        for name, one in wanted.items():
            if name not in given:
                return f".{name} is missing"
            if found := _parted(given[name], one, tolerance):
                return f".{name}{found}"
        return ""
    elif isinstance(wanted, Beyond):
        kept = _is_number(given) and (given > wanted.bound if wanted.is_above else given < wanted.bound)  # type: ignore[operator]
        return "" if kept else f" is {given!r:.80}, but must be {wanted}"
    return "" if given == wanted else f" is {given!r:.80}, but must be {wanted!r:.80}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Reference:
    """An oracle: what a component sends on a channel is what a function of the user's makes of what it received.

    The function gets the request that is answered (of the channel's topic, if it is a service), else the message that
    the component received last; it returns the message, or those of its fields that are known, or None where it does
    not say. A class is made once for each instance of a component, with those of its parameters that are called `case`
    or as something known, and its objects are such functions.
    """

    cefsm: Cefsm
    channel: str
    target: str
    folder: Path
    tolerance: float = TOLERANCE
    view: View = plain
    of_data: bool = True
    """It looks at data, as formulas do: `parcours mutate --no-data-oracles` leaves such oracles out."""

    def __call__(self, case: Case, trace: Trace, settings: Settings) -> Judgement:
        """Judge every message on the channel."""
        return self.judge(case, trace, settings)

    def judge(self, case: Case, trace: Trace, known: Mapping[str, object]) -> Judgement:
        """Judge every message on the channel; `known` is what a class may be made with, by name."""
        make, made = load(self.target, self.folder), dict[str, Function]()
        asked = reverse(self.cefsm, self.cefsm.channel(self.channel))
        received: dict[str, TraceEvent] = {}
        for position, event in enumerate(trace.events):
            if event.kind == "note" and event.text == REPEAT:
                made, received = {}, {}
            if event.kind == "receive" and (asked is None or event.channel == asked.name):
                received[event.component] = event
            is_own = event.kind == "send" and event.channel == self.channel and event.component != ENVIRONMENT
            if not is_own or event.component not in received:
                continue
            try:
                if event.component not in made:
                    made[event.component] = _function(make, case, known)
                before, sent = self._seen(received[event.component]), self._seen(event)
                wanted = made[event.component](before)
            except Exception as error:
                return Judgement(Verdict.ERROR, f"reference {self.target} raised {type(error).__name__}: {error}")
            if wanted is not None and (found := difference(sent, wanted, self.tolerance)):
                why = f"event {position}, {self.channel} of {event.component}: by {self.target}, {found}"
                return Judgement(Verdict.FAIL, why)
        return Judgement(Verdict.PASS, f"{self.channel} is what {self.target} says")

    def _seen(self, event: TraceEvent) -> object:
        message = self.view(event.channel, event.payload)
        return event.payload if message is None else message


def _function(make: object, case: Case, known: Mapping[str, object]) -> Function:
    """Return the function that answers for one instance."""
    return make(**arguments(make, case, known)) if isinstance(make, type) else make  # type: ignore[return-value]


@dataclass(frozen=True)
class Relation:
    """A metamorphic relation: if what the environment supplies is changed so, what components send changes so.

    `change(channel, message)` returns the message to supply instead; `expect(channel, message)` what a component must
    send then where it sent `message` before, with those fields only that are known, or None where nothing is known.
    """

    name: str
    change: str
    expect: str
    folder: Path
    tolerance: float = TOLERANCE
    channels: tuple[str, ...] = ()  # whose messages `expect` is asked about; all if empty

    def supplied(self, supply: Callable[[Event], object]) -> Callable[[Event], object]:
        """Return what supplies the changed messages."""
        function = load(self.change, self.folder)

        def changed(event: Event) -> object:
            assert event.receives is not None
            return function(event.receives.channel, supply(event))  # type: ignore[operator]

        return changed

    def judge(self, trace: Trace, changed: Trace, view: View = plain) -> str:
        """Return what is wrong with the changed run; empty if nothing is. Raises what the user's function raises.

        Args:
            view: reads the model's fields from a payload; where it cannot, the payload is compared.
        """
        function = load(self.expect, self.folder)
        deviation = next((event.text for event in changed.events if event.kind == "deviation"), "")
        if deviation:
            return f"relation {self.name}: the changed case took another way: {deviation}"
        for before, after in zip_longest(_sent(trace), _sent(changed)):
            if before is None or after is None or before.channel != after.channel:
                there, here = (one.channel if one is not None else "nothing" for one in (before, after))
                return f"relation {self.name}: {there} was sent, but in the changed case {here}"
            if self.channels and before.channel not in self.channels:
                continue
            was, now = (view(one.channel, one.payload) or one.payload for one in (before, after))
            wanted = function(before.channel, was)  # type: ignore[operator]
            if wanted is not None and (found := difference(now, wanted, self.tolerance)):
                return f"relation {self.name}: {after.channel} of {after.component} in the changed case: {found}"
        return ""


def _sent(trace: Trace) -> Iterator[TraceEvent]:
    return (event for event in trace.events if event.kind == "send" and "#" in event.component)
