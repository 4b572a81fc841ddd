"""Facts of cases, and what a study requires of them, become verdicts and reasons.

A sound outcome that fails stays what it is. Else a case fails that violates a requirement or meets a pass rule; it is
inconclusive if a requirement has no value for it, as after a division of 0 by 0.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from parcours.verdict.judgement import VERDICTS, Verdict
from parcours_navigation.outcomes import DECISIVE, VERDICT_OF, Outcome, explain, outcomes
from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.requirements.syntax import (
    Arithmetic,
    Comparison,
    Constant,
    Formula,
    Function,
    Junction,
    Negative,
    Not,
    Number,
    Signal,
    signals,
)
from parcours_navigation.requirements.vocabulary import VALUES

Facts = NDArray[np.void]
Values = NDArray[np.float64]
Flags = NDArray[np.bool_]

PASSED = "passed"

_PASS, _FAIL, _INCONCLUSIVE, _ERROR = range(len(VERDICTS))
_OF_OUTCOME = np.array([VERDICTS.index(VERDICT_OF[outcome]) for outcome in Outcome], np.int8)

FAR = 1e9
"""What counts in place of an infinite robustness where numbers must be finite."""


_FIELDS = {
    "time": ("t_end",), "clearance": ("min_clearance",), "goal_distance": ("to_goal",), "x": ("x",), "y": ("y",),
    "heading": ("heading",), "travelled": ("travelled",), "halts": ("n_halts",), "switches": ("n_switches",),
    "contacts": ("n_robot_contacts", "n_shared_contacts"),
}  # fmt: skip
"""The fields of FACTS that values come from; all others are measures, of ours or of the study's own."""


def values_of(facts: Facts, name: str) -> Values:
    """Return one of VALUES of each case, NaN where a case has none, shape (n_cases,)."""
    if name in _FIELDS:
        found = functools.reduce(np.add, [facts[one] for one in _FIELDS[name]])
        return np.asarray(found * 1e-9 if name == "time" else found, np.float64)
    own = facts.dtype["own"].names if "own" in (facts.dtype.names or ()) else None
    return np.asarray(facts["own" if own and name in own else "measures"][name], np.float64)


def judged_fields(requirements: Requirements) -> set[str]:
    """Return the fields of facts that `counts` reads; `inner.x` is the field x of `inner`."""
    read = {name for rule in requirements.rules for name in signals(rule.formula)}
    return {*DECISIVE, "robustness"}.union(*(_FIELDS.get(one, (f"measures.{one}", f"own.{one}")) for one in read))


def own_values(facts: Facts, requirements: Requirements) -> dict[str, Values]:
    """Return the study's own measures of each case, NaN where one has none, shape (n_cases,) each."""
    return {
        one.name: np.broadcast_to(
            values_of(facts, one.name) if one.number is None else _number(one.number, facts), len(facts)
        )
        for one in requirements.measures
    }


def holds(rule: Formula, facts: Facts) -> Flags:
    """Return in which cases a pass rule holds, shape (n_cases,); a comparison with a missing value does not.

    >>> from parcours_navigation.facts import FACTS
    >>> from parcours_navigation.requirements.requirement import requirements_of
    >>> facts = np.zeros(2, FACTS)
    >>> facts["min_clearance"], facts["t_end"] = [0.2, 0.04], 7_000_000_000
    >>> holds(requirements_of({}, ["clearance < 5 cm or time > 30 s"]).rules[0].formula, facts).tolist()
    [False, True]
    """
    match rule:
        case Comparison(operator, left, right):
            a, b = _number(left, facts), _number(right, facts)
            with np.errstate(invalid="ignore"):
                answer = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[operator]
            return cast(Flags, np.broadcast_to(answer, len(facts)))
        case Not(operand):
            return ~holds(operand, facts)
        case Junction("and", left, right):
            return holds(left, facts) & holds(right, facts)
        case Junction("or", left, right):
            return holds(left, facts) | holds(right, facts)
        case Junction(_, left, right):
            return ~holds(left, facts) | holds(right, facts)
        case _:
            raise AssertionError(rule)  # not parsed in a pass rule


