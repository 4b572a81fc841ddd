"""Results of a campaign: verdicts by the study's formulas, measures, tables and replays."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.report.junit import CaseResult
from parcours.report.pieces import Cell, Column, Figure, Marked, Page, Piece, Section, Table
from parcours.run.store import Campaign, open_results
from parcours.study.campaign.running import KeptFacts
from parcours.study.comparing import Outline, OutlinePart, outline_in_parts
from parcours.study.covering import Drawn
from parcours.study.parameters import Scalar, settings_of
from parcours.study.protocol import Measure, Reported, Results
from parcours.study.tabling import TableColumn, input_columns
from parcours.verdict.judgement import VERDICTS, Verdict
from parcours.verdict.statistics import quantiles, wilson

if TYPE_CHECKING:
    from parcours.study.campaign.study import CampaignStudy
from parcours.study.campaign.judging import Rulings, judge, rated_by, rates_of, read_by
from parcours.study.campaign.rules import RATES, Fault, Rows, Worse, directions, outcome_of, values_of

# At most this many: reasons in a table, rows of a trace in a table, panels of its chart
_FEW, _SHOWN, _PANELS = 10, 200, 8


class CampaignResults:
    """The results in one folder (`parcours.study.protocol.Results`). Make them with `read_results`."""

    def __init__(self, study: CampaignStudy, campaign: Campaign, kept: KeptFacts, planned: int) -> None:
        self.study, self.seed, self._kept = study, campaign.seed, kept
        self.label, self.planned = campaign.schedule, planned
        self.settings = settings_of(study.parameters, cast("dict[str, object]", campaign.parameters["settings"]))

    @property
    def facts(self) -> Rows:
        """The facts of the finished cases, array of the study's `dtype`. Raises BadResults: they are damaged."""
        return self._kept.whole

    @functools.cached_property
    def numbers(self) -> list[int]:
        """The numbers of the finished cases."""
        return cast("list[int]", self.facts["number"].tolist())

    @functools.cached_property
    def rulings(self) -> Rulings:
        """The verdicts, in the order of the facts."""
        return judge(self.study, self.facts, self.settings, self.seed)

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        return self.some_cases(range(len(self.numbers)))

    def case_verdicts(self) -> Sequence[Verdict]:
        """Return the verdicts of `cases`, without their reasons."""
        return self.rulings.verdicts

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""
        counts = np.bincount(self.rulings.codes, minlength=len(VERDICTS)).tolist()
        return Counter({verdict: n for verdict, n in zip(VERDICTS, counts, strict=True) if n})

    def causes(self) -> Sequence[str]:
        """Return why each case did not pass, in words that cases share."""
        return self.rulings.words

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places."""
        facts = self.facts[np.array(places, np.intp)]
        found = [outcome_of(self.study, row, self.study.known(values, self.settings))
                 for row, values in zip(facts, self.study.values(facts["number"], self.seed), strict=True)]  # fmt: skip
        ids = map(self.study.id, facts["number"].tolist())
        return [CaseResult(id, one.verdict, 0.0, one.why) for id, one in zip(ids, found, strict=True)]

    def outline(self) -> Outline:
        """Return what a comparison needs: what formulas read of each case, and facts of type bool."""
        read = rated_by(self.study)
        worse = self._worse()

        def parts() -> Iterator[OutlinePart]:
            for facts in self._kept.parts(read.__contains__):
                rulings = judge(self.study, facts, self.settings, self.seed)
                rates = rates_of(self.study, facts, rulings).items()
                counted = {name: np.nan_to_num(values, nan=-1.0).astype(np.int8) for name, values in rates}
                yield facts["number"].copy(), rulings.codes == VERDICTS.index(Verdict.PASS), counted

        return outline_in_parts(parts(), self.study.id, lambda name: worse.get(name, ""))

    def _worse(self) -> dict[str, Worse]:
        rates = {name: worse for name, _, worse in RATES}
        return rates | directions(self.study.fail) | dict(self.study.worse)

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of verdicts, then every fact: a bool as a rate, a number as a quantity; NaN after an error.

        Which way of a fact is worse is what the study says, else what its `fail` formulas imply.
        """
        rates, worse = rates_of(self.study, self.facts, self.rulings), self._worse()
        found = {name: Measure(rates[name], "rate", worse=worse[name]) for name, _, _ in RATES}
        for fact in self.study.facts:
            values = values_of(self.facts, fact.name)
            kind: Literal["rate", "quantity"] = "rate" if fact.kind == "bool" else "quantity"
            found[fact.name] = Measure(values, kind, fact.unit, worse.get(fact.name, ""))
        return found

    def table_columns(self) -> Mapping[str, TableColumn]:
        """Return what is known of the cases: ids, verdicts, reasons, facts, test inputs and their blocks."""
        facts, study = self.facts, self.study
        found = {
            "case": TableColumn(lambda: np.array([study.id(number) for number in self.numbers])),
            "number": TableColumn(lambda: facts["number"]),
            "verdict": TableColumn(lambda: np.array(VERDICTS, str)[self.rulings.codes]),
            "reason": TableColumn(lambda: np.array(self.rulings.reasons)[self.rulings.places]),
            "error": TableColumn(lambda: facts["error"]),
        }
        for one in study.own:
            found[one.name] = TableColumn(functools.partial(np.full, len(facts), self.settings[one.name]), one.unit)
        for fact in study.facts:
            plain = functools.partial(np.ascontiguousarray, facts[fact.name])
            known = functools.partial(values_of, facts, fact.name)  # NaN after an error
            found[fact.name] = TableColumn(known if facts["error"].any() else plain, fact.unit)
        drawn = functools.partial(study.drawn, facts["number"], self.seed)
        return found | input_columns(study.inputs, drawn, found)

    def drawn(self) -> Iterator[Drawn]:
        """Yield what the cases were made of, and their verdicts."""
        words = [rule.why or rule.when for rule in (*self.study.inconclusive, *self.study.fail)]
        verdicts, read = [str(one) for one in VERDICTS], read_by(self.study)
        for facts in self._kept.parts(read.__contains__):
            rulings = judge(self.study, facts, self.settings, self.seed)
            held = [rulings.places == rulings.reasons.index(word) for word in words]
            rules = {"rules that decided a case": (words, np.array(held, bool).T)} if words else {}
            values = self.study.drawn(facts["number"], self.seed)
            yield Drawn(
                self.study.inputs, values, {"verdicts": (verdicts, rulings.codes.astype(np.int64))}, marks=rules
            )

    def replay(self, case: str) -> Page:
        """Return a page on one case, simulated again: it must give the facts that were kept."""
        number = self.study.number(case)
        if number not in self.numbers:
            rule = f"a case must be a finished one of the {len(self.numbers)} in the folder, but {case!r} was asked for"
            raise BadRequest("replay", rule, "run the campaign on, or name another case", slug="case-number")
        id, place = self.study.id(number), self.numbers.index(number)
        kept, [outcome] = self.facts[place], self.some_cases([place])
        if kept["error"] in (Fault.HUNG, Fault.DIED):
            rule = f"there is nothing to see of it: {outcome.why}"
            raise BadResults(id, rule, "replay another case", slug="replay-lost")
        again = self.study.simulated((number,), self.settings, self.seed)[0]
        if again.tobytes() != kept.tobytes():
            raise self._differs(id, again, kept)
        given = self.study.case(number, self.seed)
        known = self.study.known(given.values, self.settings)
        pieces: list[Piece] = [self._values("Test inputs and parameters", known)]
        if not kept["error"]:
            pieces.append(self._values("Facts", {one.name: kept[one.name].item() for one in self.study.facts}))
        if self.study.trace is not None:
            pieces += _trace_pieces(self.study.traced(given, self.settings))
        verdict = f"{outcome.verdict}: {outcome.why}"
        heads = (("study", self.study.name), ("campaign", self.label), ("case", id), ("seed", str(self.seed)))
        return Page(
            id, verdict, heads, (Section("What happened", "Simulated again from the case's number.", tuple(pieces)),)
        )

    def _values(self, title: str, values: Mapping[str, Scalar]) -> Table:
        units = {name: "" if unit == "1" else unit for name, unit in self.study.units.items()}
        rows = tuple((name, *_cells((value,)), units[name]) for name, value in values.items())
        return Table(title, (Column("name"), Column("value", ".9g"), Column("unit")), rows)

    def _differs(self, id: str, again: np.void, kept: np.void) -> BadResults:
        differing = [
            f"{name} is {_value(again[name])}, but was {_value(kept[name])}"
            for name in kept.dtype.names or () if again[name].tobytes() != kept[name].tobytes()
        ]  # fmt: skip
        rule = f"a replay must give the facts that were kept, but {'; '.join(differing[:3])}"
        remedy = "the simulation changed, remembers earlier cases, or draws random numbers of its own; see its check"
        return BadResults(id, rule, remedy, slug="replay-differs")


