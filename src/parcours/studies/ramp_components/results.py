"""Results of the component study <-> a file: one JSON document, written whole or not at all."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from parcours.errors import BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Table
from parcours.report.writing import write_text
from parcours.studies.ramp_components.study import CASES_OF_PAPER, Functional, Timing, interaction_of
from parcours.verdict.judgement import Verdict

FILE = "components.json"
_FORMAT = "components/1"


@dataclass(frozen=True, slots=True)
class ComponentResult:
    """One judged case; `limit` [s] and `durations` [ns] are those of a timing case, else None and empty."""

    id: str
    interaction: str
    verdict: str
    why: str
    limit: float | None = None
    durations: tuple[int, ...] = ()

    def junit(self) -> CaseResult:
        """Return it as JUnit knows it: a timing case lasts as long as its longest repeat."""
        kind = "functional" if self.limit is None else "timing"
        return CaseResult(f"{kind}/{self.id}", Verdict(self.verdict), max(self.durations, default=0) * 1e-9, self.why)


def functional_result(run: Functional) -> ComponentResult:
    """Return what is kept of a functional case."""
    return ComponentResult(run.case.id, interaction_of(run.case), str(run.judgement.verdict), run.judgement.why)


def timing_result(run: Timing) -> ComponentResult:
    """Return what is kept of a timing case."""
    judged = run.judgement
    return ComponentResult(
        run.case.id, interaction_of(run.case), str(judged.verdict), judged.why, run.limit, run.durations
    )


def component_results(functional: Sequence[Functional], timing: Sequence[Timing]) -> list[ComponentResult]:
    """Return the judged component cases, functional and timing."""
    return [*map(functional_result, functional), *map(timing_result, timing)]


def write_components(folder: Path, results: Sequence[ComponentResult]) -> None:
    """Write the results into the folder. Raises BadRequest if it cannot be written to."""
    document = {"parcours": _FORMAT, "results": [asdict(result) for result in results]}
    write_text(folder / FILE, json.dumps(document, indent=1, allow_nan=False) + "\n")


def read_components(folder: Path) -> tuple[ComponentResult, ...]:
    """Return the results that lie in the folder.

    Raises:
        BadResults: there are none, or the file is cut short or of another version.
    """
    path = folder / FILE
    try:
        document = json.loads(path.read_bytes())
        if document["parcours"] != _FORMAT:
            raise ValueError(f"its format is {document['parcours']!r}, not {_FORMAT!r}")
        return tuple(
            ComponentResult(**{**entry, "durations": tuple(entry["durations"])}) for entry in document["results"]
        )
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadResults(
            str(path),
            f"component results must be readable, but: {error}",
            "run the study again",
            slug="results-components",
        ) from error


def component_table(results: Sequence[ComponentResult], title: str) -> Table:
    """Return how many cases of each interaction path passed."""
    kinds = [r for r in results if r.limit is None], [r for r in results if r.limit is not None]
    rows = []
    for itp in CASES_OF_PAPER:
        row: list[str] = [itp]
        for mine in kinds:
            counts = Counter(r.verdict for r in mine if r.interaction == itp)
            row.append(f"{counts['pass']} of {sum(counts.values())}")
        rows.append(tuple(row))
    return Table(title, (Column("path"), Column("functional cases passed"), Column("timing cases passed")), tuple(rows))
