"""Aldebaran's .aut: what labels mean, counts that must be met, and files of a million transitions."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from parcours.errors import BadModel, BadRequest
from parcours.model import (
    Cefsm,
    Channel,
    Component,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    findings,
    predicate,
)
from parcours.model.expression import Assignment, Literal
from parcours.model.formats import read_any
from parcours_formats import aut

SAMPLES = Path(__file__).parents[2] / "examples" / "formats"


def drawn(text: str) -> list[str]:
    transitions = aut.read(text, "x.aut").cefsm.components[0].transitions()
    return [f"{each.source} {predicate(each)} {each.target}" for each in transitions]


def test_labels_are_inputs_outputs_or_silent() -> None:
    text = 'des (0, 6, 2)\n(0, "?coin", 1)\n(1, !tea, 0)\n(1, i, 1)\n(1, tau, 1)\n(0, "PUT !3", 0)\n(0, "?", 0)\n'
    assert drawn(text) == [
        "0 (coin/-/-/-) 1",
        "1 (-/-/-/tea()) 0",
        "1 (-/-/-/-) 1",
        "1 (-/-/-/-) 1",
        "0 (PUT_3/-/-/-) 0",
        "0 (unnamed/-/-/-) 0",
    ]


def test_quotes_and_blanks_may_stand_anyhow() -> None:
    text = '  des(  1, 4\t, 3)  \n\n(0,"a \\6, (b)"  , 1)\n\t(  1 , c, 002 )\r\n(2, "say "x" !"y"", 0)\n(2,*,0)'
    found = aut.read(text, "odd.aut").cefsm
    topics = {each.topic or each.name for each in found.channels}
    assert topics == {"a \\6, (b)", "c", 'say "x" !"y"', "*"}
    assert found.components[0].machines[0].initial == "1"
    assert found.components[0].machines[0].states == ("1", "0", "2")


def test_a_model_that_was_read_has_no_errors_and_goes_back_to_the_same_system() -> None:
    text = 'des (0, 4, 3)\n(0, "?a", 1)\n(1, "!b c", 2)\n(2, i, 0)\n(2, "?a", 2)\n'
    model = aut.read(text, "m.aut").cefsm
    assert not [each for each in findings(model) if each.severity == "error"]
    assert aut.write(model).text == text
    assert [loss.what for loss in aut.write(model).losses if "channel" in loss.where] == [
        "its name is not written; its topic 'b c' is the symbol"
    ]


def test_what_has_no_label_is_a_loss() -> None:
    both = Transition(
        "p1",
        "s",
        "s",
        Receive("a"),
        Literal(True),
        (Assignment("x", Literal(1)),),
        (Send("b"), Send("c")),
        (0.0, 1.0),
        2.0,
    )
    channels = (
        Channel("a", "environment", "C", "M"),
        Channel("b", "C", "environment", "M", capacity=3),
        Channel("c", "C", "D", "M"),
    )
    machine = Machine("m", "s", ("s",), (both,), final=("s",))
    model = Cefsm("x", (Component("C", (machine,)),), channels, (MessageClass("M", ()),), doc="words")
    writing = aut.write(model)
    assert writing.text == 'des (0, 2, 2)\n(0, "?a", 1)\n(1, "!b", 0)\n'
    said = "\n".join(map(str, writing.losses))
    for each in (
        "guard",
        "action",
        "duration",
        "weight",
        "final",
        "doc",
        "'c'",
        "capacity 3",
        "class 'M'",
        "2 in a row",
        "names",
    ):
        assert each in said, each


def test_several_machines_have_no_single_system() -> None:
    machines = (Machine("m", "s", ("s",), ()), Machine("n", "s", ("s",), ()))
    with pytest.raises(BadRequest, match=r"x: \.aut holds one machine, but 'x' has 2"):
        aut.write(Cefsm("x", (Component("C", machines),)))


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "x.aut:1: must start with des"),
        ("\n(0,a,1)", "x.aut:2: must start with des"),
        ("des (0, 1)", "x.aut:1: des has three numbers"),
        ("des (-1, 1, 1)", "des has three numbers"),
        (f"des (0, {'9' * 5000}, 1)", "at most 18 digits"),
        ("des (0, 999999999999, 2)", "at most 5000000 transitions"),
        ("des (3, 0, 3)", "states are numbered from 0 to 2, but the first is 3"),
        ("des (0, 0, 0)", "but the first is 0"),
        ("des (0 1/2 1, 1, 2)\n", "probabilities are not read"),
        ("des (0, 1, 2)\n(0, a, 1 1/2 0)", "x.aut:2: must be a transition.*probabilities are not read"),
        ("des (0, 2, 2)\n(0,a,1)\n", "x.aut:1: the header promises 2 transitions, but 1 follow"),
        (
            "des (0, 1, 2)\n(0,a,1)\n\n(1,b,0)",
            r"x.aut:4: the header \(line 1\) promises 1 transitions, but here is one more",
        ),
        ("des (0, 1, 2)\n(0,a,2)", "x.aut:2: states are numbered from 0 to 1, but here is 2"),
        ("des (0, 1, 2)\n(0,a,1", "x.aut:2: must be a transition"),
        ("des (0, 1, 2)\n(0,1)", "must be a transition"),
        ("des (0, 1, 2)\n(0,\u0663,\u0661)", "states are numbered"),
        ("des (0, 1, 2)\n0,a,1)", "must be a transition"),
    ],
)
def test_what_is_no_system_is_refused_with_its_line(text: str, rule: str) -> None:
    with pytest.raises(BadModel, match=rule):
        aut.read(text, "x.aut")


def test_numbers_of_a_header_cost_nothing_and_are_not_believed() -> None:
    found = aut.read("des (0, 1, 999999999999999999)\n(0, a, 999999999999999998)", "x.aut")
    assert len(found.cefsm.components[0].machines[0].states) == 2
    assert "999999999999999997 of its 999999999999999999 states" in found.losses[0].what


def test_a_large_system_is_read_in_linear_time() -> None:
    def seconds(count: int) -> float:
        lines = (f'({at % 97}, "a{at % 7}", {at * 31 % 97})\n' for at in range(count))
        text = f"des (0, {count}, 97)\n" + "".join(lines)
        started = time.process_time()
        assert len(aut.read(text, "x.aut").cefsm.components[0].machines[0].transitions) == count
        return time.process_time() - started

    seconds(1000)
    assert seconds(100_000) < 10


def test_a_state_space_is_written_as_it_comes() -> None:
    text = "".join(aut.write_space([0, 1, 1], [1, 0, 1], ["a", "i", 'say "x"\n'], 2, 1))
    assert text == 'des (1, 3, 2)\n(0, "a", 1)\n(1, i, 0)\n(1, "say \'x\'", 1)\n'
    assert len(aut.read(text, "x.aut").cefsm.components[0].machines[0].transitions) == 3


def test_the_sample_is_an_alternating_sender() -> None:
    found = read_any(SAMPLES / "alternating_sender.aut")
    assert {(each.topic or each.name, each.sender) for each in found.cefsm.channels} == {
        ("send", "environment"),
        ("ack0", "environment"),
        ("ack1", "environment"),
        ("frame0", "alternating_sender"),
        ("frame1", "alternating_sender"),
    }
