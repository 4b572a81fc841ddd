"""Reads a study.yaml of kind `ros`: a study of foreign nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from parcours.abtc import require_cases
from parcours.model.documents import Node
from parcours.model.finding import errors_among
from parcours.run.binding import check_binding
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.door import PARAMETERS, SYSTEM, RosStudy

if TYPE_CHECKING:
    from parcours.study.protocol import Study
    from parcours.study.study_file import StudyReader


def read_ros(reader: StudyReader, root: Node) -> Study | None:
    """Return the study of a document; findings are added to the reader.

    Keys: `binding` (binding.yaml), `cases` (abstract cases; each once), `system` (system cases; none), and `settings`,
    a mapping from further parameters to other defaults.
    """
    top = reader.keys(root, (), ("binding", "cases", SYSTEM, "settings"))
    if "parameters" in top:
        rule = "a study of kind ros has no parameters of its own"
        reader.add(top["parameters"], "parameter-unknown", rule, "see `settings`")
    path = reader.file(top.get("binding"), "binding", "binding.yaml")
    if path is None:
        if "binding" not in top:
            rule = "a study of kind ros needs a binding, but there is no binding.yaml beside it"
            reader.add(None, "study-file", rule, "write one, or name it: binding: FILE")
        return None
    binding, complaints = check_binding(path.read_text(encoding="utf-8-sig", errors="replace"), str(path))
    reader.findings += errors_among(complaints)
    defaults = reader.settings(top, {one.name: one for one in PARAMETERS if one.name != SYSTEM})
    if SYSTEM in top:
        defaults[SYSTEM] = reader.integer(top[SYSTEM], SYSTEM, 0, 100_000)
        if defaults[SYSTEM] and binding is not None and binding.system is None:
            rule = "system cases need a section 'system' in the binding, but it has none"
            reader.add(top[SYSTEM], "foreign-system", rule, "see docs/bindings.md")
    cases = reader.integer(top["cases"], "cases", 0, 1_000_000) if "cases" in top else None
    if binding is None:
        return None
    if binding.stack is not None:
        rule = "a navigation stack is run by a study of kind planner, but this one's is ros"
        reader.add(top.get("binding"), "binding-stack", rule, f"write kind: planner and planner: {path.name}")
        return None
    if cases != 0 and next(abstract_scenes(binding, 1), None) is None:
        require_cases(binding.model, binding.model.source)
    for file in binding.files:
        reader.digest(file)
    return RosStudy(
        reader.name(top), binding, reader.text(top.get("doc"), "doc"), str(reader.path), cases, defaults, reader.digests
    )
