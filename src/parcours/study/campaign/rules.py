"""Facts and the formulas that judge them: what a campaign study declares, and the verdict of one case."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import BadModel
from parcours.model.expression import (
    BOOL,
    INT,
    REAL,
    TEXT,
    Apply,
    Binary,
    Expression,
    Name,
    Type,
    Unary,
    evaluate,
    names,
    parse_expression,
    type_of,
)
from parcours.study.parameters import Parameter, Scalar
from parcours.verdict.judgement import Verdict

if TYPE_CHECKING:
    from parcours.study.campaign.study import CampaignStudy

Rows = NDArray[np.void]
Worse = Literal["more", "less", ""]

# Types of facts -> as they are stored, and as formulas know them
KINDS = {"bool": ("?", BOOL), "int": ("<i8", INT), "real": ("<f8", REAL)}

RATES: tuple[tuple[str, Verdict, Worse], ...] = (
    ("failed", Verdict.FAIL, "more"), ("passed", Verdict.PASS, "less"),
    ("inconclusive", Verdict.INCONCLUSIVE, "more"), ("errors", Verdict.ERROR, "more"),
)  # fmt: skip
# Names that no fact may have: results have fields and measures of these names
TAKEN = ("number", "error", "reason", *(name for name, _, _ in RATES))

# Names that nothing else may have: they mean something to every function, or to every campaign
GIVEN = ("case", "seed", "rng", "workers")
ABSTRACT = "cases"  # the one abstract case of a campaign: its rows are the cases
_SAID = 6  # most facts in a sentence


class Fault(IntEnum):
    """Why a case has no facts: the codes of the field `error`."""

    NONE = 0
    RAISED = 1  # The simulation raised an exception
    BAD_FACTS = 2  # It gave facts that are missing, not finite, or of another type
    HUNG = 3  # It gave nothing within the patience of the study
    DIED = 4  # It took its whole process down


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that a simulation gives of every case: its name, its type (bool, int or real), its unit."""

    name: str
    kind: str = "real"
    unit: str = "1"
    doc: str = ""


@dataclass(frozen=True, slots=True)
class Rule:
    """A condition over facts, test inputs and parameters in the guard language, and what it means if it holds."""

    when: str
    why: str = ""

    @property
    def formula(self) -> Expression:
        """The condition, parsed. Raises BadModel if it cannot be."""
        return _parsed(self.when)

    def require_sound(self, types: Mapping[str, Type]) -> None:
        """Raise BadModel unless the condition is true or false, and speaks of what it can."""
        found = type_of(self.formula, types, where="a formula over facts, test inputs and parameters")
        if found != BOOL:
            rule = f'it must be true or false, but is {found} in "{self.when}"'
            raise BadModel("a formula", rule, "compare it", slug="type")


@functools.lru_cache(maxsize=1024)
def _parsed(text: str) -> Expression:
    return parse_expression(text, "a formula")


def types_of(facts: Iterable[Fact], inputs: InputModel, own: Iterable[Parameter]) -> dict[str, Type]:
    """Return the type of every name that a formula may read."""
    types = {one.name: {"bool": BOOL, "int": INT, "real": REAL}.get(one.kind, TEXT) for one in own}
    for domain in inputs.domains:
        words = Type("enum", domain.values)
        types[domain.name] = words if domain.values else INT if domain.kind == "integer" else REAL
    return types | {fact.name: KINDS[fact.kind][1] for fact in facts if fact.kind in KINDS}


def clashes(facts: Iterable[Fact], inputs: InputModel, own: Iterable[Parameter]) -> Iterator[tuple[str, str, str]]:
    """Yield each name that means two things: the name, the rule, the remedy."""
    seen: dict[str, str] = dict.fromkeys(GIVEN, "what every campaign knows by it")
    kinds = {"test input": inputs.names, "parameter": (one.name for one in own), "fact": (one.name for one in facts)}
    for what, of_kind in kinds.items():
        for name in of_kind:
            if name in seen:
                yield name, f"a name must mean one thing, but {name!r} is a {what} and {seen[name]}", "rename one"
            elif what == "fact" and name in TAKEN:
                rule = f"a fact must not be called {name!r}: results have a field or a measure of that name"
                yield name, rule, f"call it {name}_of_... or the like"
            seen.setdefault(name, f"a {what}")


def directions(rules: Iterable[Rule]) -> dict[str, Worse]:
    """Return which way is worse, for the names of which failing follows one direction only.

    >>> directions([Rule("hit || gap - margin < 0 || !arrived"), Rule("hypot(x, y) > 1")])
    {'hit': 'more', 'gap': 'less', 'margin': 'more', 'arrived': 'less'}
    """
    found: dict[str, set[int]] = {}
    for rule in rules:
        _signs(rule.formula, 1, found)
    return {name: "more" if 1 in signs else "less" for name, signs in found.items() if signs in ({1}, {-1})}


def _signs(node: Expression, sign: int, found: dict[str, set[int]]) -> None:
    """Note for each name whether the expression grows with it (sign), falls (-sign) or neither (0)."""
    match node:
        case Name(id):
            found.setdefault(id, set()).add(sign)
        case Unary(_, operand):
            _signs(operand, -sign, found)
        case Binary("&&" | "||" | "+" | "-" | "<" | "<=" | ">" | ">=" as operator, left, right):
            _signs(left, -sign if operator in ("<", "<=") else sign, found)
            _signs(right, -sign if operator in ("-", ">", ">=") else sign, found)
        case Apply("min" | "max" | "floor" | "sqrt", arguments):
            for argument in arguments:
                _signs(argument, sign, found)
        case _:
            for name in names(node):
                found.setdefault(name, set()).add(0)


@dataclass(frozen=True, slots=True)
class Ruling:
    """The verdict on a case; its reason, which cases may share; and the reason with what was seen in this case."""

    verdict: Verdict
    reason: str
    why: str


def outcome_of(study: CampaignStudy, row: np.void, known: Mapping[str, Scalar]) -> Ruling:
    """Return the verdict on a case: an error, else that of the first rule that holds, `inconclusive` before `fail`."""
    if row["error"]:
        reason = row["reason"].decode("utf-8", "replace")
        return Ruling(Verdict.ERROR, reason, reason)
    values = {**known, **{fact.name: row[fact.name].item() for fact in study.facts}}
    for verdict, rules in ((Verdict.INCONCLUSIVE, study.inconclusive), (Verdict.FAIL, study.fail)):
        for rule in rules:
            try:
                holds = evaluate(rule.formula, values, "formula")
            except BadModel as error:
                return Ruling(Verdict.ERROR, f"formula {rule.when!r}: {error.slug}", f"{error.where}: {error.rule}")
            if holds:
                reason = rule.why or rule.when
                seen = study.shown({name: values[name] for name in values if name in names(rule.formula)})
                return Ruling(verdict, reason, f"{reason} ({', '.join(seen)})" if seen else reason)
    seen = study.shown({fact.name: values[fact.name] for fact in study.facts[:_SAID]})
    return Ruling(Verdict.PASS, "", f"nothing that fails it: {', '.join(seen)}")


def values_of(facts: Rows, name: str) -> NDArray[np.float64]:
    """Return a fact of each case as a number, NaN after an error."""
    return np.where(facts["error"] == Fault.NONE, facts[name].astype(np.float64), np.nan)