def distance(rule: Formula, facts: Facts) -> Values:
    """Return how far a pass rule is from holding, negative where it holds, shape (n_cases,); FAR for a missing value.

    >>> from parcours_navigation.facts import FACTS
    >>> from parcours_navigation.requirements.requirement import requirements_of
    >>> facts = np.zeros(2, FACTS)
    >>> facts["min_clearance"], facts["t_end"] = [0.2, 0.04], 7_000_000_000
    >>> distance(requirements_of({}, ["clearance < 5 cm or time > 30 s"]).rules[0].formula, facts).round(3).tolist()
    [0.15, -0.01]
    """
    match rule:
        case Comparison(operator, left, right):
            a, b = _number(left, facts), _number(right, facts)
            far = a - b if operator in ("<", "<=") else b - a
            return np.broadcast_to(np.nan_to_num(far, nan=FAR, posinf=FAR, neginf=-FAR), len(facts))
        case Not(operand):
            return -distance(operand, facts)
        case Junction("and", left, right):
            return np.maximum(distance(left, facts), distance(right, facts))
        case Junction("or", left, right):
            return np.minimum(distance(left, facts), distance(right, facts))
        case Junction(_, left, right):
            return np.minimum(-distance(left, facts), distance(right, facts))
        case _:
            raise AssertionError(rule)  # not parsed in a pass rule


def _number(node: Number, facts: Facts) -> Values:
    with np.errstate(all="ignore"):
        match node:
            case Constant(value):
                return np.asarray(value)
            case Signal(name):
                return values_of(facts, name)
            case Negative(operand):
                return -_number(operand, facts)
            case Arithmetic(operator, left, right):
                a, b = _number(left, facts), _number(right, facts)
                found = {"+": a + b, "-": a - b, "*": a * b}
                return found[operator] if operator in found else np.divide(a, b)
            case Function(name, arguments):
                compute = {"abs": np.abs, "sqrt": np.sqrt, "hypot": np.hypot, "min": np.minimum, "max": np.maximum}
                return np.asarray(compute[name](*(_number(one, facts) for one in arguments)))


def joined(
    facts: Facts, results: dict[int, Values], requirements: Requirements,
    own: Mapping[int, tuple[float, ...]] | None = None,
) -> Facts:  # fmt: skip
    """Return facts with the fields of `Requirements.facts`, NaN where the planner's own error ended the case.

    Args:
        facts: shape (n,).
        results: robustness and when it is decided [s], shape (2, n_requirements), by case number.
        own: values of measures in Python, by case number.
    """
    layout = requirements.facts(facts.dtype)
    if layout == facts.dtype:
        return facts
    found = np.zeros(len(facts), layout)
    for name in facts.dtype.names or ():
        found[name] = facts[name]
    if requirements.in_python:
        found["own"] = tuple([np.nan] * len(requirements.in_python))
        for k, number in enumerate(facts["number"].tolist()):
            if not facts["error"][k] and number in (own or {}):
                found["own"][k] = (own or {})[number]
    if not requirements.formulas:
        return found
    values = np.full((len(facts), 2, len(requirements.formulas)), np.nan)
    for k, number in enumerate(facts["number"].tolist()):
        if (result := results.get(number)) is not None:
            values[k] = result
    values[facts["error"] != 0] = np.nan
    found["robustness"], found["violated_at"] = values[:, 0], values[:, 1]
    return found


def robustness(facts: Facts, requirements: Requirements) -> Values:
    """Return the robustness of each requirement in each case, shape (n_cases, n_requirements)."""
    if not requirements.formulas:
        return np.zeros((len(facts), 0))
    return np.asarray(facts["robustness"])


def violations(facts: Facts, requirements: Requirements) -> Values:
    """Return 1 where a case violates a requirement, else 0, NaN where it was not judged; shape of `robustness`."""
    values = robustness(facts, requirements)
    return np.where(np.isnan(values), np.nan, (values < 0.0).astype(np.float64))


RATES = {
    "contacts": Outcome.COLLIDED,
    "reached": Outcome.REACHED,
    "late": Outcome.UNDER_WAY,
    "blocked": Outcome.BLOCKED,
    "stuck": Outcome.STUCK,
    "astray": Outcome.ASTRAY,
    "errors": Outcome.ERROR,
}
"""Rates of outcomes, by name."""


def counts(facts: Facts, requirements: Requirements) -> dict[str, NDArray[np.int8]]:
    """Return what each case counts for the rates of outcomes, of failures, and of violated requirements, shape (n,).

    1 or 0; -1 where a requirement was not judged. Beside the rates it counts for `passed`.
    """
    ended, values = outcomes(facts), robustness(facts, requirements)
    judged = _judged(ended, facts, requirements)
    found = {name: (ended == int(outcome)).view(np.int8) for name, outcome in RATES.items()}
    found["failed"] = ((judged == _FAIL) | (judged == _ERROR)).view(np.int8)
    for k, one in enumerate(requirements.formulas):
        found[f"violated({one.name})"] = np.where(np.isnan(values[:, k]), np.int8(-1), values[:, k] < 0.0)
    return found | {PASSED: (judged == _PASS).view(np.int8)}


