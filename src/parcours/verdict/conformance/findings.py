"""What checking a trace against a model finds: the first deviation, the expected set, the path that led there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from parcours.run.trace import TraceEvent
from parcours.verdict.contracts import Tally
from parcours.verdict.judgement import Judgement

_SHOWN = 12


@dataclass(frozen=True, slots=True, order=True)
class Expectation:
    """One thing that the model lets happen next.

    `what` is take (name is a transition), send or receive (name is a channel), or silence, when nothing need come.
    `values` are the fields of a message that the model says.
    """

    what: Literal["take", "send", "receive", "silence"]
    name: str = ""
    values: tuple[tuple[str, object], ...] = ()

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {value!r}" for name, value in self.values)
        return f"{self.what} {self.name}".strip() + (f"({values})" if values else "")


@dataclass(frozen=True, slots=True)
class TraceDeviation:
    """The first point at which a trace leaves what the model allows.

    Attributes:
        position: index of the event in the trace; the number of events before it, if none came.
        time: when [ns]; of silence, when the timeout passed.
        component: who deviated, as the trace names it.
        event: what happened; None if the fault is that nothing did.
        rule: what the model demands, and what was found.
        expected: what could have come from this component instead.
        path: what led there: the transitions it took, or, of a system seen from outside, its messages (?in, !out).
        doubt: why it may be none after all; empty if it is sure.
    """

    position: int
    time: int
    component: str
    event: TraceEvent | None
    rule: str
    expected: tuple[Expectation, ...]
    path: tuple[str, ...]
    doubt: str = ""

    def __str__(self) -> str:
        expected = ", ".join(map(str, self.expected)) or "nothing more"
        shown = " ".join(self.path[-_SHOWN:]) or "its start"
        earlier = len(self.path) - _SHOWN
        before = f" (and {earlier} before)" if earlier > 0 else ""
        doubt = f"; in doubt: {self.doubt}" if self.doubt else ""
        at = f"event {self.position} at {self.time / 1e6:.3f} ms, {self.component}"
        return f"{at}: {self.rule}; expected: {expected}; after {shown}{before}{doubt}"


@dataclass(frozen=True, slots=True)
class Conformance:
    """What came of checking one whole trace.

    Attributes:
        judgement: pass, fail, or inconclusive where a deviation is in doubt or the trace does not say enough.
        deviation: the first one, or None.
        n_events: events looked at; those after a deviation are not.
        n_outside: of these, how many the model has no name for.
        tally: what was judged of data, and what could not be.
    """

    judgement: Judgement
    deviation: TraceDeviation | None
    n_events: int
    n_outside: int
    tally: Tally

    @property
    def expected(self) -> tuple[Expectation, ...]:
        """What could have come at the deviation; empty without one."""
        return self.deviation.expected if self.deviation else ()

    @property
    def path(self) -> tuple[str, ...]:
        """What led to the deviation; empty without one."""
        return self.deviation.path if self.deviation else ()
