"""The text of a file, while it is written, into findings and drawings; no code that it names is run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import cast

from parcours.errors import BadRequest, ParcoursError
from parcours.model import Cefsm, to_svg
from parcours.model.documents import Mapping, Node, Scalar, read_document
from parcours.model.finding import Finding, errors_among, finding_of
from parcours.model.model_file import check_text
from parcours.run.binding.binding_file import check_binding
from parcours.studio.folder import SUFFIXES, Folder, kind_of

MOST_DRAWN = 1500
"""Most transitions of a model that is drawn while it is written."""

_MOST_FOLLOWED = 100  # files that a file names, and those that they name


GROUP = "parcours.documents"
"""Entry points of this group check further kinds of file: `KIND = package.module:function`, called as a `Check`."""

Check = Callable[[str, Path], tuple[Sequence[Finding], Sequence[tuple[str, str]]]]
"""A text and the file that it is to become -> what is wrong with it; pictures of it, each a title and an <svg>."""


@dataclass(frozen=True, slots=True)
class CheckedText:
    """What is known of a text from looking at it."""

    model: Cefsm | None = None  # the text's own, or that of the study or binding that it is
    findings: Sequence[Finding] = ()
    pictures: Sequence[tuple[str, str]] = ()  # of another thing than a model: a title and an <svg>


def checked(folder: Folder, path: str, text: str) -> CheckedText:
    """Return what `model check`, `binding check` or reading the file would find, with what there is to draw.

    Args:
        path: where the text is a file of the folder; files that it names are looked for from there.
    """
    kind, full = kind_of(text), folder.root / path
    if kind == "model":
        read = check_text(text, path)
        return CheckedText(read.model, read.findings)
    if kind == "data":
        from parcours.data.schema import parse_input_model

        try:
            parse_input_model(text, path)
        except ParcoursError as error:
            return CheckedText(findings=[finding_of(error, path)])
        return CheckedText()
    points = {point.name: point for point in entry_points(group=GROUP)}
    if kind not in ("study", "binding", *points):
        return CheckedText()
    outside = tuple(_outside(folder, path, text))
    if outside:
        return CheckedText(findings=outside)
    pictures: Sequence[tuple[str, str]] = ()
    model, findings = None, cast(Sequence[Finding], ())
    if kind == "study":
        from parcours.study.study_file import check_study_file

        study, findings = check_study_file(full, text)
        model = getattr(study, "model", None)
    elif kind == "binding":
        binding, findings = check_binding(text, str(full))
        model = binding.model if binding is not None else None
    else:
        check: Check = points[kind].load()
        findings, pictures = check(text, full)
    return CheckedText(
        model if isinstance(model, Cefsm) else None, tuple(_named(folder, one) for one in findings), pictures
    )


def require_sound(folder: Folder, path: str) -> None:
    """Raise BadRequest unless a file of the folder has no errors: commands then read what is known to be harmless."""
    from parcours.model.finding import complaint

    errors = errors_among(checked(folder, path, folder.text(path).text).findings)
    if errors:
        raise complaint(errors)


def pictures_of(one: CheckedText) -> list[dict[str, object]]:
    """Return what is drawn beside a text: its machines, or the pictures that its kind has."""
    if one.model is not None:
        return drawings(one.model)
    return [{"title": title, "svg": svg} for title, svg in one.pictures]


def drawings(model: Cefsm) -> list[dict[str, object]]:
    """Return each machine with its picture, and where its transitions lead."""
    if sum(len(machine.transitions) for part in model.components for machine in part.machines) > MOST_DRAWN:
        return []
    return [
        {
            "component": part.name, "machine": machine.name, "initial": machine.initial,
            "title": f"{part.name}: {machine.name}", "svg": to_svg(machine, f"{part.name}: {machine.name}"),
            "transitions": {one.id: [one.source, one.target] for one in machine.transitions},
        }
        for part in model.components for machine in part.machines
    ]  # fmt: skip


def _named(folder: Folder, finding: Finding) -> Finding:
    """Return a finding that names its file from the folder."""
    return replace(finding, file=finding.file.replace(f"{folder.root}{os.sep}", ""))


def _outside(folder: Folder, path: str, text: str) -> Iterator[Finding]:
    """Yield a complaint for each text file outside the folder that a file names: messages would quote it.

    YAML files in the folder that it names may name others. A program may lie anywhere: its text is not read.
    """
    waiting, seen = [(path, text)], {path}
    while waiting:
        at, content = waiting.pop()
        document, _ = read_document(content, at)
        for line, word in dict.fromkeys((one.line, word) for one in _scalars(document) for word in _words(one.text)):
            named = folder.root / Path(at).parent / word
            try:
                is_read = named.is_file() and not os.access(named, os.X_OK)
            except OSError:
                continue
            inside = folder.inside(named) if is_read else ""  # no file: nothing of it is read
            if inside is None:
                rule = f"a file must name files in the studio's folder, but {word[:80]!r} lies elsewhere"
                yield Finding(at, line, "error", "studio-outside", rule, "start the studio in a folder that holds both")
            elif inside.endswith(SUFFIXES) and inside not in seen and len(seen) < _MOST_FOLLOWED:
                seen.add(inside)
                with contextlib.suppress(BadRequest):  # said by what reads it
                    waiting.append((inside, folder.text(inside).text))


def _words(text: str) -> Iterator[str]:
    for word in (text, text.rpartition(":")[0]):
        if word and "\0" not in word and len(word) <= 4096:
            yield word


def _scalars(node: Node | None) -> Iterator[Scalar]:
    if isinstance(node, Scalar):
        yield node
    elif isinstance(node, Mapping):
        for _, value in node.items:
            yield from _scalars(value)
    elif node is not None:
        for item in node.items:
            yield from _scalars(item)
