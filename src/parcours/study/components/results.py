"""Results of a component study: their file, tables, charts and rows of JUnit."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.model.picture import PaintState
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Figure, Page, Piece, Section, Table
from parcours.report.sequences import sequence_chart
from parcours.report.timings import TimingCase, timing_figure, timing_table
from parcours.report.writing import write_text
from parcours.run.noise import Noise, noise_of
from parcours.run.port import StepReport
from parcours.run.trace import SHOWN, Trace, TraceEvent
from parcours.study.components.executing import CaseTiming, Functional
from parcours.study.components.landing import Glance
from parcours.study.components.sequence import steps_of
from parcours.study.protocol import Measure
from parcours.suite import Case
from parcours.verdict.contracts import judged
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, parse_bound

LANDING = "landing.json"
FILE = "components.json"
_FORMAT = "components/3"
PER_VISIT, PER_CASE = "per-visit", "per-case"  # how many instances of a component a functional case has
_NOTES = {
    PER_VISIT: "Each visit of a component was an instance of its own.",
    PER_CASE: "All visits of a component were one instance per case; when timed, each was an instance of its own.",
}
_LONG = 200  # characters of a message that are shown
_AT = re.compile(r"\bevent \d+, |(?<=\w)#\d+|, after [^;]*$|, after [^;]*(?=;)|; held back: [^;]*")
_CAUSE = 200  # characters of a cause
_LONGEST = 2_000  # characters of a reason that are kept


@dataclass(frozen=True, slots=True)
class ComponentResult:
    """One judged case; `bound` (in words) and `durations` [ns] are those of a timing case, else empty."""

    id: str
    interaction: str
    verdict: str
    why: str
    bound: str = ""
    durations: tuple[int, ...] = ()
    judged: str = ""  # which checks of data were made, see `parcours.verdict.contracts`
    sent: Mapping[str, int] = field(default_factory=dict)  # messages by channel, in a functional case

    def junit(self) -> CaseResult:
        """Return it as JUnit knows it: a timing case lasts as long as its longest repeat that ended."""
        kind = "timing" if self.bound else "functional"
        if self.bound and self.interaction != interaction_of(self.id.split("/")[-2]):
            kind += f"/{self.interaction}"  # a case may be timed under several limits
        longest = max((one for one in self.durations if one != NEVER), default=0)
        return CaseResult(f"{kind}/{self.id}", Verdict(self.verdict), longest * 1e-9, self.why)


@dataclass(frozen=True, slots=True)
class ComponentResults:
    """Everything that one run of a component study showed."""

    host: str  # where the components were
    results: tuple[ComponentResult, ...]  # functional cases, then timing cases
    # of the machine, between the repeats of each interaction path's timing cases
    noise: Mapping[str, Noise] = field(default_factory=dict)
    planned: int = 0  # how many cases the run was to have
    instances: str = PER_VISIT  # of a component, in a functional case


def component_results(host: str, functional: Sequence[Functional], timing: Sequence[CaseTiming]) -> ComponentResults:
    """Return the judged component cases of a run."""
    results = [functional_result(run) for run in functional] + [timing_result(timed) for timed in timing]
    return ComponentResults(host, tuple(results), {timed.group: timed.noise for timed in timing})


def functional_result(run: Functional) -> ComponentResult:
    """Return the result of a functional case."""
    why = run.judgement.why.encode("utf-8", "backslashreplace").decode()  # a component may say anything, and much
    why = why if len(why) <= _LONGEST else f"{why[: _LONGEST - 3]}..."
    return ComponentResult(
        run.case.id, interaction_of(run.case.abstract), str(run.judgement.verdict), why, judged=run.judged,
        sent=sent_in(run.execution.trace.events),
    )  # fmt: skip


def sent_in(events: Iterable[TraceEvent]) -> dict[str, int]:
    """Return how many messages were sent on each channel, those of the tester included."""
    return dict(sorted(Counter(event.channel for event in events if event.kind == "send").items()))


def timing_result(timed: CaseTiming) -> ComponentResult:
    """Return the result of a timing case."""
    verdict, why = str(timed.judgement.verdict), timed.judgement.why
    return ComponentResult(timed.case.id, timed.group, verdict, why, str(timed.bound), timed.durations)


def interaction_of(abstract: str) -> str:
    """Return the interaction path that the id of an abstract case begins with.

    >>> interaction_of("ITP1-tp12.tp21.tp12-0.0.0"), interaction_of("sense-to-motion-tp1.tp2-0.1")
    ('ITP1', 'sense-to-motion')
    """
    return abstract.rsplit("-", 2)[0]


def write_components(folder: Path, given: ComponentResults) -> None:
    """Write the results into the folder. Raises BadRequest if it cannot be written to."""
    noise = {itp: {"of": one.of, "times": one.times} for itp, one in given.noise.items()}
    results = [asdict(result) for result in given.results]
    about = {"parcours": _FORMAT, "host": given.host, "instances": given.instances}
    document = {**about, "noise": noise, "results": results}
    write_text(folder / FILE, json.dumps(document, allow_nan=False) + "\n")


def read_components(folder: Path) -> ComponentResults:
    """Return the results that lie in the folder.

    Raises BadResults: there are none, or the file is cut short or of another version.
    """
    path = folder / FILE
    try:
        document = json.loads(path.read_bytes())
        if document["parcours"] != _FORMAT:
            raise ValueError(f"its format is {document['parcours']!r}, not {_FORMAT!r}")
        results = tuple(_result(entry) for entry in document["results"])
        noise = {str(itp): Noise(tuple(one["times"]), str(one["of"])) for itp, one in document["noise"].items()}
        return ComponentResults(str(document["host"]), results, noise, len(results), str(document["instances"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, ParcoursError) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> BadResults:
    rule = f"component results must be readable, but: {error}"
    return BadResults(str(path), rule, "run the study again", slug="results-components")


def _result(entry: Mapping[str, object]) -> ComponentResult:
    durations, sent = tuple(cast("list[int]", entry["durations"])), read_counts(entry.get("sent", {}))
    made = ComponentResult(**{**entry, "durations": durations, "sent": sent})  # type: ignore[arg-type]
    Verdict(made.verdict)
    return made


def read_counts(kept: object) -> dict[str, int]:
    """Return how many messages each channel carried, as a folder keeps it; none in folders of older versions."""
    return {str(channel): int(count) for channel, count in cast("dict[str, int]", kept).items()}


def entry_of(result: ComponentResult, noise: Noise | None = None) -> dict[str, object]:
    """Return a result as a line of a journal."""
    return {**asdict(result), "noise": noise and noise.listed()}


def results_of_journal(
    path: Path, host: str, planned: int, entries: Mapping[str, Mapping[str, object]], instances: str = ""
) -> ComponentResults:
    """Return the results that a journal holds, in the order of its lines. Raises BadResults if one is damaged."""
    results: list[ComponentResult] = []
    noise: dict[str, Noise] = {}
    try:
        for entry in entries.values():
            plain = dict(entry)
            measured = plain.pop("noise")
            results.append(_result(plain))
            if measured is not None:
                noise[results[-1].interaction] = noise_of(measured)
    except (KeyError, ValueError, TypeError) as error:
        raise _unreadable(path, error) from error
    return ComponentResults(host, tuple(results), noise, planned, instances)


def component_table(results: Sequence[ComponentResult], title: str, instances: str = "") -> Table:
    """Return how many cases of each interaction path passed, with a note on the instances that they had."""
    kinds = [r for r in results if not r.bound], [r for r in results if r.bound]
    rows = []
    for itp in dict.fromkeys(r.interaction for r in results):
        row: list[str] = [itp]
        for mine in kinds:
            counts = Counter(r.verdict for r in mine if r.interaction == itp)
            row.append(f"{counts['pass']} of {sum(counts.values())}")
        rows.append(tuple(row))
    heads = (Column("path"), Column("functional cases passed"), Column("timing cases passed"))
    return Table(title, heads, tuple(rows), _NOTES.get(instances, ""))


def failure_table(results: Iterable[ComponentResult], title: str) -> Table | None:
    """Return the cases that did not pass, each with its reason; None if all did."""
    rows = tuple((r.id, r.verdict, r.why) for r in results if r.verdict != "pass")
    if not rows:
        return None
    return Table(title, (Column("case", code=True), Column("verdict"), Column("why")), rows)


def data_table(results: Sequence[ComponentResult], checks: Sequence[str], title: str) -> Table | None:
    """Return how many of the model's formulas, guards, actions and messages were judged; None without any."""
    if not checks or not any(not r.bound for r in results):
        return None
    made = judged(checks, (r.judged for r in results))
    kinds: dict[str, list[str]] = {}
    for check in checks:
        kind = check.partition(" ")[0] if "/" not in check else ""
        kinds.setdefault(_KINDS.get(kind, "formulas"), []).append(check)
    rows = tuple(
        (kind, f"{sum(made[one] for one in mine)} of {len(mine)}", ", ".join(one for one in mine if not made[one]))
        for kind, mine in kinds.items()
    )
    columns = Column("what the model says"), Column("judged"), Column("never judged", code=True)
    return Table(title, columns, rows)


