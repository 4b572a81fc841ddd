"""Reads a campaign study, and checks it: first the file, then what a few cases show."""

from __future__ import annotations

import ast
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from parcours.data import CRITERIA
from parcours.errors import BadModel, ParcoursError
from parcours.model.documents import Mapping as MappingNode
from parcours.model.documents import Node, Scalar
from parcours.model.documents import Sequence as SequenceNode
from parcours.model.expression import Type, evaluate, names
from parcours.model.finding import Finding as Complaint
from parcours.model.finding import advice
from parcours.model.nodes import brief
from parcours.study.campaign.rules import GIVEN, KINDS, Fact, Fault, Rows, Rule, clashes, types_of
from parcours.study.campaign.study import PATIENCE, CampaignStudy
from parcours.study.components.components_file import inputs_of, program_part
from parcours.study.loading import file_of
from parcours.study.parameters import Settings, settings_of
from parcours.study.protocol import Progress, Study, StudyFinding
from parcours.study.study_file import Key, StudyReader

if TYPE_CHECKING:
    from parcours.study.components.systems import ProgramPart

KEYS = {
    "combine": Key("criterion", "word", "each_choice", tuple(CRITERIA)),
    "cases": Key("n_cases", "count"),
    "patience": Key("patience", "time", PATIENCE),
}
_OPTIONAL = ("data", "inconclusive", "measures", "trace", "constants", "mutants")
_TRIED = 20  # cases that the battery runs
_SEED = 1
_SLOW = 0.5  # A case that takes this share of the patience is close to being an error


def read_campaign(reader: StudyReader, root: Node) -> Study | None:
    """Return the campaign study of a document; findings are added to the reader. No code that it names is run."""
    top, fields = reader.described(root, ("simulate", "facts", "fail"), KEYS, _OPTIONAL)
    own, before = fields["own"], len(reader.findings)
    inputs = inputs_of(reader, reader.file(top.get("data"), "data", "domains.yaml"), top)
    if not inputs.domains and len(reader.findings) == before:
        rule = "a campaign study needs test inputs, but there is no domains.yaml beside it"
        reader.add(top.get("data"), "study-file", rule, "write one, or name it: data: FILE")
    facts = _facts(reader, top.get("facts"))
    lines = {
        key.text: key.line
        for part in ("parameters", "facts") if isinstance(node := top.get(part), MappingNode)
        for key, _ in node.items
    }  # fmt: skip
    for taken, rule, remedy in clashes(facts, inputs, own):
        reader.findings.append(Complaint(reader.origin, lines.get(taken, 0), "error", "study-double", rule, remedy))
    types = types_of(facts, inputs, own) if inputs.domains else None
    known = (*GIVEN[:3], *inputs.names, *(one.name for one in own)) if inputs.domains else ()
    directions = reader.known_entries(
        top.get("measures"), "measures", [fact.name for fact in facts], "there is no fact {}", name=True
    )
    fields |= {
        "simulate": _simulate(reader, top.get("simulate"), known),
        "fail": _rules(reader, top.get("fail"), "fail", types),
        "inconclusive": _rules(reader, top.get("inconclusive"), "inconclusive", types),
        "worse": {name: reader.one_of(node, f"measure {name}", ("more", "less", ""), "") for name, node in directions},
        "mutants": reader.modules(top.get("mutants")),
        "trace": _function(reader, top["trace"], "trace", known) if "trace" in top else None,
    }
    if any(finding.severity == "error" for finding in reader.findings):
        return None
    return CampaignStudy(inputs=inputs, facts=facts, folder=reader.folder, **fields)


