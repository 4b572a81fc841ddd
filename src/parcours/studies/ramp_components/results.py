"""Results of the component study <-> a file: one JSON document, written whole or not at all."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from parcours.errors import BadResults, ParcoursError
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Figure, Table
from parcours.report.timings import Timed, timing_figure, timing_table
from parcours.report.writing import write_text
from parcours.run.noise import Noise
from parcours.studies.ramp_components.study import CASES_OF_PAPER, Functional, Timing, interaction_of
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, parse_bound

FILE = "components.json"
_FORMAT = "components/2"


@dataclass(frozen=True, slots=True)
class ComponentResult:
    """One judged case; `bound` (in words) and `durations` [ns] are those of a timing case, else empty."""

    id: str
    interaction: str
    verdict: str
    why: str
    bound: str = ""
    durations: tuple[int, ...] = ()

    def junit(self) -> CaseResult:
        """Return it as JUnit knows it: a timing case lasts as long as its longest repeat that ended."""
        kind = "timing" if self.bound else "functional"
        longest = max((one for one in self.durations if one != NEVER), default=0)
        return CaseResult(f"{kind}/{self.id}", Verdict(self.verdict), longest * 1e-9, self.why)


@dataclass(frozen=True, slots=True)
class ComponentResults:
    """Everything that one run of the component study showed.

    Attributes:
        host: where the components were.
        results: functional cases, then timing cases.
        noise: of the machine, between the repeats of each interaction path's timing cases.
    """

    host: str
    results: tuple[ComponentResult, ...]
    noise: Mapping[str, Noise] = field(default_factory=dict)


def component_results(host: str, functional: Sequence[Functional], timing: Sequence[Timing]) -> ComponentResults:
    """Return the judged component cases of a run."""
    results = [_result(run.case.id, interaction_of(run.case), run.judgement) for run in functional]
    for timed in timing:
        itp = interaction_of(timed.case)
        results.append(_result(timed.case.id, itp, timed.judgement, str(timed.bound), timed.durations))
    return ComponentResults(host, tuple(results), {interaction_of(timed.case): timed.noise for timed in timing})


def _result(id: str, itp: str, judged: Judgement, bound: str = "", durations: tuple[int, ...] = ()) -> ComponentResult:
    return ComponentResult(id, itp, str(judged.verdict), judged.why, bound, durations)


def write_components(folder: Path, given: ComponentResults) -> None:
    """Write the results into the folder. Raises BadRequest if it cannot be written to."""
    noise = {itp: {"of": one.of, "times": one.times} for itp, one in given.noise.items()}
    results = [asdict(result) for result in given.results]
    document = {"parcours": _FORMAT, "host": given.host, "noise": noise, "results": results}
    write_text(folder / FILE, json.dumps(document, allow_nan=False) + "\n")


def read_components(folder: Path) -> ComponentResults:
    """Return the results that lie in the folder.

    Raises:
        BadResults: there are none, or the file is cut short or of another version.
    """
    path = folder / FILE
    try:
        document = json.loads(path.read_bytes())
        if document["parcours"] != _FORMAT:
            raise ValueError(f"its format is {document['parcours']!r}, not {_FORMAT!r}")
        results = tuple(
            ComponentResult(**{**entry, "durations": tuple(entry["durations"])}) for entry in document["results"]
        )
        noise = {str(itp): Noise(tuple(one["times"]), str(one["of"])) for itp, one in document["noise"].items()}
        return ComponentResults(str(document["host"]), results, noise)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, ParcoursError) as error:
        raise BadResults(
            str(path),
            f"component results must be readable, but: {error}",
            "run the study again",
            slug="results-components",
        ) from error


def component_table(results: Sequence[ComponentResult], title: str) -> Table:
    """Return how many cases of each interaction path passed."""
    kinds = [r for r in results if not r.bound], [r for r in results if r.bound]
    rows = []
    for itp in CASES_OF_PAPER:
        row: list[str] = [itp]
        for mine in kinds:
            counts = Counter(r.verdict for r in mine if r.interaction == itp)
            row.append(f"{counts['pass']} of {sum(counts.values())}")
        rows.append(tuple(row))
    return Table(title, (Column("path"), Column("functional cases passed"), Column("timing cases passed")), tuple(rows))


def timed(given: ComponentResults) -> list[Timed]:
    """Return the timing cases as the report draws them."""
    return [
        Timed(one.interaction, one.durations, parse_bound(one.bound), Judgement(Verdict(one.verdict), one.why))
        for one in given.results
        if one.bound
    ]


def timing_pieces(given: ComponentResults, where: str) -> tuple[Table | Figure, ...]:
    """Return Fig. 5a and the table beside it; nothing if no case was timed.

    Args:
        given: the results.
        where: the components were, in words.
    """
    cases = timed(given)
    if not cases:
        return ()
    note = (
        f"Durations on the wall clock of this machine, {where}, from the first to the last event of an abstract case; "
        "warm-up left out. A verdict that noise could have made is refused. Durations are measured anew in every run, "
        "so they are not part of the results that repeat bit for bit."
    )
    noise = max(given.noise.values(), key=lambda one: one.p99)
    return (
        timing_table("Table VIII, performance", cases, note),
        timing_figure("Fig. 5a: duration of component interactions", cases, noise),
    )
