"""Reads a UPPAAL file as a model: its parts are read, instantiated, written out and composed."""

from __future__ import annotations

from pathlib import PurePath

from parcours.errors import BadModel
from parcours.model.conversion import ForeignModel, accepted
from parcours.model.expression import Expression, names
from parcours.model.structure import CLOCK, Cefsm
from parcours_formats.guard_languages.values import TRUE, conjunction, conjuncts
from parcours_formats.losses import Losses
from parcours_formats.naming import as_label
from parcours_formats.uppaal.composing import Composing, ProcessPart
from parcours_formats.uppaal.declarations import Aside, Declared, Routine, SystemLine, parse_declarations
from parcours_formats.uppaal.execution import CallingEnvironment
from parcours_formats.uppaal.processes import Instantiation, ProcessInstance, label_of, read_template
from parcours_formats.uppaal.sharing import TESTER
from parcours_formats.uppaal.steps import StepWriter
from parcours_formats.uppaal.symbols import Cells
from parcours_formats.xml_lines import parse_xml


def read(text: str, origin: str) -> ForeignModel:
    """Return the system of a UPPAAL file as a model. Raises BadModel if it says what cannot be translated."""
    root = parse_xml(text, origin)
    if root.tag != "nta":
        rule = f"the root element must be nta, but is {root.tag[:40]!r}"
        raise BadModel(f"{origin}:{root.line}", rule, slug="format")
    losses = Losses()
    cells = Cells()
    around = CallingEnvironment(cells)
    declared = []
    for element in root.all("declaration", "instantiation", "system"):
        label = label_of(element)
        declared += parse_declarations(label.text, origin, label.line)
    for each in declared:
        if isinstance(each, Declared | Routine):
            around.declare(each, f"{origin}:{each.line}")
        elif isinstance(each, Aside):
            losses.add("declarations", each.line, f"{each.what} is left out", alters="priorities" in each.what)
        elif isinstance(each, SystemLine) and each.is_ranked:
            losses.add("system", each.line, "priorities of processes are left out", alters=True)
    templates = {each.name: each for each in (read_template(element, origin) for element in root.all("template"))}
    for element in root.all("lsc"):
        losses.add("lsc", element.line, "live sequence charts are left out")
    queries = [each for element in root.all("queries") for each in element.all("query")]
    if queries:
        losses.add("queries", queries[0].line, f"{len(queries)} queries are left out: a model says no properties")
    steps = StepWriter(origin)
    parts = []
    for process in Instantiation(templates, declared, around, origin).processes():
        losses += _location_losses(process)
        parts.append(ProcessPart(process, list(steps.of(process)), _invariants(process, steps, cells, losses)))
    losses += steps.losses
    # A process `Environment` that only meets others is how our own writer writes the tester: it is read as that.
    testers = [part for part in parts if _is_tester(part)]
    if len(testers) < len(parts):
        parts = [part for part in parts if not _is_tester(part)]
    tester = {(step.link.id, step.sign) for part in testers for step in part.steps if step.link is not None}
    composing = Composing(parts, cells, losses, tester, origin)
    name = as_label(PurePath(origin).stem)
    cefsm = Cefsm(name, composing.components(), composing.links.channels, composing.links.messages, source=origin)
    return accepted(cefsm, losses)


def _is_tester(part: ProcessPart) -> bool:
    template = part.process.template
    only_meets = all(step.link is not None and step.guard == TRUE and not step.actions for step in part.steps)
    return template.name == TESTER and len(template.locations) == 1 and not part.invariants and only_meets


def _location_losses(process: ProcessInstance) -> Losses:
    found = Losses()
    for location in process.template.locations.values():
        where = f"location {location.name!r} of {process.template.name!r}"
        if location.is_committed:
            rule = "is committed; here others may move while it is urgent"
            found.add(where, location.line, rule, alters=True)
        if "exponentialrate" in location.labels:
            found.add(where, location.line, "its exponential rate is left out")
    return found


def _invariants(
    process: ProcessInstance, steps: StepWriter, cells: Cells, losses: Losses
) -> list[tuple[str, Expression]]:
    found = []
    for location in process.template.locations.values():
        if "invariant" not in location.labels:
            continue
        kept = []
        for part in conjuncts(steps.condition(location.labels["invariant"], process.environment)):
            used = names(part)
            if used and all(cells.kinds[id] == CLOCK for id in used):
                kept.append(part)
            elif part != TRUE:
                rule = f'the part "{part}" of its invariant is not about clocks and constants alone and is left out'
                losses.add(f"location {location.name!r} of {process.name!r}", location.line, rule, alters=True)
        if kept:
            found.append((location.name, conjunction(kept)))
    return found