def _value(value: np.generic) -> object:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value.item()


def read_results(study: CampaignStudy, folder: Path) -> CampaignResults:
    """Return the finished cases in a folder; the simulation itself is not loaded."""
    store = open_results(folder)
    campaign = store.campaign
    theirs = {"study": campaign.study, "facts": campaign.dtype, "test inputs": campaign.parameters.get("inputs")}
    ours = {"study": study.name, "facts": study.dtype, "test inputs": study.inputs_digest}
    for what, mine in ours.items():
        if theirs[what] != mine:
            rule = f"its {what} must be that of study {study.name!r}, {mine}, but is {theirs[what]}"
            raise BadResults(str(folder), rule, "name the study that wrote it, or run the campaign again",
                             slug="results-study")  # fmt: skip
    try:
        return CampaignResults(study, campaign, KeptFacts(store), store.planned)
    except (ParcoursError, KeyError, TypeError, AttributeError) as error:
        rule = f"it must have the study's parameters, but: {error}"
        raise BadResults(str(folder), rule, "run the campaign again", slug="results-parameters") from error


def report_results(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on campaigns, of one study or of several."""
    from parcours.report.rates import shares

    found = {folder: one for folder, one in results.items() if isinstance(one, CampaignResults) and one.numbers}
    if not found:
        return Reported([], list, {folder: {"finished": 0, "planned": one.planned} for folder, one in results.items()})
    counts = {folder: one.verdict_counts() for folder, one in found.items()}
    order = (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.ERROR, Verdict.FAIL)
    chart = shares("The verdicts", order, {name: [of[one] for one in order] for name, of in counts.items()},
                   ("good", "neutral", "worst", "bad"))  # fmt: skip
    tables = [_outcome_table(found, counts), _measure_table(found)]
    reasons = _reasons(found)
    if reasons:
        heads = (Column("campaign"), Column("verdict"), Column("reason"), Column("cases", ",d"))
        note = f"Why cases did not pass; the {_FEW} commonest reasons of each campaign."
        tables.append(Table("Reasons", (*heads, Column("first case", code=True)), reasons, note))
    documents = {folder: _document(one, counts[folder], reasons, folder) for folder, one in found.items()}
    return Reported(tables, lambda: [chart, *tables], documents)


def _outcome_table(found: Mapping[str, CampaignResults], counts: Mapping[str, Counter[Verdict]]) -> Table:
    rows: list[tuple[Cell, ...]] = [("campaign", *(one.label for one in found.values()))]
    finished = ((len(one.numbers), one.planned) for one in found.values())
    rows.append(("cases", *(n if n == all else Marked(f"{n} of {all}, unfinished", "poor") for n, all in finished)))
    for _, verdict, _ in sorted(RATES, key=lambda rate: list(Verdict).index(rate[1])):
        rows.append((str(verdict), *(f"{of[verdict]:,d}: {_rate(of[verdict], of.total())}" for of in counts.values())))
    note = "How many cases, and their share with its Wilson 95 % interval."
    return Table("Outcomes", (Column(""), *(Column(name) for name in found)), tuple(rows), note)


def _rate(count: int, n: int) -> str:
    rate = wilson(count, n)
    return f"{rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}]" if n else "none"


def _statistics(measure: Measure) -> dict[str, float]:
    """Return the figures of a measure over the cases that have it."""
    known = measure.values[~np.isnan(measure.values)]
    if measure.kind == "rate":
        rate = wilson(int(known.sum()), len(known))
        return {"cases": len(known), "rate": rate.share, "low": rate.low, "high": rate.high}
    ends = (0.0, 0.05, 0.5, 0.95, 1.0)
    figures = dict(zip(("least", "p5", "median", "p95", "greatest"), quantiles(known, ends), strict=True))
    return {"cases": len(known), "mean": float(known.mean()) if len(known) else np.nan, **figures}


def _measure_table(found: Mapping[str, CampaignResults]) -> Table:
    figures = ("mean", "least", "p5", "median", "p95", "greatest")
    heads = (Column("campaign"), Column("fact"), Column("cases", ",d"), Column("rate"))
    rows: list[tuple[Cell, ...]] = []
    for folder, one in found.items():
        measures = one.measures()
        for fact in one.study.facts:
            measure = measures[fact.name]
            of, unit = _statistics(measure), "" if fact.unit == "1" else f" [{fact.unit}]"
            rate = _rate(int(np.nansum(measure.values)), int(of["cases"])) if measure.kind == "rate" else None
            rows.append((folder, fact.name + unit, int(of["cases"]), rate, *(of.get(figure) for figure in figures)))
    note = "Of the cases without error; rates with their Wilson 95 % intervals."
    return Table("Measures", (*heads, *(Column(one, ".4g") for one in figures)), tuple(rows), note)


def _reasons(found: Mapping[str, CampaignResults]) -> tuple[tuple[str, str, str, int, str], ...]:
    """Return (folder, verdict, reason, how many cases, id of the first) of the commonest reasons."""
    rows = []
    for folder, one in found.items():
        keys = list(zip(one.rulings.codes.tolist(), one.rulings.places.tolist(), strict=True))
        passed = VERDICTS.index(Verdict.PASS)
        for key, count in Counter(key for key in keys if key[0] != passed).most_common(_FEW):
            words = str(VERDICTS[key[0]]), one.rulings.reasons[key[1]]
            rows.append((folder, *words, count, one.study.id(one.numbers[keys.index(key)])))
    return tuple(rows)


def _document(
    one: CampaignResults, counts: Counter[Verdict], reasons: Sequence[tuple[str, str, str, int, str]], folder: str
) -> dict[str, object]:
    rates = {str(verdict): wilson(counts[verdict], counts.total()) for verdict in Verdict}
    figures = {name: _statistics(measure) for name, measure in one.measures().items()}
    keys = ("verdict", "reason", "cases", "first")
    return {
        "study": one.study.name, "campaign": one.label, "seed": one.seed,
        "finished": len(one.numbers), "planned": one.planned,
        "verdicts": {name: {"cases": of.count, "share": of.share, "low": of.low, "high": of.high}
                     for name, of in rates.items()},
        "measures": {fact.name: {key: None if np.isnan(value) else value for key, value in figures[fact.name].items()}
                     for fact in one.study.facts},
        "reasons": [dict(zip(keys, row[1:], strict=True)) for row in reasons if row[0] == folder],
    }  # fmt: skip


Trace = tuple[tuple[str, ...], tuple[tuple[Scalar, ...], ...]]  # names of columns, and rows of values


def _trace_pieces(trace: Trace | str) -> list[Piece]:
    """Return a trace as a chart and a table; a text says why there is none."""
    from parcours.report.pieces import Text

    if isinstance(trace, str):
        return [Text(f"There is no trace: {trace}")]
    columns, rows = trace
    if not rows or not columns:
        return [Text("The trace is empty.")]
    step = -(-len(rows) // _SHOWN)
    note = "" if step == 1 else f"Every {step}th of {len(rows):,d} rows."
    heads = tuple(Column(name, ".6g") for name in columns)
    table = Table("Trace", heads, tuple(map(_cells, rows[::step])), note)
    numeric = [k for k in range(len(columns)) if all(isinstance(row[k], int | float) for row in rows)]
    x = next((k for k in numeric if columns[k] in ("time", "t")), None)
    if x is None or len(rows) < 2 or len(numeric) < 2:
        return [table]
    return [_chart(columns, np.array([[row[k] for k in numeric] for row in rows], float), numeric, x), table]


def _cells(row: Sequence[Scalar]) -> tuple[Cell, ...]:
    return tuple(("true" if value else "false") if isinstance(value, bool) else value for value in row)


def _chart(columns: Sequence[str], values: NDArray[np.float64], numeric: Sequence[int], x: int) -> Figure:
    """Return each numeric column against time, one panel each."""
    from parcours.report.drawing import SERIES, canvas, svg_of

    drawn = [k for k in numeric if k != x][:_PANELS]
    times = values[:, numeric.index(x)]
    said = []
    with canvas(0.5 + 1.2 * len(drawn), len(drawn)) as (figure, panels):
        for place, (k, panel) in enumerate(zip(drawn, panels, strict=True)):
            column = values[:, numeric.index(k)]
            panel.plot(times, column, color=SERIES[place % len(SERIES)], linewidth=1.4)
            panel.set_ylabel(columns[k])
            low, high = np.nanmin(column), np.nanmax(column)
            said.append(f"{columns[k]} from {column[0]:.4g} to {column[-1]:.4g}, within {low:.4g} .. {high:.4g}")
        panels[-1].set_xlabel(columns[x])
        return Figure("Over time", svg_of(figure), "; ".join(said))
