"""A binding file (docs/bindings.md) to a checked binding, or to all that is wrong with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from parcours.errors import BadRequest
from parcours.model.documents import MAX_BYTES, read_document
from parcours.model.finding import Finding, complaint, errors_among
from parcours.model.structure import Cefsm
from parcours.run.binding.checking import findings as findings_of
from parcours.run.binding.document import BindingReader
from parcours.run.binding.structure import Binding


def read_binding(path: Path | str) -> Binding:
    """Return the binding that a file holds, with its model.

    Args:
        path: a YAML file of format binding/1, UTF-8, at most 1 MB; files that it names count from its folder.

    Raises:
        BadRequest: the file cannot be read, or is no binding of its model; the message lists all findings with their
            lines.
    """
    try:
        with Path(path).open("rb") as file:
            text = file.read(MAX_BYTES + 1).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else "its bytes are no UTF-8 text"
        rule = f"a binding must be a readable file, but: {said}"
        raise BadRequest(str(path), rule, "check the path", slug="unreadable-file") from None
    return parse_binding(text, str(path))


def parse_binding(text: str, origin: str = "<text>", model: Cefsm | None = None) -> Binding:
    """Return the binding that a text holds.

    Args:
        text: YAML of format binding/1.
        origin: the file's name, for messages; files that the text names count from its folder.
        model: the model to bind; None reads the file that the text names.

    Raises:
        BadRequest: the text is no binding of its model; the message lists all findings with their lines.
    """
    binding, found = check_binding(text, origin, model)
    if binding is None:
        raise refusal(found)
    return binding


def check_binding(
    text: str, origin: str = "<text>", model: Cefsm | None = None
) -> tuple[Binding | None, tuple[Finding, ...]]:
    """Return the binding of a text, None if it has errors, and every finding in the order of the lines."""
    document, unread = read_document(text, origin)
    found = [replace(one, message=one.message.replace("a model", "a binding", 1)) for one in unread]
    binding = None
    if document is not None:
        reader = BindingReader(origin, Path(origin).parent)
        binding = reader.binding(document, model)
        found += reader.findings
        if binding is not None and not found:
            found += findings_of(binding)
    ordered = tuple(sorted(found, key=lambda finding: (finding.file, finding.line, finding.rule, finding.message)))
    return None if errors_among(ordered) else binding, ordered


def refusal(found: tuple[Finding, ...]) -> BadRequest:
    """Return one error that says all errors among the findings, one a line."""
    error = complaint(errors_among(found))
    rule = error.rule.replace("a model must have no errors", "a binding must have no errors", 1)
    return BadRequest(error.where, rule, error.remedy, slug=error.slug.replace("model-errors", "binding-errors"))
