"""A study's own parameters: what may be set, in which unit and range, and the settings that a user gives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

from parcours.errors import BadRequest, one_of

if TYPE_CHECKING:
    from parcours.data import Domain, InputModel
    from parcours.suite import Case

Scalar: TypeAlias = bool | int | float | str
Settings: TypeAlias = Mapping[str, Scalar]  # A value for every parameter of a study, by name

Kind = Literal["bool", "int", "real", "text"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True)
class Parameter:
    """One thing about a study that its user may set.

    >>> speed = Parameter("speed", "real", 0.25, "of the robot", "m/s", low=0.0, high=1.0)
    >>> speed.read("0.5")
    0.5
    >>> speed.read("2")
    Traceback (most recent call last):
    parcours.errors.BadRequest: --speed: must be from 0 to 1 m/s, but '2' was given [parameter-range]
    """

    name: str  # a Python identifier; `added_stop` is the option `--added-stop`
    kind: Kind  # bool, int, real or text
    default: Scalar  # its default value
    doc: str = ""  # what it means, for the help
    unit: str = "1"  # SI unit of a number; "1" has none
    low: float | None = None  # least value allowed, inclusive
    high: float | None = None  # greatest value allowed, inclusive
    choices: tuple[str, ...] = ()  # the texts allowed; all if empty
    # whether results depend on it. What does not (how many workers, whether to record) may differ when a run is
    # resumed
    decides: bool = True

    @property
    def option(self) -> str:
        """How the parameter is called on the command line."""
        return "--" + self.name.replace("_", "-")

    def read(self, given: object) -> Scalar:
        """Return the value that a text or a plain value stands for.

        Raises BadRequest: it is of another kind, out of range, or not among the choices.
        """
        value = self._value(given)
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            what = {"bool": "true or false", "int": "a whole number", "real": "a number", "text": "a text"}[self.kind]
            raise BadRequest(self.option, f"must be {what}, but {given!r} was given", slug="parameter-kind")
        if self.choices and value not in self.choices:
            rule = f"must be one of its choices, but {given!r} was given"
            raise BadRequest(self.option, rule, one_of(str(value), self.choices), slug="parameter-choice")
        if not isinstance(value, str | bool) and (
            (self.low is not None and value < self.low) or (self.high is not None and value > self.high)
        ):
            rule = f"must be {self.range_text()}, but {given!r} was given"
            raise BadRequest(self.option, rule, slug="parameter-range")
        return value

    def range_text(self) -> str:
        """Return the range in words, empty if there is none."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.low is not None and self.high is not None:
            return f"from {self.low:g} to {self.high:g}{unit}"
        if self.low is not None:
            return f"{self.low:g}{unit} or more"
        return f"at most {self.high:g}{unit}" if self.high is not None else ""

    def help(self) -> str:
        """Return the line of the help: what it means, its unit and its range."""
        unit = "" if self.unit == "1" else f"[{self.unit}]"
        allowed = self.range_text()
        return " ".join(part for part in (self.doc, unit, f"({allowed})" if allowed else "") if part)

    def _value(self, given: object) -> Scalar | None:
        if self.kind == "bool":
            return {"true": True, "false": False}.get(str(given).lower()) if not isinstance(given, float) else None
        if self.kind == "text":
            return given if isinstance(given, str) else None
        if isinstance(given, bool) or not isinstance(given, int | float | str):
            return None
        try:
            return (
                float(given)
                if self.kind == "real"
                else int(given, 10)
                if isinstance(given, str)
                else int(given)
                if given == int(given)
                else None
            )
        except (ValueError, OverflowError):
            return None


# Options that commands or kinds of study have: no parameter may have their names
OPTIONS = (
    "address", "as_json", "baseline", "case", "cases", "cases_from", "chosen", "engine", "fail_if", "fresh",
    "graph", "help", "host", "json", "junit", "n_cases", "out", "record", "repeats", "seed", "set", "study",
    "workers",
)  # fmt: skip


def settings_of(
    parameters: Sequence[Parameter], given: Mapping[str, object], where: str = "study"
) -> dict[str, Scalar]:
    """Return a value for every parameter: those given, checked, and the defaults of the rest.

    Raises BadRequest: a name is no parameter's, or a value is not allowed.
    """
    names = [parameter.name for parameter in parameters]
    for name in given:
        if name not in names:
            remedy = one_of(name, names) if names else "it has none"
            if name in OPTIONS:
                remedy = f"give it as an option of its own, --{name.replace('_', '-')}, where the command has it"
            raise BadRequest(where, f"it has no parameter {name!r}", remedy, slug="parameter-unknown")
    return {one.name: one.read(given[one.name]) if one.name in given else one.default for one in parameters}


def pairs_of(given: Sequence[str]) -> dict[str, str]:
    """Return NAME=VALUE texts as a mapping. Raises BadRequest if one has no `=`.

    >>> pairs_of(["added-stop=0.5"])
    {'added_stop': '0.5'}
    """
    pairs = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            raise BadRequest("--set", f"must be NAME=VALUE, but is {text!r}", slug="parameter-form")
        pairs[name.strip().replace("-", "_")] = value.strip()
    return pairs


def workers_parameter() -> Parameter:
    """Return the parameter `workers`: by default one process a processor."""
    import os

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Parameter(
        "workers", "int", cores, "processes; one per processor if not given", low=1, high=1024, decides=False
    )


def natural(domain: Domain, value: float) -> Scalar:
    """Return a drawn value as people write it: a whole number, a name of an enumeration, or a number."""
    if domain.kind == "enumeration":
        return domain.values[int(value)]
    return int(value) if domain.kind == "integer" else float(value)


def natural_values(inputs: InputModel, case: Case) -> dict[str, Scalar]:
    """Return the test inputs of a case by name, each as its domain means it."""
    domains = {domain.name: domain for domain in inputs.domains}
    return {
        name: natural(domains[name], value) if name in domains else value
        for name, value in zip(case.names, case.values, strict=True)
    }
