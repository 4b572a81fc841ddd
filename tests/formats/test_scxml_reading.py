"""SCXML documents to models: the order of the standard, orthogonal regions, histories, data, events."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from parcours.errors import BadModel
from parcours.model import ENVIRONMENT, Cefsm, StepRelation, predicate
from parcours.model.formats import ForeignModel
from parcours_formats import scxml

SEEDS = Path(__file__).parents[1] / "fuzz" / "seeds"


def read(body: str, head: str = "") -> ForeignModel:
    space = 'xmlns="http://www.w3.org/2005/07/scxml" version="1.0" datamodel="ecmascript" name="chart"'
    return scxml.read(f"<scxml {space} {head}>\n{body}\n</scxml>", "chart.scxml")


class Run:
    """A model that is given events; after each it goes on by itself as far as it can."""

    def __init__(self, cefsm: Cefsm) -> None:
        self.cefsm, self.steps = cefsm, StepRelation(cefsm)
        self.transitions = {each.id: each for part in cefsm.components for each in part.transitions()}
        self.here = self.steps.layout.initial()
        self.settle()

    def settle(self) -> None:
        for _ in range(50):
            inner = [move for move in self.steps.enabled(self.here, {}) if not self.outer(move.transition)]
            if not inner:
                return
            self.here = self.steps.step(self.here, inner[0])
        raise AssertionError("it never settles")

    def outer(self, id: str) -> str:
        event = self.transitions[id].event
        if event is None or self.cefsm.channel(event.channel).sender != ENVIRONMENT:
            return ""
        return event.channel

    def send(self, *events: str) -> Run:
        for event in events:
            moves = [move for move in self.steps.enabled(self.here, {}) if self.outer(move.transition) == event]
            assert len(moves) <= 1, "a chart is deterministic"
            for move in moves:
                self.here = self.steps.step(self.here, move)
                self.settle()
        return self

    @property
    def states(self) -> str:
        return " | ".join(self.here.states)

    def value(self, name: str) -> object:
        names = [variable.name for _, variable in self.steps.layout.variables]
        return self.here.values[names.index(name)]


NESTED = """
<datamodel><data id="log" expr="0"/></datamodel>
<state id="a">
  <onentry><assign location="log" expr="log * 10 + 1"/></onentry>
  <onexit><assign location="log" expr="log * 10 + 2"/></onexit>
  <transition event="go" target="b"/>
  <transition event="both" target="b"/>
  <state id="a1">
    <onexit><assign location="log" expr="log * 10 + 3"/></onexit>
    <transition event="both" target="a2"><assign location="log" expr="log * 10 + 4"/></transition>
  </state>
  <state id="a2"><onentry><assign location="log" expr="log * 10 + 5"/></onentry></state>
</state>
<state id="b"><onentry><assign location="log" expr="log * 10 + 6"/></onentry></state>
"""


def test_inner_transitions_go_first_and_content_runs_in_the_order_of_the_standard() -> None:
    cefsm = read(NESTED).cefsm
    assert Run(cefsm).states == "a1" and Run(cefsm).value("log") == 1
    inner = Run(cefsm).send("both")
    assert (inner.states, inner.value("log")) == ("a2", 1345)
    outer = Run(cefsm).send("go")
    assert (outer.states, outer.value("log")) == ("b", 1326)
    assert Run(cefsm).send("both", "both").value("log") == 134526


def test_an_internal_transition_does_not_leave_its_state() -> None:
    chart = """<datamodel><data id="n" expr="0"/></datamodel>
      <state id="a"><onexit><assign location="n" expr="n + 1"/></onexit>
      <transition event="in" type="internal" target="a2"/><transition event="out" target="a2"/>
      <transition event="none"><assign location="n" expr="n + 10"/></transition>
      <state id="a1"/><state id="a2"/></state>"""
    cefsm = read(chart).cefsm
    assert [Run(cefsm).send(event).value("n") for event in ("in", "out", "none")] == [0, 1, 10]
    assert Run(cefsm).send("none").states == "a1"


def test_conditions_are_tried_in_order() -> None:
    cefsm = read(
        '<datamodel><data id="n" expr="0"/></datamodel>'
        '<state id="s"><transition event="e" cond="n &gt;= 2" target="t"/>'
        '<transition event="e"><assign location="n" expr="n + 1"/></transition></state><state id="t"/>'
    ).cefsm
    run = Run(cefsm)
    assert [run.send("e").states for _ in range(3)] == ["s", "s", "t"]
    assert sorted(predicate(each) for each in cefsm.components[0].transitions()) == [
        "(e/[n < 2]/n := n + 1/-)",
        "(e/[n >= 2]/-/-)",
    ]


def test_transitions_without_events_go_before_those_with() -> None:
    chart = (
        '<datamodel><data id="n" expr="1"/></datamodel><state id="s"><transition cond="n == 1" target="t"/>{}</state>'
    )
    cefsm = read(chart.format('<transition event="e" target="u"/>') + '<state id="t"/><state id="u"/>').cefsm
    [_, event] = cefsm.components[0].transitions()
    assert predicate(event) == "(e/[n != 1]/-/-)" and Run(cefsm).states == "t"


REGIONS = """<parallel id="p">
  <state id="x"><state id="x1"><transition event="a" target="x2"/></state><state id="x2"/></state>
  <state id="y"><state id="y1"><transition event="{}" target="y2"/></state><state id="y2"/></state>
