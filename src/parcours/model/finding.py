"""Findings: complaints about a model, and all of them together as one error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from parcours.errors import BadModel, ParcoursError, one_of

MAX_LABEL = 120
"""Longest name of a state, transition or machine [characters]."""

_ADVISED = 200


@dataclass(frozen=True, slots=True, order=True)
class Finding:
    """One complaint about a model: where, how grave, which rule, what was given and what to do.

    Args:
        file: the model's file, or where else it came from.
        line: line of the file [1 ..], 0 if the model was not read from text.
        severity: an `error` makes the model unusable; a `warning` may be meant.
        rule: the slug of the rule, an anchor in docs/messages.md.
        message: the rule and what was given instead.
        remedy: what to do about it; may be empty.

    >>> print(Finding("lift.yaml", 7, "warning", "unreachable-state", "no path leads to 'lost'"))
    lift.yaml:7: warning: no path leads to 'lost' [unreachable-state]
    """

    file: str
    line: int
    severity: Literal["error", "warning"]
    rule: str
    message: str
    remedy: str = ""

    @property
    def where(self) -> str:
        """The file, with the line if it is known."""
        return f"{self.file}:{self.line}" if self.line else self.file

    def __str__(self) -> str:
        tail = f"; {self.remedy}" if self.remedy else ""
        return f"{self.where}: {self.severity}: {self.message}{tail} [{self.rule}]"


def advice(given: str, known: Sequence[str], found: Sequence[Finding]) -> str:
    """Return the remedy for an unknown name, unless so much was found already that looking would take long."""
    if not known or len(found) > _ADVISED:
        return ""
    # Of very many names only the nearest is shown; looking at all of a hostile file would take long.
    if len(known) <= 30:
        return one_of(given[:MAX_LABEL], known)
    hint, _, _ = one_of(given[:MAX_LABEL], known[:1000]).rpartition("Known: ")
    return hint.strip() or f"{len(known)} names are known"


def errors_among(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings that are errors, in the same order."""
    return tuple(finding for finding in findings if finding.severity == "error")


def finding_of(error: ParcoursError, file: str) -> Finding:
    """Return an error as a finding: at the line that it names, or of the whole file.

    >>> finding_of(BadModel("yard.yaml:4", "a world has no such key", slug="unknown-key"), "yard.yaml").line
    4
    """
    where, _, line = error.where.rpartition(":")
    if line.isascii() and line.isdecimal():
        return Finding(where, int(line), "error", error.slug, error.rule, error.remedy)
    return Finding(file, 0, "error", error.slug, error.rule, error.remedy)


def complaint(
    errors: tuple[Finding, ...],
    noun: str = "a model",
    refusal: type[ParcoursError] = BadModel,
    slug: str = "model-errors",
) -> ParcoursError:
    """Return one error that says all of at least one finding, one per line.

    Args:
        errors: the findings.
        noun: what the message calls that in which they were found.
        refusal: the class of the error.
        slug: that of an error that lists several.
    """
    first = errors[0]
    if len(errors) == 1:
        return refusal(first.where, first.message, first.remedy, slug=first.rule)
    listed = "".join(f"\n  {finding}" for finding in errors)
    rule = f"{noun} must have no errors, but this one has {len(errors)}:{listed}\n "
    return refusal(first.file, rule, "correct them from the first on", slug=slug)