def asked_of(facts: Facts, requirements: Requirements) -> tuple[list[str], Flags]:
    """Return what may become of requirements and pass rules, in words, and whether it did, shape (n_cases, n_words)."""
    values = robustness(facts, requirements)
    words = [f"{one.name} {what}" for one in requirements.formulas for what in ("kept", "violated")]
    met = [flags for k in range(values.shape[1]) for flags in (values[:, k] >= 0.0, values[:, k] < 0.0)]
    words += [f"fail: {one.text}" for one in requirements.rules]
    met += [holds(one.formula, facts) for one in requirements.rules]
    return words, np.array(met, bool).reshape(len(words), len(facts)).T


def rates(facts: Facts, requirements: Requirements) -> dict[str, Values]:
    """Return what `counts` does as numbers, NaN where a requirement was not judged, shape (n_cases,) each."""
    counted = counts(facts, requirements)
    return {name: np.where(one < 0, np.nan, one) for name, one in counted.items() if name != PASSED}


def finite_robustness(facts: Facts, requirements: Requirements) -> Values:
    """Return the robustness with FAR in place of infinity, for statistics; shape of `robustness`."""
    return np.clip(robustness(facts, requirements), -FAR, FAR)


def _judged(ended: NDArray[np.int64], facts: Facts, requirements: Requirements) -> NDArray[np.int8]:
    """Return the verdict of each case as its code in VERDICTS, shape (n_cases,); `ended` is its outcome."""
    found: NDArray[np.int8] = _OF_OUTCOME[ended]
    if not requirements:
        return found
    values = robustness(facts, requirements)
    failed = np.asarray((values < 0.0).any(axis=1))
    for rule in requirements.rules:
        failed |= holds(rule.formula, facts)
    unknown = np.isnan(values).any(axis=1)
    judged = np.where(failed, _FAIL, np.where(unknown, _INCONCLUSIVE, found))
    return np.where((found == _FAIL) | (found == _ERROR), found, judged).astype(np.int8)


def verdicts(facts: Facts, requirements: Requirements) -> list[Verdict]:
    """Return the verdict of each case."""
    return [VERDICTS[code] for code in _judged(outcomes(facts), facts, requirements).tolist()]


def explained(record: np.void, requirements: Requirements) -> str:
    """Return why a case got its verdict: what it violates, by how much and when, and how it ended."""
    ended = explain(record)
    if record["error"] or not requirements:
        return ended
    facts = np.array([record])
    said = []
    for k, one in enumerate(requirements.formulas):
        value = float(record["robustness"][k])
        if value < 0.0:
            when = f"at {float(record['violated_at'][k]):.2f} s by {one.by(-value)}"
            said.append(f"violates {one.name} {when}: {one.text}")
        elif np.isnan(value):
            said.append(f"{one.name} has no value in this case: {one.text}")
    said += [f"fails by {one.text} ({_shown(one.formula, facts)})" for one in requirements.rules
             if holds(one.formula, facts)[0]]  # fmt: skip
    return "; ".join([*said, ended])


def shared_reasons(facts: Facts, requirements: Requirements) -> list[str]:
    """Return for each case which requirements it violates and which rules it fails by, in words that cases share."""
    said: list[list[str]] = [[] for _ in facts]
    if not requirements:
        return [""] * len(facts)
    sound = facts["error"] == 0
    masks = [(f"violates {one.name}: {one.text}", facts["robustness"][:, k] < 0.0)
             for k, one in enumerate(requirements.formulas)]  # fmt: skip
    masks += [(f"{one.name} has no value: {one.text}", np.isnan(facts["robustness"][:, k]))
              for k, one in enumerate(requirements.formulas)]  # fmt: skip
    masks += [(f"fails by {one.text}", holds(one.formula, facts)) for one in requirements.rules]
    for words, mask in masks:
        for k in np.flatnonzero(mask & sound):
            said[k].append(words)
    return ["; ".join(one) for one in said]


def _shown(rule: Formula, facts: Facts) -> str:
    """Return the values that a rule reads, in words."""
    return ", ".join(f"{name} = {_amount(name, facts)}" for name in _read(rule))


def _amount(name: str, facts: Facts) -> str:
    unit = VALUES[name].unit if name in VALUES else "1"
    return f"{float(values_of(facts, name)[0]):.4g}{'' if unit == '1' else ' ' + unit}"


def _read(rule: Formula) -> Sequence[str]:
    return sorted(signals(rule))
