"""Reads and writes our own YAML (docs/model-format.md) as if it were a foreign format: nothing is lost."""

from __future__ import annotations

from parcours.model.conversion import Reading, Writing, accepted
from parcours.model.documents import read_document
from parcours.model.finding import complaint
from parcours.model.schema import SchemaReader
from parcours.model.structure import Cefsm
from parcours.model.writing import write_model


def read(text: str, origin: str) -> Reading:
    """Return the model of a YAML text, as `parse_model` does, without a look for what may be doubtful in it.

    Raises:
        BadModel: the model has errors; the message says all of them, one a line.
    """
    document, found = read_document(text, origin)
    reader = SchemaReader(origin)
    if document is not None:
        model = reader.model(document)
        if not (found := [*found, *reader.findings]):
            return accepted(model)
    raise complaint(tuple(sorted(found, key=lambda finding: (finding.line, finding.rule, finding.message))))


def write(cefsm: Cefsm) -> Writing:
    """Return the YAML text of a model."""
    return Writing(write_model(cefsm))