def _facts(reader: StudyReader, node: Node | None) -> tuple[Fact, ...]:
    """Return the facts: `name: {type: real, unit: m, doc: ...}`, or `name: bool`."""
    found = []
    for name, value, _ in reader.entries(node, "facts"):
        is_brief = isinstance(value, Scalar)
        entries = {"type": value} if is_brief else reader.record(value, f"fact {name}", ("type",), ("unit", "doc"))
        kind = reader.one_of(entries.get("type"), f"type of fact {name}", tuple(KINDS), "real")
        unit = reader.text(entries.get("unit"), f"unit of {name}", "1")
        found.append(Fact(name, kind, unit, reader.text(entries.get("doc"), f"doc of {name}")))
    if isinstance(node, MappingNode) and not node.items:
        rule = "a simulation gives at least one fact, but none is named"
        reader.add(node, "study-facts", rule, "write name: {type: real}")
    return tuple(found)


def _rules(reader: StudyReader, node: Node | None, what: str, types: Mapping[str, Type] | None) -> tuple[Rule, ...]:
    """Return the rules of `fail` or `inconclusive`: a formula, or a list of formulas and of {when, why}."""
    rules = []
    for item in node.items if isinstance(node, SequenceNode) else () if node is None else (node,):
        entries = {"when": item} if isinstance(item, Scalar) else reader.record(item, what, ("when",), ("why",))
        rule = Rule(reader.text(entries.get("when"), what), reader.text(entries.get("why"), f"why of {what}"))
        if "when" not in entries or not isinstance(entries["when"], Scalar):
            continue
        with reader.noting(entries["when"], what, BadModel):
            unknown = sorted(names(rule.formula) - set(types)) if types is not None else []
            for name in unknown:
                said = f"{what}: a formula reads facts, test inputs and parameters, but there is no {brief(name)}"
                reader.unknown(entries["when"].line, name, said, sorted(types or ()))
            if types is not None and not unknown:
                rule.require_sound(types)
        rules.append(rule)
    return tuple(rules)


def _simulate(reader: StudyReader, node: Node | None, known: Sequence[str]) -> str | ProgramPart:
    if isinstance(node, MappingNode):
        return program_part(reader, node, "simulate") or ""
    return _function(reader, node, "simulate", known) if node is not None else ""


def _function(reader: StudyReader, node: Node, what: str, known: Sequence[str]) -> str:
    """Return a function's target, after looking whether it asks for what there is; its file is parsed, not run."""
    before = len(reader.findings)
    target = reader.target(node, what)
    path = file_of(target, reader.folder) if len(reader.findings) == before else None
    if path is None or not known:
        return target
    name = target.rpartition(":")[2]
    for one in ast.parse(path.read_bytes()).body:
        if isinstance(one, ast.FunctionDef) and one.name == name and not one.decorator_list:
            given = [*one.args.posonlyargs, *one.args.args]
            needed = given[: len(given) - len(one.args.defaults)]
            keywords = zip(one.args.kwonlyargs, one.args.kw_defaults, strict=True)
            needed += [arg for arg, value in keywords if value is None]
            lacking = [arg.arg for arg in needed if arg.arg not in known]
            if lacking:
                rule = f"{what} is given {', '.join(known)}, by name, but asks for {', '.join(lacking)}"
                reader.add(node, "simulate-arguments", rule, advice(lacking[0], known, reader.findings))
    return target


