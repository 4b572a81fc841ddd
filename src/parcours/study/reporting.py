"""Draws what results come to as one page: what to know first, then the cases that did not pass, then all details."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from parcours.report.pieces import (
    Animation,
    Cause,
    Column,
    Failing,
    Failures,
    Marked,
    Page,
    Section,
    Summary,
    Tone,
    plain_anchor,
)
from parcours.study.protocol import Results, Study
from parcours.study.summing import CauseFound, FolderSummary, ListedCase, repeats, sum_up
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import wilson

TONE: dict[Verdict, Tone] = {
    Verdict.PASS: "good", Verdict.FAIL: "bad", Verdict.INCONCLUSIVE: "poor", Verdict.ERROR: "worst",
}  # fmt: skip
_FACTS = 3  # in the first paragraph


def report_page(families: Sequence[tuple[Study, Mapping[str, Results]]]) -> Page:
    """Return the page on results of studies, by folder: families of studies that are reported together."""
    found = [sum_up(study, folder, one) for study, results in families for folder, one in results.items()]
    details = [(study, tuple(study.report(results).pieces())) for study, results in families]
    shown = [piece.anchor for _, pieces in details for piece in pieces if isinstance(piece, Animation)]
    sections = []
    failing = tuple(failures(one, shown, len(found) > 1) for one in found if one.causes)
    if failing:
        lead = (
            "Grouped by cause. Search and filter above the table; click a heading to sort. Click the name of a case, "
            "and the address of this page leads to that case: send it to a colleague. *Commands* run the case again."
        )
        sections.append(Section("Cases that did not pass", lead, failing, "failures"))
    sections += [
        Section(study.name if len(families) > 1 else "Outcomes", "", pieces, "outcomes") for study, pieces in details
    ]
    title = " and ".join(dict.fromkeys(one.study for one in found))
    return Page(f"Report: {title}", "", _origin(found), tuple(sections), summarised(found))


def summarised(found: Sequence[FolderSummary]) -> Summary:
    """Return the first paragraph: what was tested, what came of it, what matters, what to do."""
    n, failed = sum(one.n for one in found), sum(one.failed for one in found)
    open_ = sum(one.verdicts[Verdict.INCONCLUSIVE] for one in found)
    planned = sum(one.planned for one in found)
    tested = " ".join(_tested(one) for one in found)
    if not n:
        return Summary(tested, "Nothing is known yet: no case is finished.", "poor", (), "Run the study.")
    if failed:
        share = wilson(failed, n)
        verdict = f"It failed {failed:,d} of {n:,d} cases ({percent(share.share)})."
        tone: Tone = "bad"
    elif open_:
        verdict, tone = f"It failed none of {n:,d} cases, but {open_:,d} could not be judged.", "poor"
    else:
        verdict, tone = f"It passed all {n:,d} cases.", "good"
    facts = [*_commonest(found)]
    if failed and open_ and len(facts) < _FACTS:
        facts.append(f"{open_:,d} cases could not be judged: they count neither as passed nor as failed.")
    if n < planned:
        facts.insert(0, f"The run is not finished: {n:,d} of {planned:,d} cases are.")
    rate = wilson(failed, n)
    if len(facts) < _FACTS and not failed:
        facts.append(f"Fewer than {percent(rate.high)} of cases like these fail (95 % confidence).")
    elif len(facts) < _FACTS:
        facts.append(
            f"Between {percent(rate.low)} and {percent(rate.high)} of cases like these fail (95 % confidence)."
        )
    facts += [said for one in found for said in one.highlights]
    return Summary(tested, verdict, tone, tuple(facts[:_FACTS]), _advice(found))


def _tested(one: FolderSummary) -> str:
    doc = one.doc.strip().rstrip(".")
    said = f" ({doc[:200]})" if doc else ""
    return f"This run tested **{_plain(one.study)}**{_plain(said)} as *{_plain(one.label)}*."


def _plain(text: str) -> str:
    """Return a text from outside without the marks of prose."""
    return text.replace("`", "'").replace("*", "").replace("[", "(").replace("]", ")")


def percent(share: float) -> str:
    """Return a share in per cent, precise enough not to read 0 or 100 where it is neither.

    >>> percent(0.8232), percent(0.00042), percent(1.0)
    ('82.3 %', '0.042 %', '100 %')
    """
    value = 100.0 * share
    return f"{value:.1f} %" if 0.95 < value < 99.95 else f"{value:.2g} %" if value < 50 else f"{value:.6g} %"


def _commonest(found: Sequence[FolderSummary]) -> list[str]:
    """Return the commonest causes of failures, each with a link."""
    causes = [(cause, one) for one in found for cause in one.causes]  # in the order of their anchors on the page
    named = [(number, cause, one) for number, (cause, one) in enumerate(causes, 1) if cause.verdict is not Verdict.PASS]
    named.sort(key=lambda each: (each[1].verdict is Verdict.INCONCLUSIVE, -each[1].count))
    return [
        f"{cause.count:,d} {_ended(cause)}: [{_plain(cause.words)[:160]}](#cause_{number})"
        + (f", in {_plain(one.folder)}." if len(found) > 1 else ".")
        for number, cause, one in named[:_FACTS]
    ]


def _ended(cause: CauseFound) -> str:
    cases = "case" if cause.count == 1 else "cases"
    words = {Verdict.FAIL: "failed", Verdict.ERROR: "ended in an error", Verdict.INCONCLUSIVE: "could not be judged"}
    return f"{cases} {words[cause.verdict]}"


def _advice(found: Sequence[FolderSummary]) -> str:
    """Return what to do next."""
    for one in found:
        for cause in one.causes:
            if cause.cases and cause.cases[0].commands:
                words = "Look at" if cause.verdict is Verdict.INCONCLUSIVE else "Start with the worst case,"
                id = cause.cases[0].result.id
                named = f"[{_plain(id)}](#case_{plain_anchor(id)})"
                first = f"{words} {named}: `{cause.cases[0].commands[0]}`."
                return f"{first} After a change, run the study into a new folder, and compare the two folders."
    one = found[0]
    if one.run:
        folder = one.folder
        return (
            f"Keep the folder as a baseline: `{one.run} --out {folder}-next --baseline {folder}` says what got worse."
        )
    return ""


def _origin(found: Sequence[FolderSummary]) -> tuple[tuple[str, str], ...]:
    """Return where results come from: what all folders share once, the rest by folder."""
    facts: list[tuple[str, str]] = []
    for key in ("date", "commit", "machine", "versions"):
        known = list(dict.fromkeys(one.made[key] for one in found if one.made.get(key)))
        facts.append((key, "; ".join(known) or "not kept"))
    for one in found:
        name = f" of {one.folder}" if len(found) > 1 else ""
        if one.seed is not None:
            facts.append((f"seed{name}", str(one.seed)))
        facts.append((f"cases{name}", f"{one.n:,d} of {one.planned:,d}"))
        if one.reproduced:
            facts.append((f"run again{name}", one.reproduced))
        elif one.failed and repeats(Path(one.folder)):
            facts.append((f"run again{name}", f"not yet: parcours reproduce {one.folder}"))
    return tuple(facts)


def failures(one: FolderSummary, replays: Sequence[str], named: bool) -> Failures:
    """Return the table of cases that did not pass; `replays` are anchors of those that the page shows."""
    columns = tuple(Column(name, ".3g", unit="" if unit == "1" else unit) for name, unit in one.figures)
    causes = tuple(
        Cause(cause.words, cause.count, tuple(_failing(case.result.id, case, replays) for case in cause.cases))
        for cause in one.causes
    )
    listed = sum(len(cause.cases) for cause in one.causes)
    note = ""
    if listed < sum(cause.count for cause in one.causes):
        worst = f"; of each cause the worst by {one.figures[0][0]}" if one.figures else ""
        note = f"{listed:,d} cases are listed{worst}. All: `parcours results {one.folder} --csv all.csv`."
    return Failures(f"Cases of {one.folder}" if named else "Cases", causes, columns, note)


def _failing(id: str, case: ListedCase, replays: Sequence[str]) -> Failing:
    anchor = replay_anchor(id)
    return Failing(
        id, Marked(str(case.result.verdict), TONE[case.result.verdict]), case.result.why,
        tuple(case.figures), case.commands, anchor if anchor in replays else "",
    )  # fmt: skip


def replay_anchor(id: str) -> str:
    """Return the anchor of the replay of a case."""
    return f"replay_{plain_anchor(id)}"
