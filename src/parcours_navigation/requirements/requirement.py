"""Named requirements and pass rules of a study: read from text, judged over a case, kept in a manifest."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest, BadResults
from parcours_navigation.requirements.kernel import evaluate, judge
from parcours_navigation.requirements.parsing import Parsed, parse, parse_number
from parcours_navigation.requirements.programs import Program, compile_formulas
from parcours_navigation.requirements.syntax import Formula, Number, replaced, signals
from parcours_navigation.requirements.user_measures import digest_of, file_of_measure
from parcours_navigation.requirements.vocabulary import FLAG, SIGNALS, VALUES, Meaning, unit_of

Floats = NDArray[np.float64]

MOST = 64
"""Most requirements of a study."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, slots=True)
class Requirement:
    """One requirement: what must hold of the signals of every case."""

    name: str
    text: str  # as its author wrote it
    formula: Formula
    unit: str  # of its robustness; "1" if its comparisons are in several

    def by(self, amount: float) -> str:
        """Return an amount of robustness in words."""
        return f"{amount:.4g}" if self.unit == "1" or not np.isfinite(amount) else f"{amount:.4g} {self.unit}"


@dataclass(frozen=True, slots=True)
class PassRule:
    """A pass rule: a case of which it holds has failed."""

    text: str
    formula: Formula


@dataclass(frozen=True, slots=True)
class OwnMeasure:
    """A measure of the user's own: a number over the values of a case, or a function in Python (`own`)."""

    name: str
    text: str  # a formula, or `file.py:name`
    number: Number | None  # None: it is in Python, and its values lie in the facts
    unit: str = "1"


