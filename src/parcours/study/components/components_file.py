"""Reads a study.yaml of kind `components`; everything that is wrong with it is noted in its reader."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from parcours.abtc import POLICIES, interaction_paths
from parcours.data import CRITERIA, InputModel, read_input_model
from parcours.errors import BadModel, BadRequest, ParcoursError
from parcours.model.documents import Mapping as MappingNode
from parcours.model.documents import Node, Scalar
from parcours.model.formats import read_any
from parcours.model.model_file import check_file
from parcours.model.nodes import brief, shown
from parcours.model.structure import ENVIRONMENT, Cefsm, Component
from parcours.run.trace import Trace
from parcours.study.components.references import TOLERANCE, Reference, Relation
from parcours.study.components.study import NO_INPUTS, ComponentStudy, Limit, Oracle, order_is_kept
from parcours.study.components.systems import PATIENCE, FunctionsPart, Part, Parts, ProgramPart, PythonPart
from parcours.study.loading import load
from parcours.study.parameters import Settings
from parcours.study.protocol import Study
from parcours.study.study_file import Key, StudyReader
from parcours.suite import Case
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import Bound, parse_bound

KEYS = {
    "combine": Key("criterion", "word", "each_choice", tuple(CRITERIA)),
    "serialisation": Key("policy", "word", "", tuple(POLICIES)),
    "cases": Key("n_cases", "count"),
    "alone": Key("alone", "flag"),
    "time_budget": Key("time_budget", "time", 20.0),
    "patience": Key("patience", "time", PATIENCE),
}
_OPTIONAL = ("model", "data", "constants", "paths", "supply", "inputs", "oracles", "references", "relations", "limits",
             "mutants")  # fmt: skip


def read_components(reader: StudyReader, root: Node) -> Study | None:
    """Return the component study of a document; findings are added to the reader."""
    top, fields = reader.described(root, ("system",), KEYS, _OPTIONAL)
    files = {"model": reader.file(top.get("model"), "model", "model.yaml"),
             "data": reader.file(top.get("data"), "data", "domains.yaml")}  # fmt: skip
    model = _model(reader, files["model"], top)
    inputs = inputs_of(reader, files["data"], top)
    if model is None:  # what does not depend on the model is looked at all the same
        for limit, node, _ in reader.entries(top.get("limits"), "limits", reader.label):
            _bound(reader, node if isinstance(node, Scalar) else None, limit)
        return None
    known = (*inputs.names, *(one.name for one in fields["own"]))
    classes = {message.name: tuple(field.name for field in message.fields) for message in model.messages}
    supplied = {one.name: classes.get(one.message, ()) for one in model.channels if one.sender == ENVIRONMENT}
    variables = {
        transition.id: tuple(variable.name for variable in component.variables if variable.role == "input")
        for component in model.components for transition in component.transitions()
    }  # fmt: skip
    study = ComponentStudy(
        model=model,
        system=Parts(_parts(reader, top.get("system"), model), fields["patience"]),
        inputs=inputs,
        paths=_paths(reader, top.get("paths"), model),
        supply=reader.formulas(top.get("supply"), "supply", supplied, known, "channel from the environment"),
        set_before=reader.formulas(top.get("inputs"), "inputs", variables, known, "transition"),
        oracles=(*_oracles(reader, top.get("oracles"), model), *_references(reader, top.get("references"), model)),
        relations=_relations(reader, top.get("relations")),
        limits=_limits(reader, top.get("limits"), model),
        mutants=reader.modules(top.get("mutants")),
        files={kind: path for kind, path in files.items() if path is not None},
        **fields,
    )
    if not reader.findings:
        _require_cases(reader, study, top)
    return study


def _model(reader: StudyReader, path: Path | None, top: Mapping[str, Node]) -> Cefsm | None:
    if path is None:
        if "model" not in top and not (reader.folder / "model.yaml").exists():
            reader.add(None, "study-file", "a component study needs a model, but there is no model.yaml beside it",
                       "write one, or name it: model: FILE")  # fmt: skip
        return None
    if path.suffix in (".yaml", ".yml"):
        checked = check_file(path)
        reader.findings += [one for one in checked.findings if one.severity == "error"]
        return checked.model
    return read_any(path).cefsm


def inputs_of(reader: StudyReader, path: Path | None, top: Mapping[str, Node]) -> InputModel:
    """Return the test inputs of a file, with the study's constants; none without a file."""
    entries = reader.entries(top.get("constants"), "constants")
    constants = {name: reader.signed(node, f"constant {name}") for name, node, _ in entries}
    if path is None:
        return NO_INPUTS
    try:
        return read_input_model(path, constants or None)
    except ParcoursError as error:
        reader.complain(error)
        return NO_INPUTS


def _paths(reader: StudyReader, node: Node | None, model: Cefsm) -> str:
    from parcours.paths import internal_paths

    text = reader.text(node, "paths", "edge")
    with reader.noting(node, "paths"):
        internal_paths(model, text)
    return text