def write_landing(folder: Path, found: Glance) -> None:
    """Keep where test data landed beside the results of a run."""
    write_text(folder / LANDING, json.dumps(asdict(found), indent=1) + "\n")


def read_landing(folder: Path) -> Glance | None:
    """Return where test data landed in a run; None if that was not looked at. Raises BadResults if it is damaged."""
    path = folder / LANDING
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_bytes())
        return Glance(int(document["blocks"]), tuple(map(str, document["unreached"])), int(document["n_runs"]),
                      bool(document["is_whole"]))  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise _unreadable(path, error) from error


_KINDS = {"guard": "guards", "actions": "actions", "operations": "actions", "message": "messages"}


def timed(given: ComponentResults) -> list[TimingCase]:
    """Return the timing cases as the report draws them."""
    return [
        TimingCase(one.interaction, one.durations, parse_bound(one.bound), Judgement(Verdict(one.verdict), one.why))
        for one in given.results
        if one.bound
    ]


def timing_pieces(given: ComponentResults, where: str) -> tuple[Table | Figure, ...]:
    """Return the chart of durations and the table beside it; nothing if no case was timed."""
    cases = timed(given)
    if not cases:
        return ()
    note = (
        "Durations on the wall clock of this machine, from the first to the last event of a case or span; warm-up left"
        " out. A verdict that noise could have made is refused."
    )
    noise = max(given.noise.values(), key=lambda one: one.p99)
    return timing_table(f"Timing, {where}", cases, note), timing_figure(f"Durations, {where}", cases, noise)


