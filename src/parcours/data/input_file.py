"""Reads an input model from a YAML file of format `data/1`: domains, their blocks, and constraints.

The file may be hostile: it is read as plain data of bounded size, numbers and rules through the guard
language, and everything wrong with it is said at once, each finding with its line. docs/test-data.md
describes the format.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from parcours.data.inputs import InputModel
from parcours.data.schema import InputModelReader
from parcours.errors import BadDomain
from parcours.model.documents import MAX_BYTES, read_document
from parcours.model.finding import Finding, complaint


def read_input_model(path: Path | str, constants: Mapping[str, float] | None = None) -> InputModel:
    """Return the input model that a file describes.

    Args:
        path: a YAML file of format data/1, UTF-8, at most 1 MB.
        constants: values that replace those of the file's constants, by name, in the units the file gives.

    Raises:
        BadDomain: the file cannot be read or is no input model; the message lists all findings with their
            lines.
        BadRequest: a constant to be replaced is not in the file, or its new value is not finite.

    """
    try:
        with Path(path).open("rb") as file:
            text = file.read(MAX_BYTES + 1).decode()
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else "its bytes are no UTF-8 text"
        raise BadDomain(
            str(path), f"an input model must be a readable file, but: {said}", "check the path", slug="unreadable-file"
        ) from None
    return parse_input_model(text, str(path), constants)


def parse_input_model(text: str, origin: str, constants: Mapping[str, float] | None = None) -> InputModel:
    """Return the input model that a text describes.

    Args:
        text: YAML of format data/1.
        origin: the file's name, for messages and as the model's source.
        constants: values that replace those of the text's constants, by name, in the units the text gives.

    Raises:
        BadDomain: the text is no input model; the message lists all findings with their lines.
        BadRequest: a constant to be replaced is not in the text, or its new value is not finite.

    >>> model = parse_input_model('''
    ... parcours: data/1
    ... name: two_discs
    ... repeat: 2
    ... parameters:
    ...   x: {unit: m, blocks: ["[0, 1]", "(1, 2]"]}
    ... constraints:
    ...   apart: {pairs: "abs(a.x - b.x) >= 0.2"}
    ... ''', "here")
    >>> model.names, [str(constraint) for constraint in model.constraints]
    (('x1', 'x2'), ['apart(1, 2): abs(x1 - x2) >= 0.2'])
    """
    root, findings = read_document(text, origin)
    if root is None:
        raise _complaint(findings)
    reader = InputModelReader(origin, constants or {})
    model = reader.model(root)
    if findings or reader.findings:
        raise _complaint(findings + reader.findings)
    return model


def _complaint(findings: list[Finding]) -> BadDomain:
    error = complaint(tuple(sorted(findings)))
    return BadDomain(error.where, error.rule, error.remedy, slug=error.slug)