def _parts(reader: StudyReader, node: Node | None, model: Cefsm) -> dict[str, Part]:
    """Return what stands for each component: a file whose classes have their names, or an entry for each."""
    components = {component.name: component for component in model.components}
    if node is None:
        return {}
    if isinstance(node, Scalar):  # a file
        entry = {name: Scalar(f"{node.text}:{name}", True, node.line) for name in components}
        return {name: _class(reader, entry[name], model, component) for name, component in components.items()}
    entries = reader.known_entries(node, "system", components, "the model has no component {}", name=True)
    read = {name: _part(reader, value, model, components[name]) for name, value in entries}
    found = {name: part for name, part in read.items() if part is not None}
    for name in components:
        if name not in found and isinstance(node, MappingNode) and name not in {key.text for key, _ in node.items}:
            rule = f"system: nothing stands for the component {name!r}"
            reader.add(node, "study-system", rule, f"add {name}: file.py:{name}")
    return found


def _class(reader: StudyReader, node: Scalar, model: Cefsm, component: Component) -> PythonPart:
    """Return a class that has a method for each channel to the component whose name can be one.

    A transition that no message starts may have a method of its own name, `poll`, or follow in a method that yields.
    """
    methods = tuple(channel for channel in incoming(component) if channel.isidentifier())
    return PythonPart(reader.target(node, f"system, {component.name}", methods), reader.folder)


def _part(reader: StudyReader, node: Node, model: Cefsm, component: Component) -> Part | None:
    what = f"system, {component.name}"
    if isinstance(node, Scalar):
        return _class(reader, node, model, component)
    if not isinstance(node, MappingNode):
        reader.add(node, "kind", f"{what} must be file.py:Name, a command, or functions by event, but is {shown(node)}")
        return None
    if any(key.text == "command" for key, _ in node.items):
        return program_part(reader, node, what)
    events = {*incoming(component), *(transition.id for transition in component.transitions()), "poll", "wake"}
    entries = reader.known_entries(node, what, sorted(events), "{} is no channel to it and none of its transitions")
    targets = {event: reader.target(value, f"{what}, {event}") for event, value in entries}
    lacking = [channel for channel in incoming(component) if channel not in targets]
    if lacking:
        rule = f"{what} lacks functions for {', '.join(lacking)}"
        reader.add(node, "component-method", rule, f"add {lacking[0]}: file.py:name")
    return FunctionsPart(targets, reader.folder)


def program_part(reader: StudyReader, node: Node, what: str) -> ProgramPart | None:
    """Return a program that is there and can be executed; its files count for the study's digest."""
    entries = reader.record(node, what, ("command",), ("environment", "socket"))
    command = reader.words(entries.get("command"), f"command of {what}")
    if not command:
        rule = f"command of {what} must be a list of words, but is empty"
        reader.add(node, "value", rule, "write [./program, argument]")
        return None
    program, is_local = command[0], os.sep in command[0]
    found = reader.folder / program if is_local else Path(shutil.which(program) or "")
    if not (found.is_file() and os.access(found, os.X_OK)):
        rule = f"{what}: there is no program {brief(program)} {f'in {reader.folder}' if is_local else 'on the path'}"
        remedy = "build it first" if is_local and not found.exists() else "make it executable, or check its name"
        reader.add(entries["command"], "study-program", rule, remedy)
        return None
    for word in (found if is_local else None, *(reader.folder / word for word in command[1:])):
        if word is not None and word.is_file():
            reader.digest(word)
    environment = {name: reader.text(value, f"environment {name}") for name, value, _ in
                   reader.entries(entries.get("environment"), "environment")}  # fmt: skip
    return ProgramPart(command, reader.folder, environment, reader.boolean(entries.get("socket"), "socket", False))


def incoming(component: Component) -> tuple[str, ...]:
    """Return the channels on which some transition of the component receives."""
    return tuple(dict.fromkeys(one.event.channel for one in component.transitions() if one.event is not None))


@dataclass(frozen=True)
class PythonOracle:
    """An oracle that a user wrote: `function(case, trace)` returns True, None, a reason to fail, or a Judgement."""

    target: str
    folder: Path
    interaction: str = ""

    def __call__(self, case: Case, trace: Trace, settings: Settings) -> Judgement:
        """Judge a case whose order was kept."""
        if self.interaction and case.abstract.rsplit("-", 2)[0] != self.interaction:
            return Judgement(Verdict.PASS, "")
        function = load(self.target, self.folder)
        try:
            said = function(case, trace)  # type: ignore[operator]
        except Exception as error:
            return Judgement(Verdict.ERROR, f"oracle {self.target} raised {type(error).__name__}: {error}")
        if isinstance(said, Judgement):
            return said
        if said is None or said is True:
            return Judgement(Verdict.PASS, f"{self.target} holds")
        if said is False or isinstance(said, str):
            return Judgement(Verdict.FAIL, said or f"{self.target} does not hold")
        return Judgement(Verdict.ERROR, f"oracle {self.target} must return True, False, None, a text or a Judgement, "
                                        f"but returned {type(said).__name__}")  # fmt: skip