class StudyResults:
    """The results of one run as every command wants them (`parcours.study.protocol.Results`)."""

    def __init__(
        self, study: str, found: ComponentResults, replay: Callable[[str], Page], checks: Sequence[str] = (),
        landed: Glance | None = None, painted: Callable[[str], Sequence[Piece]] | None = None,
        states: Callable[[], Collection[PaintState]] = tuple,
    ) -> None:  # fmt: skip
        self._landed, self._painted, self._states = landed, painted, states
        self.study, self.found, self._replay, self.checks = study, found, replay, checks
        self.label = found.host
        self.planned = found.planned

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        return [one.junit() for one in self.found.results]

    def machines(self, where: str) -> Sequence[Piece]:
        """Return the machines, painted by what cases took of them; nothing if the model is not known."""
        return self._painted(where) if self._painted is not None else ()

    def highlights(self) -> Sequence[str]:
        """Return how much of the model and of the test data was covered, in sentences."""
        found, states = [], list(self._states())
        if states:
            taken = states.count("covered")
            found.append(f"{taken} of {len(states)} transitions of the model were taken by a case that passed.")
        if (one := self._landed) is not None:
            found.append(f"{one.blocks - len(one.unreached)} of {one.blocks} blocks of test data reached a component.")
        return found

    def landing(self, title: str) -> Table | None:
        """Return how many blocks of test data reached a component, and which did not; None if that is not known."""
        if self._landed is None:
            return None
        one = self._landed
        never = ", ".join(one.unreached) + ("" if one.is_whole else f" (in {one.n_runs} executions)")
        columns = Column("blocks"), Column("reached a component"), Column("reached nothing", ",d"), Column("which")
        row = (f"{one.blocks}", f"{one.blocks - len(one.unreached)} of {one.blocks}", len(one.unreached), never)
        return Table(title, columns, (row,), "`parcours data landing` says where each block lands.")

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of verdicts, and the median duration of timing cases [s]."""
        results = self.found.results

        def rate(verdict: str) -> NDArray[np.float64]:
            return np.array([one.verdict == verdict for one in results], float)

        rates = {
            "failed": Measure(rate("fail") + rate("error")),
            "passed": Measure(rate("pass"), worse="less"),
            "inconclusive": Measure(rate("inconclusive")),
            "errors": Measure(rate("error")),
        }
        if any(one.durations for one in results):
            ended = [[d * 1e-9 for d in one.durations if d != NEVER] for one in results]
            middles = [float(np.median(each)) if each else np.nan for each in ended]
            rates["duration"] = Measure(np.array(middles), "quantity", "s")
        return rates

    def causes(self) -> Sequence[str]:
        """Return why each case did not pass, without the place in its order and the number of the instance."""
        return ["" if one.verdict == "pass" else _AT.sub("", one.why.partition("; then: ")[0])[:_CAUSE]
                for one in self.found.results]  # fmt: skip

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places."""
        return [self.found.results[k].junit() for k in places]

    def replayable(self, case: str) -> bool:
        """Return whether a case can be replayed: functional ones can."""
        return not case.startswith("timing/")

    def replay(self, case: str) -> Page:
        """Return a page on one case, run again."""
        ids = [one.id for one in self.found.results]
        wanted = ids[int(case)] if case.isdecimal() and int(case) < len(ids) else case.removeprefix("functional/")
        if wanted not in ids:
            rule = f"a case must be a finished one of the {len(ids)} in the folder, but {case!r} was asked for"
            raise BadRequest("replay", rule, "see `parcours report FOLDER --json` for their ids", slug="case-number")
        return self._replay(wanted)


