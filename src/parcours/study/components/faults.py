"""A component study under faults on purpose: each message lost, duplicated or corrupted, each component crashed.

The cases are enforced as usual; one component is given the faulty message, or is gone. What matters is whether a case
that was struck still passes: a fault that no case notices is one that neither the components nor the oracles resist.
"""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Literal

from parcours.abtc import Event
from parcours.errors import BadRequest, ParcoursError
from parcours.model.structure import Component as Modelled
from parcours.report.pieces import Cause, Column, Failing, Failures, Marked, Page, Section, Summary, Table
from parcours.run.faults import corrupted
from parcours.run.port import Component, Step
from parcours.study.components.isolation import Done, run_apart
from parcours.study.components.messages import ModelMessages
from parcours.study.components.running import functional_here
from parcours.study.components.systems import System
from parcours.study.components.tester import Wrapped
from parcours.study.mutation.twin import print_of
from parcours.study.parameters import Settings
from parcours.study.protocol import FaultReport, FaultRequest, Progress
from parcours.study.provenance import provenance
from parcours.study.reproducing import Reruns, spread
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

Kind = Literal["drop", "duplicate", "corrupt", "crash"]


@dataclass(frozen=True, slots=True)
class Strike:
    """One fault: the first message that a component takes up on a channel, or its first turn at all."""

    component: str
    kind: Kind
    channel: str = ""

    def __str__(self) -> str:
        return (
            f"{self.channel}: {self.kind} (to {self.component})" if self.channel else f"{self.component}: {self.kind}"
        )


@dataclass(frozen=True, slots=True)
class StruckCase:
    """What became of a case in which a fault struck."""

    case: Case
    judgement: Judgement
    sent: bytes  # digest of its messages; empty if its process hung or died


FaultCounts = tuple[str, int, int, int, str]
"""Fault, cases struck, noticed, unnoticed; the first reason."""


def catalogue(study: ComponentStudy) -> list[Strike]:
    """Return what can go wrong: each message that some transition receives, and each component."""
    from parcours.study.components.components_file import incoming

    found: list[Strike] = []
    for component in study.model.components:
        for channel in incoming(component):
            found += [Strike(component.name, kind, channel) for kind in ("drop", "duplicate", "corrupt")]
        found.append(Strike(component.name, "crash"))
    return found


def strike(study: ComponentStudy, request: FaultRequest, progress: Progress) -> FaultReport:
    """Execute cases under each fault and say which were noticed; a few that noticed one are executed again.

    Raises BadRequest: the study has a tester of its own, or no fault is chosen.
    """
    if study.system is None:
        rule = f"the components of {study.name} are made by a tester of its own"
        raise BadRequest(f"study {study.name!r}", rule, "faults strike what `system` makes", slug="faults-study")
    chosen = [one for one in catalogue(study) if request.only in str(one)]
    if not chosen:
        raise BadRequest("--only", f"some fault must contain it, but none contains {request.only!r}",
                         "see --list", slug="faults-none")  # fmt: skip
    lines = tuple(map(str, chosen))
    if request.listed:
        return FaultReport(lines)
    rows, noticed = [], []
    for done, fault in enumerate(chosen):
        progress("faults", done, len(chosen))
        struck = list(_struck_cases(study, fault, list(_cases(study, fault, request)), request))
        rows.append(_row(fault, struck))
        noticed += [(fault, one) for one in struck if not one.judgement.passed]
    progress("faults", len(chosen), len(chosen))
    repeated = _repeated(study, noticed, request)
    counts = (Column(name, ",d") for name in ("cases struck", "noticed", "unnoticed"))
    columns = (Column("fault", code=True), *counts, Column("first reason"))
    note = (
        "A case notices a fault if it does not pass. What no case notices, neither the components refuse nor oracles"
        " see: give the study oracles that look at the data."
    )
    table = Table(f"Faults on purpose, {study.name}", columns, tuple(rows), note)
    keys = ("fault", "struck", "noticed", "unnoticed", "why")
    document = {"study": study.name, "faults": [dict(zip(keys, row, strict=True)) for row in rows]}
    return FaultReport(lines, (table,), _fault_page(study, rows, table, request, repeated), document)