</parallel>"""


def test_regions_that_share_no_event_are_machines_side_by_side() -> None:
    [component] = read(REGIONS.format("b")).cefsm.components
    assert [machine.name for machine in component.machines] == ["x", "y"]
    assert [machine.states for machine in component.machines] == [("x1", "x2"), ("y1", "y2")]


def test_regions_that_answer_the_same_event_take_it_at_once() -> None:
    cefsm = read(REGIONS.format("a")).cefsm
    [machine] = cefsm.components[0].machines
    assert machine.states == ("x1 | y1", "x2 | y2") and len(machine.transitions) == 1


def test_a_parallel_state_is_left_as_a_whole_and_ends_when_all_its_regions_do() -> None:
    chart = """<parallel id="p"><transition event="stop" target="out"/><transition event="done.state.p" target="over"/>
      <state id="x"><state id="x1"><transition event="a" target="x2"/></state><final id="x2"/></state>
      <state id="y"><state id="y1"><transition event="b" target="y2"/></state><final id="y2"/></state>
      </parallel><state id="out"/><final id="over"/>"""
    cefsm = read(chart).cefsm
    assert [Run(cefsm).send(*events).states for events in (["stop"], ["a"], ["a", "stop"], ["b", "a"])] == [
        "out",
        "x2 | y1",
        "out",
        "over",
    ]
    assert cefsm.components[0].machines[0].final == ("over",)


@pytest.mark.parametrize(("kind", "expected"), [("deep", "a22"), ("shallow", "a21")])
def test_a_history_comes_back_to_where_it_was(kind: str, expected: str) -> None:
    chart = f"""<state id="a"><history id="h" type="{kind}"><transition target="a1"/></history>
      <transition event="out" target="b"/><state id="a1"><transition event="in" target="a22"/></state>
      <state id="a2"><state id="a21"/><state id="a22"/></state></state>
      <state id="b"><transition event="back" target="h"/></state>"""
    run = Run(read(chart).cefsm)
    assert run.send("out", "back").states.startswith("a1")
    assert run.send("in", "out", "back").states.startswith(expected)


def test_choices_in_content_become_branches() -> None:
    chart = """<datamodel><data id="n" expr="0"/><data id="s" expr="'none'"/></datamodel>
      <state id="a"><transition event="e"><assign location="n" expr="n + 1"/>
        <if cond="n == 1"><assign location="s" expr="'one'"/><elseif cond="n &lt; 4"/><send event="few" target="#_out"/>
        <else/><script>s = n % 2 ? 'odd' : 'even'; n = 0</script></if></transition></state>"""
    run = Run(read(chart).cefsm)
    seen = []
    for _ in range(5):
        run.send("e")
        seen.append((run.value("n"), run.value("s")))
    assert seen == [(1, "one"), (2, "one"), (3, "one"), (0, "even"), (1, "one")]
    [few] = [each for each in run.cefsm.components[0].transitions() if each.sends]
    assert predicate(few) == "(e/[n + 1 != 1 && n + 1 < 4]/n := n + 1/few())"


def test_events_raised_inside_come_back_on_a_channel_of_its_own() -> None:
    reading = read(
        '<state id="a"><transition event="e" target="b"><raise event="r"/></transition></state>'
        '<state id="b"><transition event="r" target="c"/></state><state id="c"/>'
    )
    assert Run(reading.cefsm).send("e").states == "c"
    ends = {channel.name: (channel.sender, channel.receiver) for channel in reading.cefsm.channels}
    assert ends == {"e": (ENVIRONMENT, "chart"), "r": ("chart", "chart")}
    assert any("events from inside go before" in loss.what for loss in reading.losses)


def test_a_delay_is_a_clock() -> None:
    reading = read(
        '<state id="a"><onentry><send event="late" delay="1.5s"/></onentry>'
        '<transition event="late" target="b"/></state>'
        '<state id="b"/>'
    )
    start, late = reading.cefsm.components[0].transitions()
    assert predicate(start) == "(-/-/since_late := 0/late())" and predicate(late) == "(late/[since_late >= 1.5]/-/-)"
    assert [(each.name, each.type) for each in reading.cefsm.components[0].variables] == [("since_late", "clock")]


def test_descriptors_match_by_their_parts() -> None:
    chart = """<state id="a"><transition event="error.*" target="b"/><transition event="x y" target="c"/></state>
      <state id="b"><transition event="error.io" target="a"/></state>
      <state id="c"><transition event="*" target="a"/></state>"""
    cefsm = read(chart).cefsm
    said = sorted(
        (each.source, each.event.channel, each.target) for each in cefsm.components[0].transitions() if each.event
    )
    assert said == [
        ("a", "error", "b"), ("a", "error_io", "b"), ("a", "x", "c"), ("a", "y", "c"), ("b", "error_io", "a"),
        ("c", "error", "a"), ("c", "error_io", "a"), ("c", "x", "a"), ("c", "y", "a"),
    ]  # fmt: skip
    assert cefsm.channel("error_io").topic == "error.io"


@pytest.mark.parametrize(
    ("body", "named"),
    [
        ('<state id="a"><transition target="gone"/></state>', "'gone' is not one"),
        ('<state id="a"/><state id="a"/>', "'a' was used before"),
        ("", "a document must have a state"),
        ('<state id="a"><history id="h"/><state id="b"/></state>', "history 'h' must have one transition"),
        ('<state id="a"><onentry><foreach array="x" item="y"/></onentry></state>', "the loop 'foreach'"),
        ('<state id="a"><transition cond="f()" target="a"/></state>', "a call of the function 'f'"),
        ('<state id="a"><transition cond="n > 1" target="a"/></state>', "'n' is not"),
        ('<state id="a"><transition event="e" cond="_event.data.n > 1" target="a"/></state>', "a field 'n'"),
        ('<state id="a"><onentry><script src="x.js"/></onentry></state>', "a script in another file"),
        ('<datamodel><data id="d" expr="null + 1"/></datamodel><state id="a"><transition cond="d" target="a"/></state>',
         "'d' cannot be used"),
        ('<datamodel><data id="d"/></datamodel><state id="a"><transition cond="d" target="a"/></state>',
         "'d' without a value"),
    ],
)  # fmt: skip
def test_what_cannot_be_said_is_refused_by_name_and_line(body: str, named: str) -> None:
    with pytest.raises(BadModel) as caught:
        read(body)
    assert named in str(caught.value) and re.match(r"chart\.scxml:[0-9]+", str(caught.value))


def test_data_that_nothing_uses_are_a_loss_not_an_error() -> None:
    reading = read('<datamodel><data id="d" expr="new Date()"/><data id="e"><x/></data></datamodel><state id="a"/>')
    assert reading.cefsm.components[0].variables == ()
    assert [loss.where for loss in reading.losses] == ["data 'd'", "data 'e'"]


@pytest.mark.parametrize(
    "body",
    [
        '<state id="s">' + "<state>" * 5000,
        '<datamodel><data id="x" expr="0"/></datamodel><state id="s"><transition event="e">'
        + '<if cond="x &gt; 0"><assign location="x" expr="x + 1"/></if>' * 40 + "</transition></state>",
    ],
)  # fmt: skip
def test_what_would_grow_without_bound_is_refused_at_once(body: str) -> None:
    began = time.process_time()
    with pytest.raises(BadModel):
        read(body)
    assert time.process_time() - began < 3


def test_regions_of_too_many_configurations_are_machines_and_that_is_a_loss() -> None:
    states = (
        '<state id="r{0}"><state id="a{0}"><transition event="e{0} e" target="b{0}"/></state><state id="b{0}"/></state>'
    )
    reading = read('<parallel id="p">' + "".join(states.format(number) for number in range(12)) + "</parallel>")
    assert len(reading.cefsm.components[0].machines) == 12
    assert any("regions that answer e take it at once there" in loss.what for loss in reading.losses)


def test_the_document_knows_its_name() -> None:
    document = """<state id="a"><transition cond="_name === 'chart'" target="pass"/><transition target="fail"/></state>
    <state id="pass"/><state id="fail"/>"""
    assert Run(read(document).cefsm).states == "pass"


STRAY = """<datamodel><data id="n" expr="1"/></datamodel>
<state id="a"><onentry><send event="lost" target="baz"/><assign location="n" expr="2"/></onentry>
  <onentry><assign location="n" expr="n + 10"/></onentry>
  <transition event="EVENT" target="b"/></state>