def page_of(study: str, case: Case, judgement: Judgement, trace: Trace) -> Page:
    """Return a page on one case, executed again in simulated time."""
    values = tuple((name, value) for name, value in zip(case.names, case.values, strict=True))
    heads = (Column("time", ",d", unit="us"), Column("component"), Column("event"))
    columns = (*heads, Column("what", code=True), Column("message", code=True))
    note = "In simulated time an event takes a millisecond: the order counts, not the duration."
    chart = "Who sent what to whom; dashed: held back until its turn in the case came. Orange: where it went wrong."
    pieces = (
        sequence_chart("What happened, as a chart", steps_of(trace), chart),
        Table("Test inputs", (Column("input"), Column("value", ".6g")), values),
        Table("What happened", columns, event_rows(trace), note),
    )
    section = Section("What happened", "Executed again, in simulated time.", pieces)
    said = f"{judgement.verdict}: {judgement.why}"
    return Page(case.id, said, (("study", study), ("case", case.id)), (section,))


def event_rows(trace: Trace) -> tuple[tuple[str | int, ...], ...]:
    """Return the events of a trace as rows: time [us], component, kind, transition or channel, message."""
    return tuple(
        (event.time // 1000, event.component, event.kind, event.transition or event.channel,
         event.text if event.kind == "deviation" else _shown(event.payload) if event.text != SHOWN else "")
        for event in trace.events
    )  # fmt: skip


def _shown(payload: object) -> str:
    if isinstance(payload, StepReport):
        payload = dict(payload.variables) or None
    if payload is None:
        return ""
    try:
        text = json.dumps(msgspec.to_builtins(payload), ensure_ascii=False)
    except (TypeError, ValueError):
        text = type(payload).__name__
    return text if len(text) <= _LONG else text[: _LONG - 3] + "..."