def check_campaign(study: CampaignStudy, progress: Progress) -> list[StudyFinding]:
    """Return what is wrong with a study, as a few cases show: run, run again, in another order, and judged."""
    settings = settings_of(study.parameters, {})
    order = tuple(range(_TRIED))
    found: list[StudyFinding] = []
    steps = (order[:1], order, order, order[::-1])
    runs: list[Rows] = []
    seconds = []
    for k, numbers in enumerate(steps):
        progress("the same cases, again and in another order", k, len(steps))
        started = time.monotonic()
        try:
            runs.append(np.sort(study.simulated(numbers, settings, _SEED), order="number"))
        except ParcoursError as error:
            return [StudyFinding("error", error.where, error.rule, error.remedy)]
        seconds.append(time.monotonic() - started)
    progress("the same cases, again and in another order", len(steps), len(steps))
    _, first, again, reverse = runs
    found += _faults(study, first)
    unsteady = _differing(study, first, again)
    if unsteady:
        found.append(StudyFinding("error", study.name, f"a case must give the same facts each time, but {unsteady}",
                             "draw random numbers from `rng` or `seed`, and read no clock"))  # fmt: skip
    elif late := _differing(study, first, reverse) or _differing(study, first[:1], runs[0]):
        rule = f"a case must not depend on those before it, but in another order {late}"
        remedy = "keep nothing between cases: no globals, no caches that change results"
        found.append(StudyFinding("error", study.name, rule, remedy))
    found += _judged(study, first, settings)
    each = max(seconds[1] - seconds[0], 0.0) / (_TRIED - 1)
    if each > _SLOW * study.patience:
        rule = f"a case takes {each:.3g} s, close to the patience of {study.patience:g} s"
        found.append(StudyFinding("warning", study.name, rule, "give it more patience"))
    rule = f"a case takes about {1e3 * each:.3g} ms, 1000 cases {1e3 * each:.3g} s in one worker"
    found.append(StudyFinding("note", study.name, rule))
    if study.trace is not None and isinstance(said := study.traced(study.case(0, _SEED), settings), str):
        found.append(
            StudyFinding("error", study.name, f"a trace must be a list of mappings, or (names, rows), but {said}")
        )
    return found


def _faults(study: CampaignStudy, rows: Rows) -> list[StudyFinding]:
    """Return the errors of cases, one for each reason."""
    remedies = {Fault.BAD_FACTS: "give every fact of the study, finite and of its type",
                Fault.HUNG: "give it more patience, or make it faster"}  # fmt: skip
    found = []
    for reason in dict.fromkeys(rows["reason"][rows["error"] != Fault.NONE].tolist()):
        alike = rows[rows["reason"] == reason]
        rule = f"{len(alike)} of {len(rows)} cases end in an error: {reason.decode('utf-8', 'replace')}"
        remedy = remedies.get(Fault(alike[0]["error"]), f"run it alone: {study.id(int(alike[0]['number']))}")
        found.append(StudyFinding("error", study.name, rule, remedy))
    return found


def _differing(study: CampaignStudy, first: Rows, second: Rows) -> str:
    """Return the first difference between two runs of the same cases, in words; empty if there is none."""
    for a, b in zip(first, second, strict=True):
        for fact in study.facts:
            if a[fact.name].tobytes() != b[fact.name].tobytes():
                values = [study.shown({fact.name: row[fact.name].item()})[0] for row in (a, b)]
                return f"case {a['number']} gave {values[0]}, then {values[1]}"
        if a.tobytes() != b.tobytes():
            said = [row["reason"].decode("utf-8", "replace") or "no error" for row in (a, b)]
            return f"case {a['number']} gave {said[0]}, then {said[1]}"
    return ""


def _judged(study: CampaignStudy, rows: Rows, settings: Settings) -> list[StudyFinding]:
    """Return which formulas cannot be evaluated, and which say the same of all cases."""
    sound = rows[rows["error"] == Fault.NONE]
    values = [
        {**study.known(inputs, settings), **{fact.name: row[fact.name].item() for fact in study.facts}}
        for row, inputs in zip(sound, study.values(sound["number"], _SEED), strict=True)
    ]
    found = []
    for what, rules in (("fail", study.fail), ("inconclusive", study.inconclusive)):
        for rule in rules:
            try:
                held = {evaluate(rule.formula, known, what) for known in values}
            except BadModel as error:
                remedy = "guard it, as in `n != 0 && 1 / n > 2`"
                found.append(StudyFinding("error", f"{study.name}, {what}", error.rule, remedy))
                continue
            if len(held) == 1 and len(values) > 1:
                always = "always" if held == {True} else "never"
                said = f"`{rule.when}` {always} holds in {len(values)} cases"
                remedy = "make sure that it can tell cases apart"
                found.append(StudyFinding("warning", f"{study.name}, {what}", said, remedy))
    return found
