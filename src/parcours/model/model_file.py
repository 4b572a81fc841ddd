"""Reads a model from a YAML file (docs/model-format.md), or returns all that is wrong with it.

Reading proper says what the file holds; `checking` says whether that makes sense. Both report everything at
once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from parcours.errors import BadModel
from parcours.model.checking import findings as findings_of
from parcours.model.conversion import ForeignModel, Writing, accepted, text_of
from parcours.model.documents import MAX_BYTES, read_document
from parcours.model.finding import Finding, complaint, errors_among
from parcours.model.schema import read_schema
from parcours.model.structure import Cefsm
from parcours.model.writing import write_model


@dataclass(frozen=True, slots=True)
class Checked:
    """What became of a file: the model unless it has errors, and every finding, in the order of the lines."""

    model: Cefsm | None
    findings: tuple[Finding, ...]


def read_model(path: str | Path) -> Cefsm:
    """Return the model that a file holds; warnings do not matter here.

    Raises:
        BadModel: the file cannot be read, or the model has errors; the message says all of them, one per line.
    """
    return _accepted(check_file(path))


def parse_model(text: str, origin: str = "<text>", constants: Mapping[str, float] | None = None) -> Cefsm:
    """Return the model that a text holds.

    Args:
        constants: other values for some of its `constants:`, for a system with other parameters.

    Raises:
        BadModel: the model has errors; the message says all of them, one per line.
    """
    return _accepted(check_text(text, origin, constants))


def check_file(path: str | Path) -> Checked:
    """Return the model of a file, None if it has errors, and every finding; never raise for a bad model."""
    origin = str(path)
    try:
        text = text_of(Path(path), MAX_BYTES)
    except BadModel as error:
        return Checked(None, (Finding(origin, 0, "error", error.slug, error.rule, error.remedy),))
    return check_text(text, origin)


def check_text(text: str, origin: str = "<text>", constants: Mapping[str, float] | None = None) -> Checked:
    """Return the model of a text, None if it has errors, and every finding; never raise for a bad model."""
    model, found = _parsed(text, origin, constants)
    if model is not None and not found:
        found = findings_of(model, origin)
    ordered = tuple(sorted(found, key=lambda finding: (finding.line, finding.rule, finding.message)))
    return Checked(None if errors_among(ordered) else model, ordered)


def read(text: str, origin: str) -> ForeignModel:
    """Return the model of a text as a format's reader does: what is doubtful in it is not looked for.

    Raises:
        BadModel: the model has errors; the message says all of them, one per line.
    """
    model, found = _parsed(text, origin)
    if model is None or found:
        raise complaint(tuple(sorted(found, key=lambda finding: (finding.line, finding.rule, finding.message))))
    return accepted(model)


def write(cefsm: Cefsm) -> Writing:
    """Return the YAML text of a model; nothing is lost."""
    return Writing(write_model(cefsm))


def _parsed(text: str, origin: str, constants: Mapping[str, float] | None = None) -> tuple[Cefsm | None, list[Finding]]:
    document, found = read_document(text, origin)
    if document is None:
        return None, found
    model, more = read_schema(document, origin, constants)
    return model, found + more


def _accepted(checked: Checked) -> Cefsm:
    if checked.model is None:
        raise complaint(errors_among(checked.findings))
    return checked.model