<state id="b"/>"""


def test_an_event_sent_to_nowhere_ends_its_block_with_an_error() -> None:
    answered = Run(read(STRAY.replace("EVENT", "error.*")).cefsm)
    assert answered.states == "b" and answered.value("n") == 11
    ignored = read(STRAY.replace("EVENT", "go"))
    assert Run(ignored.cefsm).states == "a" and Run(ignored.cefsm).value("n") == 11
    assert [str(each) for each in ignored.losses] == [
        "line 3: <send>: its target is invalid: error.execution is raised, and the rest of its block is not done"
    ]


DONE = """<state id="s"><onentry><raise event="first"/></onentry><final id="f"><donedata><param name="x" location=""/>
</donedata></final><transition event="done.state.s" target="t"/><transition event="first" target="u"/></state>
<state id="t"/><state id="u"/>"""


def test_where_the_end_of_a_state_goes_before_other_events_that_is_a_loss() -> None:
    said = [str(each) for each in read(DONE).losses if each.alters]
    assert [each.partition(":")[0] for each in said] == ["line 1", "line 2", "line 3"]
    assert "donedata" in said[1] and "the end of a state is an event in the queue" in said[2]
    plain = read(re.sub("<raise.*?>|<donedata>.*?</donedata>", "", DONE, flags=re.DOTALL))
    assert not any(each.alters for each in plain.losses)
