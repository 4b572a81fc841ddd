"""Writes an input model as a YAML file of format data/1 that reads back to an equal one."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from parcours.data.blocks import Block
from parcours.data.domains import Domain
from parcours.data.inputs import InputModel
from parcours.data.schema import FORMAT
from parcours.errors import BadRequest

_NO_NAME = re.compile(r"[^A-Za-z0-9_]+", re.ASCII)


def write_input_model(model: InputModel) -> str:
    """Return the text of a model: replicas and constants written out, names of constraints without brackets."""
    lines = [f"parcours: {FORMAT}", f"name: {_text(model.name)}"]
    if model.doc:
        lines.append(f"doc: {_text(model.doc)}")
    lines.append("parameters:")
    for name, domain, components in _parameters(model.domains):
        lines += [f"  {name}:", *(f"    {key}: {value}" for key, value in _entries(domain, components))]
    if model.constraints:
        lines.append("constraints:")
    for name, constraint in zip(_names([c.name for c in model.constraints]), model.constraints, strict=True):
        key = "blocks" if constraint.over == "blocks" else "row"
        lines += [f"  {name}:", f"    {key}: {_text(constraint.text or str(constraint.expression))}"]
        if constraint.doc:
            lines.append(f"    doc: {_text(constraint.doc)}")
    if model.groups:
        lines.append("groups:")
    lines += [f"  - {{of: [{', '.join(group.inputs)}], strength: {group.strength}}}" for group in model.groups]
    return "\n".join(lines) + "\n"


def _parameters(domains: Sequence[Domain]) -> Iterator[tuple[str, Domain, tuple[str, ...]]]:
    """Yield name, domain and components of each parameter; the components of a vector stand side by side."""
    # position.x, position.y, v  ->  "position" with components [x, y], then "v"
    heads = [domain.name.partition(".")[0] for domain in domains]
    index = 0
    while index < len(domains):
        end = index + 1
        if "." in domains[index].name:
            while end < len(domains) and heads[end] == heads[index]:
                end += 1
        members, head = domains[index:end], heads[index]
        if any(replace(each, name=head) != replace(members[0], name=head) for each in members) or head in heads[end:]:
            rule = f"components of a vector must stand side by side and have one domain, but those of {head!r} do not"
            raise BadRequest(f"parameter {head!r}", rule, "rename them", slug="components")
        yield head, members[0], tuple(each.name.partition(".")[2] for each in members if "." in each.name)
        index = end


def _entries(domain: Domain, components: Sequence[str]) -> Iterator[tuple[str, str]]:
    yield "unit", _text(domain.unit)
    if domain.kind != "real":
        yield "kind", domain.kind
    if components:
        yield "components", f"[{', '.join(components)}]"
    if domain.doc:
        yield "doc", _text(domain.doc)
    if domain.stated:
        yield "range", _interval(domain.stated)
    if domain.kind == "enumeration":
        yield "values", _words(domain, domain.blocks)
        if domain.invalid:
            yield "invalid", _words(domain, domain.invalid)
    else:
        is_plain = all(block.is_point and not block.name for block in domain.blocks)
        yield "values" if is_plain else "blocks", _blocks(domain.blocks)
        if domain.invalid:
            yield "invalid", _blocks(domain.invalid)
    if domain.bases != (0,):
        yield "base", f"[{', '.join(_text(domain.labels[base]) for base in domain.bases)}]"
    if domain.step is not None:
        yield "step", repr(domain.step)


def _blocks(blocks: Sequence[Block]) -> str:
    if any(block.name for block in blocks):
        return "{" + ", ".join(f"{_text(block.label)}: {_interval(block)}" for block in blocks) + "}"
    return "[" + ", ".join(_interval(block) for block in blocks) + "]"


def _interval(block: Block) -> str:
    """Return a block as it is read: a number, or an interval in quotes, since YAML has its own use for brackets."""
    low, high = (repr(float(end)) for end in (block.low, block.high))
    ends = f"{'[' if block.low_closed else '('}{low}, {high}{']' if block.high_closed else ')'}"
    return low if block.is_point else _text(ends)


def _words(domain: Domain, blocks: Sequence[Block]) -> str:
    groups = [(b.name, domain.values[math.ceil(b.first) : math.floor(b.last) + 1]) for b in blocks]
    if all((name,) == words for name, words in groups):
        return "[" + ", ".join(_text(name) for name, _ in groups) + "]"
    return "{" + ", ".join(f"{_text(name)}: [{', '.join(map(_text, words))}]" for name, words in groups) + "}"


def _names(given: Sequence[str]) -> list[str]:
    """Return the names as identifiers, all different."""
    made: list[str] = []
    for name in given:
        plain = _NO_NAME.sub("_", name).strip("_") or "rule"
        plain = plain if not plain[0].isdigit() else f"rule_{plain}"
        number = 1
        unique = plain
        while unique in made:
            number += 1
            unique = f"{plain}_{number}"
        made.append(unique)
    return made


def _text(text: str) -> str:
    """Return a text in double quotes: a JSON string is a YAML string."""
    return json.dumps(text)