def _oracles(reader: StudyReader, node: Node | None, model: Cefsm) -> tuple[Oracle, ...]:
    """Return the user's oracles after the one that every study has: a name, or one by interaction path."""
    if node is None:
        return (order_is_kept,)
    if isinstance(node, Scalar):
        return order_is_kept, PythonOracle(reader.target(node, "oracles"), reader.folder)
    if isinstance(node, MappingNode):
        known = [one.name for one in interaction_paths(model)]
        entries = reader.known_entries(node, "oracles", known, "there is no interaction path {}")
        return order_is_kept, *(
            PythonOracle(reader.target(value, f"oracle of {name}"), reader.folder, name) for name, value in entries
        )
    listed = (reader.target(one, "an oracle") for one in reader.listed(node, "oracles"))
    return order_is_kept, *(PythonOracle(target, reader.folder) for target in listed)


def _references(reader: StudyReader, node: Node | None, model: Cefsm) -> Iterator[Reference]:
    """Yield the reference implementations: `channel: file.py:function`, or with a tolerance of their own."""
    channels = [channel.name for channel in model.channels if channel.sender != ENVIRONMENT]
    for name, value in reader.known_entries(node, "references", channels, "no component sends on {}"):
        entries = _with_tolerance(reader, value, f"reference of {name}", ("function",))
        target = reader.target(entries.get("function", value), f"reference of {name}")
        yield Reference(model, name, target, reader.folder, _tolerance(reader, entries))


def _relations(reader: StudyReader, node: Node | None) -> tuple[Relation, ...]:
    """Return the metamorphic relations: `name: {change: file.py:function, expect: file.py:function}`."""
    found = []
    for name, value, _ in reader.entries(node, "relations", reader.label):
        entries = _with_tolerance(reader, value, f"relation {name}", ("change", "expect"))
        if {"change", "expect"} <= set(entries):
            change, expect = (reader.target(entries[key], f"{key} of {name}") for key in ("change", "expect"))
            found.append(Relation(name, change, expect, reader.folder, _tolerance(reader, entries)))
    return tuple(found)


def _with_tolerance(reader: StudyReader, node: Node, what: str, keys: tuple[str, ...]) -> Mapping[str, Node]:
    if isinstance(node, Scalar) and len(keys) == 1:
        return {keys[0]: node}
    return reader.record(node, what, keys, ("tolerance",))


def _tolerance(reader: StudyReader, entries: Mapping[str, Node]) -> float:
    node = entries.get("tolerance")
    return TOLERANCE if node is None else reader.number(node, "tolerance")


def _limits(reader: StudyReader, node: Node | None, model: Cefsm) -> tuple[Limit, ...]:
    """Return the bounds on durations: `ITP1: "p95 < 50 ms"`, or `name: {from: c1, to: d1, bound: ...}`."""
    known = [one.name for one in interaction_paths(model)]
    ids = [transition.id for component in model.components for transition in component.transitions()]
    found = []
    for name, value, line in reader.entries(node, "limits", reader.label):
        ends: dict[str, str] = {}
        entries: Mapping[str, Node] = {"bound": value}
        if isinstance(value, MappingNode):
            entries = reader.record(value, f"limit {name}", ("from", "to", "bound"), ())
            for one in [end for end in ("from", "to") if end in entries]:
                ends[one] = text = reader.text(entries[one], what := f"{one} of limit {name}")
                if text not in ids:
                    rule = f"{what} must be a transition of the model, but is {brief(text)}"
                    reader.unknown(entries[one].line, text, rule, ids)
        elif name not in known:
            reader.unknown(line, name, f"limits: there is no interaction path {brief(name)}", known)
            continue
        bound = _bound(reader, entries.get("bound"), name)
        if bound is not None:
            found.append(Limit(name, bound, ends.get("from", ""), ends.get("to", "")))
    return tuple(found)


def _bound(reader: StudyReader, node: Node | None, name: str) -> Bound | None:
    if node is not None:
        with reader.noting(node, f"limit {name}"):
            return parse_bound(reader.text(node, f"limit {name}"))
    return None


def _require_cases(reader: StudyReader, study: ComponentStudy, top: Mapping[str, Node]) -> None:
    """Note that the model has no abstract case, or that a formula does not fit its field."""
    try:
        study.plan(0)
        for limit in study.limits:
            if not study.limited(limit):
                way = f"takes {limit.begin} and then {limit.end}" if limit.begin else "follows this interaction path"
                reader.add(top.get("limits"), "study-name", f"limit {limit.name}: no case {way}", "see `parcours abtc`")
        for case in study.plan(0).cases(0, min(len(study.abstracts), 200)):
            study.tester(case, {one.name: one.default for one in study.parameters})
    except BadModel as error:
        reader.complain(error)
    except BadRequest as error:
        reader.add(top.get("supply"), error.slug, f"{error.where}: {error.rule}", error.remedy)