def _fault_page(
    study: ComponentStudy, rows: Sequence[FaultCounts], table: Table, request: FaultRequest, repeated: Reruns
) -> Page:  # fmt: skip
    """Return the page: which faults nobody noticed, and the table of all."""
    struck = [row for row in rows if row[1]]
    unseen, partly = [row for row in struck if not row[2]], [row for row in struck if row[2] and row[3]]
    where = study.where or study.name
    groups = {"no case noticed it": unseen, "some cases did not notice it": partly}
    causes = tuple(
        Cause(words, len(mine), tuple(
            Failing(row[0], Marked("unnoticed", "bad" if mine is unseen else "poor"),
                    f"{row[3]} of {row[1]} struck cases passed" + (f"; noticed elsewhere: {row[4]}" if row[4] else ""),
                    (), (shlex.join(["parcours", "faults", where, "--seed", str(request.seed), "--cases",
                                     str(request.cases), "--only", row[0]]),))
            for row in mine
        ))
        for words, mine in groups.items() if mine
    )  # fmt: skip
    idle = len(rows) - len(struck)
    facts = [*repeated.warning()]
    facts += [f"{len(mine)} fault{'s' * (len(mine) != 1)}: [{words}](#cause_{k})." for k, (words, mine) in
             enumerate(((words, mine) for words, mine in groups.items() if mine), 1)]  # fmt: skip
    facts += [f"{idle} faults struck no case: nothing that they could hit was sent."] if idle else []
    seen = len(struck) - len(unseen)
    summary = Summary(
        f"The cases of **{study.name}** ran under {len(rows)} faults, one at a time.",
        f"They noticed {seen} of the {len(struck)} that struck.", "poor" if unseen or not struck else "good",
        tuple(facts),
        "Start with [the faults that no case noticed](#failures): give the study oracles that look at the data."
        if causes else "Every fault is noticed: keep these oracles.",
    )  # fmt: skip
    lead = "If no case notices a fault, the components accepted it and no oracle saw it."
    listed = Section("Faults that were not noticed", lead, (Failures("Faults", causes, what="fault"),), "failures")
    facts_of = (*provenance().items(), ("study", study.name), ("seed", str(request.seed)),
                ("run again", str(repeated)))  # fmt: skip
    sections = (*((listed,) if causes else ()), Section("Faults", "", (table,), "faults"))
    return Page(f"{study.name} under faults", "", facts_of, sections, summary)


def _row(fault: Strike, struck: Sequence[StruckCase]) -> FaultCounts:
    whys = [one.judgement.why for one in struck if not one.judgement.passed]
    return str(fault), len(struck), len(whys), len(struck) - len(whys), next(filter(None, whys), "")


def _repeated(
    study: ComponentStudy, noticed: Sequence[tuple[Strike, StruckCase]], request: FaultRequest
) -> Reruns:  # fmt: skip
    """Execute a few of the cases that noticed their fault again: is what was sent, and the verdict, the same?"""
    again = spread(noticed)
    equal = sum([one] == list(_struck_cases(study, fault, [one.case], request)) for fault, one in again)
    return Reruns("cases that noticed a fault", equal, len(again), len(noticed))


def _cases(study: ComponentStudy, fault: Strike, request: FaultRequest) -> Iterator[Case]:
    """Return the first cases in which the fault can strike."""

    def is_struck(event: Event) -> bool:
        channel = event.receives.channel if event.receives is not None else None
        return event.component == fault.component and fault.channel in ("", channel)

    cases = (case for case in study.plan(request.seed).cases() if any(map(is_struck, study.events(case))))
    return islice(cases, request.cases)


def _struck_cases(
    study: ComponentStudy, fault: Strike, cases: Sequence[Case], request: FaultRequest
) -> Iterator[StruckCase]:  # fmt: skip
    """Execute cases under a fault, and yield those in which it struck."""
    by_id = {case.id: case for case in cases}

    def work(id: str) -> tuple[Judgement, bytes, bool]:
        assert study.system is not None
        system = _Striking(study.system, fault, study.messages, request.seed)
        faulty = dataclasses.replace(study, system=system)
        faulty.__dict__["abstracts"] = study.abstracts  # what was derived from the model stays as it is
        run = functional_here(faulty, by_id[id], request.settings)
        return run.judgement, print_of(run.execution.trace, study.recorded), system.struck

    for id, answer in run_apart(list(by_id), work, study.patience):
        judgement, sent, struck = (
            answer.result if isinstance(answer, Done) else (Judgement(Verdict.FAIL, answer), b"", True)
        )
        if struck:
            yield StruckCase(by_id[id], judgement, sent)


class _Striking:
    """A system of whose components one is struck."""

    def __init__(self, system: System, fault: Strike, messages: ModelMessages, seed: int) -> None:
        self._system, self._fault, self._messages, self._seed = system, fault, messages, seed
        self.struck = False

    def component(self, modelled: Modelled, case: Case, settings: Settings) -> Component:
        """Return the component, struck if it is the one."""
        made = self._system.component(modelled, case, settings)
        return _Struck(made, self) if modelled.name == self._fault.component else made

    def strikes(self, channel: str | None) -> Kind | None:
        """Return what strikes now; a fault strikes once."""
        if self.struck or (self._fault.channel and channel != self._fault.channel):
            return None
        self.struck = True
        return self._fault.kind

    def corrupted(self, channel: str, message: object) -> object:
        """Return a message with one field changed, of the right types still."""
        values, _ = corrupted(self._messages.flatten(channel, message), self._seed)
        try:
            return self._messages.restore(channel, values)
        except ParcoursError:
            return message  # it can only be changed into something that is no such message


class _Struck(Wrapped):
    """A component whose messages, or whose life, are struck."""

    def __init__(self, component: Component, system: _Striking) -> None:
        super().__init__(component)
        self._system = system

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take up a message as the fault lets it arrive."""
        kind = self._system.strikes(channel)
        if kind == "crash":
            raise RuntimeError("crashed on purpose")
        if kind == "drop":
            return
        if kind == "corrupt" and channel is not None:
            message = self._system.corrupted(channel, message)
        yield from self._component.handle(channel, message, now)
        if kind == "duplicate":
            yield from self._component.handle(channel, message, now)

    def prompt(self, transition: str, now: int) -> Iterator[Step]:
        """Ask the component for a transition."""
        if self._system.strikes(None) == "crash":
            raise RuntimeError("crashed on purpose")
        return super().prompt(transition, now)
