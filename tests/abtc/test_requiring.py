"""No tests is an error: a model without abstract cases says why, and the line it asks for gives some."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.abtc import abstract_cases, require_cases
from parcours.cli.abtc import command
from parcours.errors import BadModel
from parcours.model import parse_model

HEAD = """
parcours: model/1
name: line
messages: {Note: {fields: {n: {type: int}}}}
"""
ONE_WAY = """
channels: {reading: {from: Sensor, to: Filter, message: Note}, order: {from: Filter, to: Motor, message: Note}}
components:
  Sensor: {machines: {m: {initial: s, transitions: {sense: {from: s, to: s, message: reading(1)}}}}}
  Filter: {machines: {m: {initial: s, transitions: {take: {from: s, to: t, event: reading(x)},
                                                    pass: {from: t, to: s, message: order(2)}}}}}
  Motor: {machines: {m: {initial: s, transitions: {move: {from: s, to: s, event: order}}}}}
"""
UNANSWERED = """
channels: {ask: {from: A, to: B, message: Note}, reply: {from: B, to: A, message: Note}}
components:
  A: {machines: {m: {initial: s, transitions: {a1: {from: s, to: s, message: ask(1)}}}}}
  B: {machines: {m: {initial: s, transitions: {b1: {from: s, to: s, event: ask}}}}}
"""
DEAF = """
channels: {ask: {from: A, to: B, message: Note}}
components:
  A: {machines: {m: {initial: s, transitions: {a1: {from: s, to: s, message: ask(1)}}}}}
  B: {machines: {m: {initial: s, transitions: {b1: {from: s, to: s}}}}}
"""
MUTE = """
channels: {ask: {from: A, to: B, message: Note}}
components:
  A: {machines: {m: {initial: s, transitions: {a1: {from: s, to: s}}}}}
  B: {machines: {m: {initial: s, transitions: {b1: {from: s, to: s, event: ask}}}}}
"""


@pytest.mark.parametrize(
    ("body", "why", "remedy"),
    [
        (
            ONE_WAY,
            "no interaction closes: sense of Sensor sends reading, pass of Filter sends order, and Filter never answers"
            " Sensor, Motor never answers Filter",
            "add to the model file: interactions: {ITP1: [Sensor, Filter, Motor]}",
        ),
        (UNANSWERED, "B -> A: tp21 and tp11 have no rendezvous", "interactions: {ITP2: [A, B]}"),
        (DEAF, "a1 of A sends ask", "give B a transition with 'event: ask', and add"),
        (MUTE, "no transition sends to another component", "let a transition of one component send"),
    ],
)
def test_a_model_without_cases_says_why_and_what_to_do(body: str, why: str, remedy: str) -> None:
    with pytest.raises(BadModel) as caught:
        require_cases(parse_model(HEAD + body))
    assert caught.value.slug == "no-abstract-cases"
    assert why in caught.value.rule and remedy in caught.value.remedy


@pytest.mark.parametrize("body", [ONE_WAY, UNANSWERED])
def test_the_line_that_is_asked_for_gives_cases(body: str) -> None:
    with pytest.raises(BadModel) as caught:
        require_cases(parse_model(HEAD + body))
    line = caught.value.remedy.removeprefix("add to the model file: ")
    model = parse_model(f"{HEAD}{body}{line}\n")
    require_cases(model)
    assert list(abstract_cases(model))


def test_a_misspelt_state_is_named_before_the_model_is_said_to_lack_an_interaction() -> None:
    body = """
channels: {ask: {from: A, to: B, message: Note}, answer: {from: B, to: A, message: Note}}
components:
  A:
    machines:
      m:
        initial: s
        transitions: {a1: {from: s, to: wiat, message: ask}, a2: {from: wait, to: s, event: answer}}
  B: {machines: {m: {initial: s, transitions: {b1: {from: s, to: s, event: ask, message: answer}}}}}
"""
    with pytest.raises(BadModel) as caught:
        require_cases(parse_model(HEAD + body))
    assert caught.value.remedy.startswith("first see to what `parcours model check` says: ")
    assert "'wiat' of 'm' in 'A' does not" in caught.value.remedy and "no path leads to 'wait'" in caught.value.remedy


def test_an_entry_is_added_to_those_that_are_there() -> None:
    body = UNANSWERED + "interactions: {ITP1: [B, A]}\n"
    with pytest.raises(BadModel) as caught:
        require_cases(parse_model(HEAD + body))
    assert caught.value.remedy == "add under 'interactions' of the model file: ITP3: [A, B]"


@pytest.mark.parametrize("options", [[], ["--json"], ["--count"], ["--policies"], ["--dropped"],
                                     ["--sequences", "count"]])  # fmt: skip
def test_the_command_refuses_a_model_without_cases(tmp_path: Path, options: list[str]) -> None:
    file = tmp_path / "line.yaml"
    file.write_text(HEAD + ONE_WAY)
    done = CliRunner().invoke(command, [str(file), *options])
    assert isinstance(done.exception, BadModel) and done.exception.slug == "no-abstract-cases"
    assert str(file) in str(done.exception) and not done.output
