"""Diagrams: what PlantUML and Mermaid are given says every state and transition, whatever their names are."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.model import Cefsm, Channel, Component, Machine, MessageClass, Transition, Variable, predicate
from parcours.model.expression import Literal, Name, parse_actions, parse_expression
from parcours_formats.diagrams import mermaid, plantuml

HOSTILE = [
    '"',
    '" as x',
    "}",
    "{",
    "--",
    "-->",
    ": b",
    ";",
    "#35;",
    "%%",
    "<b>",
    "<U+0022>",
    "[*]",
    "[[",
    "\\n",
    "**",
    "~",
    "&#34;",
]
labels = st.sampled_from(HOSTILE) | st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=6)


@st.composite
def models(draw: st.DrawFn) -> Cefsm:
    ids = (f"{draw(labels)}{number}" for number in range(100))
    components = []
    for owner in draw(st.lists(st.sampled_from("ABC"), min_size=1, max_size=3, unique=True)):
        machines = []
        for number in range(draw(st.integers(1, 2))):
            states = draw(st.lists(labels, min_size=1, max_size=3, unique=True))
            transitions = tuple(
                Transition(
                    next(ids), draw(st.sampled_from(states)), draw(st.sampled_from(states)), None, Literal(draw(labels))
                )
                for _ in range(draw(st.integers(0, 3)))
            )
            final = tuple(state for state in states if draw(st.booleans()))
            machines.append(Machine(f"m{number}", draw(st.sampled_from(states)), tuple(states), transitions, final))
        components.append(Component(owner, tuple(machines)))
    return Cefsm(draw(labels), tuple(components))


def of_plantuml(text: str) -> str:
    return re.sub(r"<U\+([0-9A-F]{4})>", lambda match: chr(int(match[1], 16)), text)


def of_mermaid(text: str) -> str:
    return re.sub(r"#([0-9]+);", lambda match: chr(int(match[1])), text)


def checked(lines: list[str], plain: Callable[[str], str]) -> list[object]:
    """What a diagram says, read line by line as the tools do: components of regions of states and arrows."""
    found: list[object] = []
    names: dict[str, str] = {}
    for line in map(str.strip, lines):
        if match := re.fullmatch(r'state "([^"]*)" as (\w+) \{', line):
            found.append(("component", plain(match[1])))
        elif match := re.fullmatch(r'state "([^"]*)" as (\w+)', line):
            assert match[2] not in names
            names[match[2]] = plain(match[1])
            found.append(("state", names[match[2]]))
        elif match := re.fullmatch(r"\[\*\] --> (\w+)", line):
            found.append(("initial", names[match[1]]))
        elif match := re.fullmatch(r"(\w+) --> \[\*\]", line):
            found.append(("final", names[match[1]]))
        elif match := re.fullmatch(r"(\w+) --> (\w+) : (.*)", line):
            found.append((names[match[1]], names[match[2]], plain(match[3])))
        else:
            assert line in ("--", "}"), line
            found.append(line)
    return found


def expected(model: Cefsm) -> list[object]:
    found: list[object] = []
    for component in model.components:
        found.append(("component", component.name))
        for number, machine in enumerate(component.machines):
            found += ["--"] if number else []
            found += [("state", state) for state in machine.states]
            found.append(("initial", machine.initial))
            found += [(each.source, each.target, f"{each.id} {predicate(each)}") for each in machine.transitions]
            found += [("final", state) for state in machine.final]
        found.append("}")
    return found


@given(models())
@settings(max_examples=60)
def test_plantuml_says_what_the_model_says(model: Cefsm) -> None:
    lines = plantuml.write(model).text.splitlines()
    assert (lines[0], lines[-1]) == ("@startuml", "@enduml")
    assert of_plantuml(lines[1]) == f"title {model.name}"
    assert checked(lines[2:-1], of_plantuml) == expected(model)
    assert not any(re.search(r"\*\*|__|\[\[|~|\\|--(?!>)|//", line) for line in lines[2:-1] if line.strip() != "--")


@given(models())
@settings(max_examples=60)
def test_mermaid_says_what_the_model_says(model: Cefsm) -> None:
    head, *lines = mermaid.write(model).text.splitlines()
    assert head == "stateDiagram-v2"
    assert checked(lines, of_mermaid) == expected(model)
    plain = [re.sub(r"#[0-9]+;", "", line) for line in lines]
    assert not any(re.search(r"[;#%<&\\]|:.*:", line) for line in plain)


@pytest.mark.parametrize("format", [plantuml, mermaid])
def test_what_is_not_drawn_is_a_loss(format: object) -> None:
    timed = Transition("p", "a", "a", None, Name("ready"), parse_actions("n := 1"), (), (0.0, 1.0), 3.0)
    machine = Machine("m", "a", ("a",), (timed,), invariants=(("a", parse_expression("n < 2")),))
    channels = (Channel("c", "environment", "C", "M"),)
    component = Component("C", (machine,), (Variable("n", "int", 0),), "the title")
    model = Cefsm("x", (component,), channels, (MessageClass("M", ()),), doc="words")
    writing = (plantuml if format is plantuml else mermaid).write(model)
    said = "\n".join(map(str, writing.losses))
    for each in ("'C.n'", "duration", "weight", "invariant", "the title", "channel 'c'", "machines 'm'", "doc"):
        assert each in said, each
    assert "guard" not in said
    assert "ready" in writing.text
