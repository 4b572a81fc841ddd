"""Results of cases on nodes of others -> tables, a page, and a folder that grows case by case."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from parcours.report.junit import CaseResult, to_junit
from parcours.report.page import to_html
from parcours.report.pieces import Cell, Column, Finding, Findings, Marked, Page, Section, Table, Tone
from parcours.report.timings import timing_table
from parcours.report.writing import write_text
from parcours.run.atomic import unwritable
from parcours.run.binding.structure import Binding
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.results import Result

_TONE: dict[Verdict, Tone] = {
    Verdict.PASS: "good", Verdict.FAIL: "bad", Verdict.INCONCLUSIVE: "poor", Verdict.ERROR: "worst",
}  # fmt: skip


class Folder:
    """Where results go: a line of results.jsonl for each case as soon as it is known, the rest at the end.

    Args:
        path: made if it is not there.

    Raises:
        BadRequest: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lines = (path / "results.jsonl").open("w", encoding="utf-8", buffering=1)
        except OSError as error:
            raise unwritable(path, error) from error

    def add(self, result: Result) -> None:
        """Keep a result."""
        self._lines.write(json.dumps(result.document()) + "\n")

    def close(self, binding: Binding, results: Sequence[Result]) -> None:
        """Write junit.xml and report.html."""
        self._lines.close()
        cases = [CaseResult(one.id, one.judged.judgement.verdict, one.seconds, one.judged.judgement.why)
                 for one in results]  # fmt: skip
        write_text(self._path / "junit.xml", to_junit(binding.name, cases))
        write_text(self._path / "report.html", to_html(page(binding, results)))


def tables(results: Sequence[Result]) -> list[Table]:
    """Return a table for each kind of case."""
    found = []
    titles = {"abstract": "Abstract cases, each in its order", "system": "System cases, in real time"}
    for kind, title in titles.items():
        own = [one for one in results if one.kind == kind]
        if own:
            columns = [Column("case", code=True), Column("verdict"), Column("length", ".2f", unit="s"), Column("why")]
            found.append(Table(title, tuple(columns), tuple(_row(one) for one in own)))
    timing = [one.timing for one in results if one.timing is not None and one.timing.durations]
    if timing:
        found.append(timing_table("Durations between channels", timing))
    bare = [one for one in results if one.timing is not None and not one.timing.durations]
    if bare:
        columns = [Column("limit", code=True), Column("verdict"), Column("length", ".2f", unit="s"), Column("why")]
        found.append(Table("Limits without durations", tuple(columns), tuple(_row(one) for one in bare)))
    return found


def _row(one: Result) -> tuple[Cell, ...]:
    judgement = one.judged.judgement
    return one.id, Marked(str(judgement.verdict), _TONE[judgement.verdict]), one.seconds, judgement.why


def page(binding: Binding, results: Sequence[Result]) -> Page:
    """Return the report on all results."""
    count = Counter(one.judged.judgement.verdict for one in results)
    facts = (
        ("binding", binding.source or binding.name), ("model", binding.model.name), ("transport", binding.transport),
        ("nodes", ", ".join(node.name for node in binding.nodes)),
    )  # fmt: skip
    findings = Findings(tuple(
        Finding(str(count[verdict]), str(verdict), f"of {len(results)}", _TONE[verdict])
        for verdict in Verdict if count[verdict]
    ))  # fmt: skip
    lead = (
        "Every bound channel passed the tester. A case passes if the nodes lived, kept to the model, and did what the "
        "case is about; one whose order could not be enforced has no verdict."
    )
    sections = [Section("Verdicts", lead, (findings,) if results else ())]
    sections += [Section(table.title, "", (table,)) for table in tables(results)]
    return Page(binding.name, binding.doc or "Nodes of others behind a binding", facts, tuple(sections))
