"""Reads a study.yaml of kind `planner`: the navigation study with the planner that it names, and its settings."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from parcours.model.documents import Node, Scalar, Sequence
from parcours.study.loading import file_of, is_target
from parcours_navigation.cases.family import PUBLISHED_CASES
from parcours_navigation.guests.planners import is_stack, names, source_of
from parcours_navigation.requirements.requirement import located, requirements_of
from parcours_navigation.study.door import Navigation
from parcours_navigation.worlds.file import shipped

if TYPE_CHECKING:
    from parcours.study.protocol import Study
    from parcours.study.study_file import StudyReader


def read_planner(reader: StudyReader, root: Node) -> Study | None:
    """Return the study of a document; findings are added to the reader.

    Keys: `planner` (a shipped name, file.py:Name, module:Name, or the binding of a navigation stack), `cases`, and
    `settings`, which gives parameters of the navigation study other defaults.
    """
    top = reader.keys(root, ("planner",), ("cases", "settings", "require", "fail", "measures"))
    node = top.get("planner")
    planner = reader.text(node, "planner")
    if node is not None and is_stack(planner):
        file = reader.file(node, "planner", planner)
        planner = "" if file is None else str(file.absolute())
        with reader.noting(node, "planner"):
            if file is not None:
                source_of(planner)
    elif node is not None and planner not in names():
        planner = reader.target(node, "planner")
        path = file_of(planner, reader.folder) if is_target(planner) else None
        if path is not None:
            planner = f"{path.absolute()}:{planner.rpartition(':')[2]}"
    study = Navigation(
        name=reader.name(top), doc=reader.text(top.get("doc"), "doc"), where=str(reader.path), planner=planner,
        n_cases=reader.count(top.get("cases"), "cases", PUBLISHED_CASES) or PUBLISHED_CASES,
    )  # fmt: skip
    asked = _requirements(reader, top.get("require"), top.get("fail"), top.get("measures"))
    given = reader.settings(top, {one.name: one for one in study.parameters if one.name != "planner"})
    world = str(given.get("world", ""))
    if world and world not in shipped():
        given["world"] = str((reader.folder / world).absolute())  # as every file that a study names
    return dataclasses.replace(study, defaults=(*given.items(), *asked.items()))


def _requirements(
    reader: StudyReader, require: Node | None, fail: Node | None, measures: Node | None
) -> dict[str, str]:
    """Return requirements, pass rules and measures as the parameters of these names have them; each line is checked."""
    required, rules = [], []
    own: dict[str, str] = {}
    for name, node, _ in reader.entries(measures, "measures"):
        text = located(" ".join(reader.text(node, f"measures, {name}").split()), reader.folder)
        with reader.noting(node, f"measures, {name}"):
            requirements_of({}, (), "", {name: text}).manifest()
            own[name] = text
    for name, node, _ in reader.entries(require, "require", reader.label):
        text = " ".join(reader.text(node, f"require, {name}").split())
        if not isinstance(node, Scalar):
            continue
        with reader.noting(node, f"require, {name}"):
            requirements_of({name: text})
            required.append(f"{name}: {text}")
    given = fail.items if isinstance(fail, Sequence) else () if fail is None else (fail,)
    for node in given:
        text = " ".join(reader.text(node, "fail").split())
        if not isinstance(node, Scalar):
            continue
        with reader.noting(node, "fail"):
            requirements_of({}, [text], "", own)
            rules.append(text)
    found = {
        "require": "\n".join(required), "fail": "\n".join(rules),
        "measure": "\n".join(f"{name}: {text}" for name, text in own.items()),
    }  # fmt: skip
    return {name: text for name, text in found.items() if text}
