"""Model files: what is written reads back, and no file, however hostile, does more than raise BadModel."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel
from parcours.model import (
    Cefsm,
    Channel,
    Component,
    Field,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
    check_file,
    check_text,
    parse_model,
    read_model,
    to_svg,
    to_text,
    write_model,
)
from parcours.model.expression import Assignment, Call, Name, parse_expression
from parcours.model.expression import Literal as Constant

FOLDERS = files("parcours_ramp") / "components", files("parcours_navigation") / "cases"
STUDIES = [Path(str(folder / "model.yaml")) for folder in FOLDERS]
RAMP = STUDIES[0].read_text()

names = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,6}", fullmatch=True).filter(
    lambda name: name not in {"and", "or", "not", "true", "false", "environment"}
)
labels = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=6) | st.sampled_from(
    [
        "on",
        "off",
        "null",
        "1",
        "2.5",
        "a b",
        "x: y",
        "#c",
        "{",
        "~",
        "yes",
        "é",
        "-",
        "'",
        '"',
        "\\",
        "@",
        "%",
        "*a",
        "&a",
    ]
)
docs = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)


def distinct(of: st.SearchStrategy[str], least: int, most: int) -> st.SearchStrategy[list[str]]:
    return st.lists(of, min_size=least, max_size=most, unique=True)


@st.composite
def variables(draw: st.DrawFn) -> list[Variable]:
    found = []
    for name in draw(distinct(names, 0, 4)):
        type_ = draw(st.sampled_from(["bool", "int", "real", "enum", "text", "M"]))
        domain: tuple[object, ...] | range = ()
        values: st.SearchStrategy[object] = st.none()
        if type_ == "bool":
            values = st.booleans()
        elif type_ == "int":
            values = st.integers(-9, 9)
            domain = range(-9, 10) if draw(st.booleans()) else ()
        elif type_ == "real":
            values = st.floats(allow_nan=False, allow_infinity=False)
        elif type_ == "text":
            values = docs
        elif type_ == "enum":
            domain = tuple(draw(distinct(labels, 1, 3)))
            values = st.sampled_from(domain)
        role: Literal["local", "input"] = "input" if type_ != "M" and draw(st.booleans()) else "local"
        found.append(Variable(f"v_{name}", type_, draw(values), role, domain, draw(st.sampled_from(["1", "m/s"]))))
    return found


@st.composite
def models(draw: st.DrawFn) -> Cefsm:
    fields = tuple(
        Field(name, draw(st.sampled_from(["int", "real", "text", "bool"])), draw(docs), draw(shapes), draw(docs))
        for name in draw(distinct(names, 0, 3))
    )
    owners = draw(distinct(names, 2, 3))
    channels = [
        Channel(f"c_{name}", owners[0], draw(st.sampled_from([*owners[1:], "environment"])), "M", draw(docs), capacity)
        for name, capacity in zip(draw(distinct(names, 1, 3)), (1, 4, 0), strict=False)
    ]
    components, ids = [], iter(draw(distinct(labels, 8, 8)))
    for owner in owners:
        own = draw(variables())
        states = draw(distinct(labels, 1, 3))
        transitions = []
        for id_ in (next(ids), next(ids)):
            received = [each.name for each in channels if each.receiver == owner and each.capacity]
            event = Receive(draw(st.sampled_from(received)), draw(st.sampled_from(["", "got"]))) if received else None
            bools = [Name(each.name) for each in own if each.type == "bool"]
            guard = draw(st.sampled_from([None, *bools, parse_expression("1 + 1 > 1 || !false")]))
            ints = [each.name for each in own if each.type == "int" and each.role == "local"]
            actions: tuple[Assignment | Call, ...] = (
                *(Assignment(name, Constant(3)) for name in ints),
                Call("act", (Constant(draw(docs)),)),
            )
            sends = [Send(each.name, (Constant(1.5),)) for each in channels if each.sender == owner][:1]
            ends = (draw(st.sampled_from(states)), draw(st.sampled_from(states)))
            transitions.append(Transition(id_, *ends, event, guard, actions, tuple(sends)))
        machine = Machine(draw(labels), states[0], tuple(states), tuple(transitions))
        components.append(Component(owner, (machine,), tuple(own), draw(docs)))
    tours = tuple(
        (name, (owners[0], each.receiver)) for name, each in zip(draw(distinct(labels, 0, 1)), channels, strict=False)
    )
    tours = tuple(tour for tour in tours if "environment" not in tour[1])
    message = MessageClass("M", fields, draw(docs))
    policy = draw(st.sampled_from(["", "hub"]))
    return Cefsm(
        draw(labels), tuple(components), tuple(channels), (message,), "", draw(docs), policy, interactions=tours
    )  # fmt: skip


shapes: st.SearchStrategy[tuple[int | str, ...]] = st.sampled_from([(), (3,), ("n", 2)])


@given(models())
@settings(deadline=None)
def test_what_is_written_reads_back_equal_and_can_be_drawn(model: Cefsm) -> None:
    text = write_model(model)
    assert parse_model(text) == model
    assert write_model(parse_model(text)) == text
    assert to_text(model) and all(to_svg(machine) for each in model.components for machine in each.machines)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.parent.name)
def test_the_studies_read_back_equal(path: Path) -> None:
    model = read_model(path)
    assert parse_model(write_model(model)) == model and model.source == str(path)


def test_states_may_be_called_what_yaml_takes_for_values() -> None:
    machines = "{m: {initial: on, transitions: {1: {from: on, to: no}, 2: {from: no, to: on}}}}"
    text = f"{{parcours: model/1, name: yes, components: {{A: {{machines: {machines}}}}}}}"
    machine = parse_model(text).components[0].machines[0]
    assert machine.states == ("on", "no") and [each.id for each in machine.transitions] == ["1", "2"]


HOSTILE: list[tuple[str, str]] = [
    ("", "empty"),
    ("# only a comment", "empty"),
    ("a: [", "yaml-syntax"),
    ("a: b\n\tc: d", "yaml-syntax"),
    ("\x00", "yaml-syntax"),
    ("a: &x [1]\nb: *x", "yaml-alias"),
    ("a: *nowhere", "yaml-alias"),
    ("a: !!python/object/apply:os.system [ls]", "yaml-tag"),
    ("!!binary aGk=", "yaml-tag"),
    ("? [a]\n: b", "yaml-key"),
    ("a: 1\n---\nb: 2", "several-documents"),
    ("[" * 100_000, "yaml-nesting"),
    ("a: " + "{b: " * 40 + "c" + "}" * 40, "yaml-nesting"),
    ("- " * 20_000, "yaml-nesting"),
    ("a: " + "x" * 1_000_001, "file-size"),
    ("\ud800", "encoding"),
    ("just text", "kind"),
    ("[1, 2]", "kind"),
    ("a: 1\na: 2", "duplicate-key"),
]


@pytest.mark.parametrize(("text", "rule"), HOSTILE)
def test_a_hostile_document_is_refused_by_name(text: str, rule: str) -> None:
    started = time.process_time()
    checked = check_text(text)
    assert checked.model is None and rule in {finding.rule for finding in checked.findings}
    assert time.process_time() - started < 2
    with pytest.raises(BadModel):
        parse_model(text)


def test_a_bomb_of_aliases_is_refused_where_it_starts() -> None:
    bomb = "a: &a [x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    [finding] = check_text(bomb).findings
    assert (finding.line, finding.rule) == (1, "yaml-alias")


@pytest.mark.parametrize(
    ("content", "rule"), [(None, "unreadable-file"), (b"name: \xff\xfe", "encoding"), (b"\x80" * 9, "encoding")]
)
def test_a_file_that_is_no_text_is_refused(tmp_path: Path, content: bytes | None, rule: str) -> None:
    path = tmp_path / "model.yaml"
    if content is not None:
        path.write_bytes(content)
    assert [finding.rule for finding in check_file(path).findings] == [rule]
    assert [finding.rule for finding in check_file(tmp_path).findings] == ["unreadable-file"]
    with pytest.raises(BadModel, match=rule):
        read_model(path)


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(RAMP, encoding="utf-8-sig")
    assert read_model(tmp_path / "model.yaml").name == "ramp_components"


def test_a_large_model_full_of_faults_is_checked_in_seconds() -> None:
    loops = "".join(f"          t{at}: {{from: s, to: s{at}, guard: x{at} > 0}}\n" for at in range(4000))
    head = "parcours: model/1\nname: m\ncomponents:\n  A:\n    machines:\n      m:\n        initial: s\n"
    started = time.process_time()
    checked = check_text(head + "        transitions:\n" + loops)
    assert len([each for each in checked.findings if each.rule == "unknown-name"]) == 4000
    assert time.process_time() - started < 10


SCALARS = ["", "~", "[]", "{}", "x", "-1", "1e400", "'a b'", "true", "[1]", "{a: b}", "!!str x", "&a b", "*a", "|\n  x"]


def _mutated(draw: Callable[..., random.Random]) -> str:
    source = draw(st.randoms(use_true_random=False))
    lines = RAMP.splitlines()
    for _ in range(source.randint(1, 4)):
        at = source.randrange(len(lines))
        match source.randrange(6):
            case 0:
                del lines[at]
            case 1:
                lines.insert(at, lines[source.randrange(len(lines))])
            case 2:
                key, _, _ = lines[at].partition(":")
                lines[at] = f"{key}: {source.choice(SCALARS)}"
            case 3:
                place = source.randrange(len(lines[at]) + 1)
                lines[at] = lines[at][:place] + source.choice("{}[]:,'\"!&*#|>-%@`\t\x07é ") + lines[at][place:]
            case 4:
                lines[at] = "  " * source.randrange(4) + lines[at].strip()
            case _:
                words = lines[at].split(" ")
                source.shuffle(words)
                lines[at] = " ".join(words)
    return "\n".join(lines)


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_a_damaged_model_is_a_model_or_a_list_of_findings(data: st.DataObject) -> None:
    checked = check_text(_mutated(data.draw), "damaged.yaml")
    if checked.model is None:
        assert checked.findings and all(str(each).startswith("damaged.yaml") for each in checked.findings)
    else:
        assert parse_model(write_model(checked.model)) == checked.model


trees = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text("ab:{}[]&*! \n", max_size=6),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["from", "to", "fields", "type", "machines", "initial", "transitions", "a"]), inner
        )
    ),
    max_leaves=12,
)


@given(st.dictionaries(st.sampled_from(["messages", "channels", "components", "interactions", "doc"]), trees))
@settings(deadline=None)
def test_wrong_kinds_everywhere_are_findings(parts: dict[str, object]) -> None:
    import json

    checked = check_text(json.dumps({"parcours": "model/1", "name": "m", **parts}))
    assert checked.model is not None or checked.findings
