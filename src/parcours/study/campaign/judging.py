"""Judges many cases of a campaign at once, as `rules.outcome_of` judges one: formulas are evaluated on columns.

A formula that columns might answer otherwise is evaluated case by case: one over texts or large integers, one that
divides by zero somewhere.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from parcours.data.constraints import truth_of
from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Each, Expression, FieldAccess, Item, Literal, names
from parcours.model.expression.evaluation import compiled
from parcours.model.expression.syntax import walk
from parcours.study.campaign.rules import RATES, Rows, Rule, values_of
from parcours.study.parameters import Scalar
from parcours.verdict.judgement import VERDICTS, Verdict

if TYPE_CHECKING:
    from parcours.study.campaign.study import CampaignStudy

_EXACT = 53  # bits of the integers that a float holds
_PASS, _FAIL, _INCONCLUSIVE, _ERROR = range(len(VERDICTS))


@dataclass(frozen=True, slots=True)
class Rulings:
    """The verdicts on cases, and their reasons, which cases share."""

    codes: NDArray[np.int8]  # of VERDICTS, shape (n_cases,)
    places: NDArray[np.int64]  # of each case's reason among `reasons`, shape (n_cases,)
    reasons: tuple[str, ...]  # the first is that of a pass: ""

    @property
    def verdicts(self) -> list[Verdict]:
        """The verdict on each case."""
        return [VERDICTS[code] for code in self.codes.tolist()]

    @property
    def words(self) -> list[str]:
        """The reason of each case."""
        return [self.reasons[place] for place in self.places.tolist()]


def read_by(study: CampaignStudy) -> set[str]:
    """Return the fields of facts that `judge` reads beside the reasons of errors."""
    read = set[str]().union(*(names(rule.formula) for rule in (*study.inconclusive, *study.fail)))
    return {"number", "error"} | {fact.name for fact in study.facts if fact.name in read}


def judge(study: CampaignStudy, facts: Rows, settings: Mapping[str, Scalar], seed: int) -> Rulings:
    """Return the verdicts on cases, in the order of their facts; these may lack what no formula reads."""
    codes, places, reasons = np.full(len(facts), _PASS, np.int8), np.zeros(len(facts), np.int64), {"": 0}

    def rule_out(rows: NDArray[np.intp], code: int, reason: str) -> None:
        codes[rows], places[rows] = code, reasons.setdefault(reason, len(reasons))

    failed = np.flatnonzero(facts["error"])
    said = facts["reason"][failed] if "reason" in (facts.dtype.names or ()) else np.zeros(len(failed), "S1")
    for text in np.unique(said):
        rule_out(failed[said == text], _ERROR, text.decode("utf-8", "replace"))
    column = _columns(study, facts, settings, seed)
    for code, rules in ((_INCONCLUSIVE, study.inconclusive), (_FAIL, study.fail)):
        for rule in rules:
            rows = np.flatnonzero(codes == _PASS)
            held, wrong = _holds(rule, {name: column(name)[rows] for name in names(rule.formula)}, len(rows))
            rule_out(rows[held], code, rule.why or rule.when)
            for slug, found in wrong.items():
                rule_out(rows[found], _ERROR, f"formula {rule.when!r}: {slug}")
    return Rulings(codes, places, tuple(reasons))


def _columns(
    study: CampaignStudy, facts: Rows, settings: Mapping[str, Scalar], seed: int
) -> Callable[[str], NDArray[Any]]:
    """Return what gives the values of each case that formulas know by a name, shape (n_cases,), in their types."""
    drawn = functools.cache(lambda: study.drawn(facts["number"], seed))
    own = {one.name: settings.get(one.name, one.default) for one in study.own}
    inputs = {domain.name: k for k, domain in enumerate(study.inputs.domains)}

    @functools.cache
    def of(name: str) -> NDArray[Any]:
        if name in own:
            return np.full(len(facts), own[name])
        if name not in inputs:
            return np.asarray(facts[name])
        domain, values = study.inputs.domains[inputs[name]], drawn()[:, inputs[name]]
        if domain.values:
            return np.array(domain.values)[values.astype(np.int64)]
        return values.astype(np.int64) if domain.kind == "integer" else values

    return of


def _holds(
    rule: Rule, columns: Mapping[str, NDArray[Any]], n: int
) -> tuple[NDArray[np.bool_], Mapping[str, Sequence[int]]]:
    """Return in which of n cases a rule holds, shape (n,), and in which its formula has no value, by what is wrong."""
    if _is_exact(rule.formula, columns):
        try:
            with np.errstate(divide="raise", invalid="raise", over="raise"):
                return np.broadcast_to(truth_of(rule.formula, columns), (n,)), {}
        except FloatingPointError:
            pass  # somewhere: which cases, the other way says
    held, wrong, code = np.zeros(n, bool), dict[str, list[int]](), compiled(rule.formula, "formula")
    listed = zip(*(column.tolist() for column in columns.values()), strict=True) if columns else ((),) * n
    for k, values in enumerate(listed):
        try:
            held[k] = code(dict(zip(columns, values, strict=True)))
        except BadModel as error:
            wrong.setdefault(error.slug, []).append(k)
    return held, wrong


def _is_exact(formula: Expression, columns: Mapping[str, NDArray[Any]]) -> bool:
    """Return whether floats in columns give what `evaluate` gives: integers stay below 2**53, whatever is computed."""
    leaves, integers = 0, [column for column in columns.values() if column.dtype.kind == "i"]
    for node in walk(formula):
        match node:
            case FieldAccess() | Item() | Each() | Binary("%", _, _):
                return False
            case Apply(function, _) if function not in ("abs", "max", "min", "sqrt"):
                return False
            case Literal(str()):
                return False
            case Literal(int() as value):
                integers.append(np.array([value], object))
            case Binary("+" | "-" | "*" | "/", _, _):
                leaves += 1
    limit = 2 ** (_EXACT // (leaves + 1))  # of all leaves the product stays exact, and the sum
    plain = all(column.dtype.kind in "bif" for column in columns.values())
    return (
        len(columns) > 0
        and plain
        and all(-limit <= column.min() and column.max() <= limit for column in integers if len(column))
    )


def rated_by(study: CampaignStudy) -> set[str]:
    """Return the fields of facts that `rates_of` looks at, those of its rulings included."""
    return read_by(study) | {fact.name for fact in study.facts if fact.kind == "bool"}


def rates_of(study: CampaignStudy, facts: Rows, rulings: Rulings) -> dict[str, NDArray[np.float64]]:
    """Return what each case counts for the rates of verdicts and of facts of type bool; `failed` counts errors, too."""
    found = {name: (rulings.codes == VERDICTS.index(verdict)).astype(float) for name, verdict, _ in RATES}
    found["failed"] = found["failed"] + found["errors"]  # an error is no pass
    return found | {one.name: values_of(facts, one.name) for one in study.facts if one.kind == "bool"}
