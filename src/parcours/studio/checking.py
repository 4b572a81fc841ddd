"""The text of a file, while it is written, into findings and drawings; no code that it names is run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from parcours.errors import ParcoursError
from parcours.model import Cefsm, to_svg
from parcours.model.documents import Mapping, Node, Scalar, read_document
from parcours.model.finding import Finding, errors_among
from parcours.model.model_file import check_text
from parcours.studio.folder import Folder, kind_of

MOST_DRAWN = 1500
"""Most transitions of a model that is drawn while it is written."""


def checked(folder: Folder, path: str, text: str) -> tuple[Cefsm | None, list[Finding]]:
    """Return the model of a text, or of the study that it is, and what `model check` or reading the study finds.

    Args:
        path: where the text is a file of the folder; files that a study names are looked for from there.
    """
    kind = kind_of(text)
    if kind == "model":
        found = check_text(text, path)
        return found.model, list(found.findings)
    full = folder.root / path
    if kind == "study":
        outside = list(_outside(folder, path, text))
        if outside:
            return None, outside
        from parcours.study.study_file import check_study_file

        study, findings = check_study_file(full, text)
        model = getattr(study, "model", None)
        return model if isinstance(model, Cefsm) else None, [_named(folder, one) for one in findings]
    if kind == "data":
        from parcours.data.schema import parse_input_model

        try:
            parse_input_model(text, path)
        except ParcoursError as error:
            where, _, line = error.where.rpartition(":")
            at = int(line) if line.isdecimal() else 0
            return None, [Finding(where if at else path, at, "error", error.slug, error.rule, error.remedy)]
    return None, []


def require_sound(folder: Folder, path: str) -> None:
    """Raise BadRequest unless a file of the folder has no errors: commands then read what is known to be harmless."""
    from parcours.model.finding import complaint

    errors = errors_among(checked(folder, path, folder.text(path).text)[1])
    if errors:
        raise complaint(errors)


def drawings(model: Cefsm) -> list[dict[str, object]]:
    """Return each machine with its picture, and where its transitions lead."""
    if sum(len(machine.transitions) for part in model.components for machine in part.machines) > MOST_DRAWN:
        return []
    return [
        {
            "component": part.name, "machine": machine.name, "initial": machine.initial,
            "svg": to_svg(machine, f"{part.name}: {machine.name}"),
            "transitions": {one.id: [one.source, one.target] for one in machine.transitions},
        }
        for part in model.components for machine in part.machines
    ]  # fmt: skip


def _named(folder: Folder, finding: Finding) -> Finding:
    """Return a finding that names its file from the folder."""
    return replace(finding, file=finding.file.replace(f"{folder.root}{os.sep}", ""))


def _outside(folder: Folder, path: str, text: str) -> Iterator[Finding]:
    """Yield a complaint for each text file outside the folder that a study names: messages would quote it.

    A program may lie anywhere: its text is not read.
    """
    document, _ = read_document(text, path)
    for scalar in _scalars(document):
        for word in (scalar.text, scalar.text.rpartition(":")[0]):
            if not word or "\0" in word or len(word) > 4096:
                continue
            named = folder.root / Path(path).parent / word
            try:
                read = named.is_file() and not os.access(named, os.X_OK)
            except OSError:
                continue
            if read and folder.inside(named) is None:
                rule = f"a study's files must lie in the studio's folder, but {word[:80]!r} lies elsewhere"
                remedy = "start the studio in a folder that holds both"
                yield Finding(path, scalar.line, "error", "studio-outside", rule, remedy)


def _scalars(node: Node | None) -> Iterator[Scalar]:
    if isinstance(node, Scalar):
        yield node
    elif isinstance(node, Mapping):
        for _, value in node.items:
            yield from _scalars(value)
    elif node is not None:
        for item in node.items:
            yield from _scalars(item)