@dataclass(frozen=True, slots=True)
class Requirements:
    """All that a study asks of a case beside the sound outcome."""

    formulas: tuple[Requirement, ...] = ()
    rules: tuple[PassRule, ...] = ()
    measures: tuple[OwnMeasure, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.formulas or self.rules or self.measures)

    @property
    def in_python(self) -> tuple[OwnMeasure, ...]:
        """Measures whose values are taken while a case is in memory."""
        return tuple(one for one in self.measures if one.number is None)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the requirements, in order."""
        return tuple(one.name for one in self.formulas)

    def facts(self, plain: np.dtype[np.void]) -> np.dtype[np.void]:
        """Return a layout of facts with fields for what is judged; the plain one if there are no requirements.

        `robustness` has a column for each requirement, `violated_at` when it is decided [s], NaN where it holds.
        """
        n, own = len(self.formulas), [(one.name, "f8") for one in self.in_python]
        if not n and not own:
            return plain
        judged: list[Any] = [("robustness", "f8", (n,)), ("violated_at", "f8", (n,))] if n else []
        return np.dtype([*plain.descr, *judged, *([("own", own)] if own else [])])

    def manifest(self) -> dict[str, object]:
        """Return the parameters of a campaign that decide what is judged; none if there is nothing to judge."""
        if not self:
            return {}
        require = [[one.name, one.text] for one in self.formulas]
        found: dict[str, object] = {"require": require, "fail": [one.text for one in self.rules]}
        if self.measures:
            found["measures"] = [[one.name, one.text] for one in self.measures]
            found["sources"] = [digest_of(one.name, one.text) for one in self.in_python]
        return {"requirements": found}


NO_REQUIREMENTS = Requirements()


def requirements_of(
    require: Mapping[str, str], fail: Sequence[str] = (), where: str = "", measures: Mapping[str, str] | None = None
) -> Requirements:
    """Return the requirements of formulas by name, of pass rules, and measures by name, which pass rules may read.

    Raises BadRequest: a name is not one, there are too many, or a text is no formula.

    >>> found = requirements_of({"keeps-away": "always clearance > 5 cm"}, ["travelled > 4"])
    >>> found.names, found.formulas[0].unit
    (('keeps-away',), 'm')
    """
    if len(require) > MOST:
        rule = f"a study has at most {MOST} requirements, but this one has {len(require)}"
        raise BadRequest(where or "require", rule, "join some by `and`", slug="require-size")
    formulas = []
    for name, text in require.items():
        _require_name(name, where or "require", "write `keeps-away: always ...`")
        parsed = parse(text, f"{where}requirement {name!r}")
        formulas.append(Requirement(name, " ".join(text.split()), parsed.formula, _unit(parsed)))
    own = {name: _measure(name, " ".join(text.split()), where) for name, text in (measures or {}).items()}
    known = VALUES | {name: Meaning(one.unit, "a measure of the study's own") for name, one in own.items()}
    rules = []
    for text in fail:
        formula = parse(text, f"{where}fail", known, temporal=False).formula
        numbers = {name: one.number for name, one in own.items() if one.number is not None}
        rules.append(PassRule(" ".join(text.split()), cast(Formula, replaced(formula, numbers))))
    return Requirements(tuple(formulas), tuple(rules), tuple(own.values()))


def _require_name(name: str, where: str, remedy: str) -> None:
    if not _NAME.fullmatch(name):
        rule = f"its name must be of letters, digits and _ . -, and begin with a letter, but is {name[:64]!r}"
        raise BadRequest(where, rule, remedy, slug="require-name")


def _measure(name: str, text: str, where: str) -> OwnMeasure:
    at = f"{where}measure {name!r}"
    _require_name(name, where or "measures", "write `hesitation: time_at_rest / time`")
    if name in VALUES or not name.isidentifier():
        rule = "its name must be one that formulas can read, and none that they read already"
        raise BadRequest(at, rule, "rename it", slug="require-name")
    if file_of_measure(text) is not None:
        return OwnMeasure(name, text, None)
    number, dimension = parse_number(text, at, VALUES)
    return OwnMeasure(name, text, number, unit_of(dimension))


def _unit(parsed: Parsed) -> str:
    """Return the unit of robustness: of the signals where they share one, as radians, which are no dimension."""
    meanings = [SIGNALS[name] for name in signals(parsed.formula)]
    named = {one.unit for one in meanings if one.unit != FLAG and one.dimension == parsed.dimension}
    return named.pop() if len(named) == 1 else unit_of(parsed.dimension)


def read_requirements(require: str, fail: str = "", measure: str = "") -> Requirements:
    """Return the requirements of options: `name: formula`, rules, and `name: measure`, separated by `;` or lines.

    Raises BadRequest: as `requirements_of`, or a name is missing or given twice.

    >>> read_requirements("near: eventually goal_distance < 0.2; slow: always speed < 0.3").names
    ('near', 'slow')
    """
    found = _named(require, "require", "requirement", "keeps-away: always clearance > 0.05")
    measures = _named(measure, "measure", "measure", "hesitation: time_at_rest / time")
    return requirements_of(found, _lines(fail), "", {name: located(text) for name, text in measures.items()})


def located(text: str, folder: Path | None = None) -> str:
    """Return the text of a measure, with the whole path of its file if it is in Python."""
    path = file_of_measure(text)
    return text if path is None else f"{((folder or Path()) / path).absolute()}:{text.rpartition(':')[2].strip()}"


def _named(given: str, option: str, what: str, example: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for line in _lines(given):
        name, colon, text = line.partition(":")
        name = name.strip()
        if not colon:
            rule = f"each {what} has a name, but {line[:60]!r} has none"
            raise BadRequest(f"--{option}", rule, f"write `{example}`", slug="require-form")
        if name in found:
            rule = f"each {what} has a name of its own, but {name!r} is given twice"
            raise BadRequest(f"--{option}", rule, "rename one", slug="require-form")
        found[name] = text.strip()
    return found


def kept(parameters: Mapping[str, object], where: str) -> Requirements:
    """Return the requirements that a campaign's manifest holds (`Requirements.manifest`); none if it holds none.

    Raises BadResults: they are not requirements.
    """
    given = parameters.get("requirements")
    if given is None:
        return NO_REQUIREMENTS
    try:
        require = {str(name): str(text) for name, text in given["require"]}  # type: ignore[index]
        measures = {str(name): str(text) for name, text in given.get("measures", ())}  # type: ignore[attr-defined]
        return requirements_of(require, [str(text) for text in given["fail"]], "", measures)  # type: ignore[index]
    except (AttributeError, BadRequest, KeyError, TypeError, ValueError) as error:
        rule = f"the manifest must hold requirements that this version reads, but: {error}"
        raise BadResults(where, rule, "run the campaign again", slug="results-parameters") from error


def _lines(text: str) -> list[str]:
    return [one for one in (part.strip() for part in re.split(r"[;\n]", text)) if one]


class Monitor:
    """The requirements of a study, compiled, with memory to judge cases in; `results` keeps them by case number."""

    def __init__(self, requirements: Requirements, n_samples: int) -> None:
        self.program: Program = compile_formulas([one.formula for one in requirements.formulas])
        self.memory = self.program.memory(n_samples)
        self.absent = np.zeros(len(self.memory), np.int64)
        # Robustness, and when it is decided [s] where it is negative, shape (2, n_requirements)
        self.results: dict[int, Floats] = {}
        self.own: dict[int, tuple[float, ...]] = {}  # values of measures in Python, by case number
        self.measures = requirements.in_python

    def judge(
        self, entries: Floats, last: Floats, radii: Floats, robot_radius: float, goal: tuple[float, float]
    ) -> Floats:
        """Return the robustness of each requirement over a case, and when it is decided, shape (2, n_requirements).

        Args: as of `signals.take`; when they are decided is in seconds, NaN where they hold.
        """
        program, found = self.program, np.empty((2, len(self.program.roots)))
        judge(
            entries, last, radii, robot_radius, *goal, program.code, program.roots, program.wanted, self.memory,
            self.absent, found[0], found[1],
        )  # fmt: skip
        return found


def robustness_of(formulas: Sequence[Formula], signals: Mapping[str, ArrayLike]) -> tuple[Floats, Floats]:
    """Return the robustness of formulas over signals, and at which sample each is decided, NaN where it holds.

    Args:
        signals: by any names, those that the formulas read among them; shape (n_samples,) each, at least one sample.

    >>> from parcours_navigation.requirements.parsing import parse
    >>> found, when = robustness_of([parse("always speed < 0.2").formula], {"speed": [0.1, 0.25, 0.1]})
    >>> found.round(3).tolist(), when.tolist()
    ([-0.05], [1.0])
    """
    names = [*signals] or [*SIGNALS]
    rows = np.array([np.asarray(one, np.float64) for one in signals.values()], np.float64)
    program = compile_formulas(formulas, names)
    memory = program.memory(rows.shape[1])
    memory[: len(rows), : rows.shape[1]] = rows
    robustness, when = np.zeros(len(formulas)), np.zeros(len(formulas))
    absent = np.zeros(len(memory), np.int64)
    evaluate(program.code, program.roots, memory, absent, rows.shape[1], robustness, when)
    return robustness, when
