"""Every kind of finding has a model that shows it and a neighbour, one change away, that does not."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import pytest

from parcours.errors import BadModel
from parcours.model import (
    Cefsm,
    Component,
    Machine,
    Transition,
    Variable,
    check_file,
    check_text,
    findings,
    parse_model,
    to_text,
    write_model,
)
from parcours_formats.losses import ASPECTS, unsaid

SOUND = """\
parcours: model/1
name: pair
messages:
  Order: {fields: {amount: {type: int}, urgent: {type: bool}, notes: {type: Note, shape: [n]}}}
  Note: {fields: {words: {type: text}}}
channels:
  order: {from: Client, to: Server, message: Order}
  reply: {from: Server, to: Client, message: Note}
  alarm: {from: environment, to: Server, message: Note}
  meet: {from: Client, to: Server, message: Note, capacity: 0}
components:
  Client:
    variables:
      count: {type: int, initial: 0, range: [0, 3]}
      mode: {type: enum, values: [calm, busy], initial: calm}
      level: {type: real, initial: 0.5}
      ready: {type: bool, role: input}
      last: {type: Note}
    machines:
      ask:
        initial: idle
        transitions:
          c1: {from: idle, to: waiting, guard: ready, message: "order(count, true, last)",
               action: count := 1; mode := 'busy'}
          c2: {from: waiting, to: done, event: reply(note), action: last := note; log(note.words)}
          c3: {from: done, to: idle, message: meet}
  Server:
    variables:
      load: {type: int, initial: 0}
      note: {type: Note}
    machines:
      serve:
        initial: open
        transitions:
          s1: {from: open, to: working, event: order(job), guard: "job.amount > 0"}
          s2: {from: working, to: open, event: alarm}
          s3: {from: working, to: open, message: reply(note), guard: load < 3}
          s4: {from: open, to: open, event: meet}
interactions:
  round: [Client, Server, Client]
"""


ALARM = "\n          s5: {from: working, to: open, event: alarm}"


def _rules(text: str) -> dict[str, str]:
    return {finding.rule: str(finding) for finding in check_text(text, "pair.yaml").findings}


def test_the_sound_model_has_no_findings() -> None:
    assert check_text(SOUND).findings == ()


COMPONENTS = SOUND[SOUND.index("components:") :]
SERVER = SOUND[SOUND.index("  Server:\n") : SOUND.index("interactions")]
CASES = [
    # rule, severity, what stands in the sound model, what replaces it, what the message must say
    ("format", "error", "model/1", "model/2", "reads model/1 only"),
    ("missing-key", "error", "name: pair", "doc: pair", "'name'"),
    ("unknown-key", "error", "interactions:", "interaction:", "did you mean 'interactions'"),
    ("duplicate-key", "error", "s4:", "s3:", "'s3' stands in line 37 already"),
    ("duplicate", "error", "s4:", "c3:", "'c3' was used before (line 26)"),
    ("kind", "error", "[Client, Server, Client]", "Client", "must be a list"),
    ("name", "error", "Client", "2nd", "letters, digits and _"),
    ("name", "error", "Client", "environment", "is the tester"),
    ("value", "error", "capacity: 0", "capacity: -1", "0 to 1000"),
    ("value", "error", "role: input", "role: inptu", "local or input"),
    ("value", "error", "range: [0, 3]", "range: [3, 0]", "[lowest, highest]"),
    ("value", "error", "values: [calm, busy]", "values: [calm, calm]", "different"),
    ("value", "error", "type: real, initial", "type: real, range: [0, 1], initial", "belongs to int"),
    ("initial", "error", "initial: 0.5", "initial: high", "must be of type real"),
    ("initial", "error", "initial: 0, range", "range", "has none"),
    ("initial", "error", "initial: 0, range", "initial: 4, range", "from 0 to 3"),
    ("initial", "error", "initial: calm", "initial: clam", "'clam'"),
    ("initial", "error", "last: {type: Note}", "last: {type: Note, initial: 1}", "'Client.last' is of type 'Note'"),
    ("event", "error", "event: alarm", "event: alarm; alarm", "one message a transition"),
    ("syntax", "error", "guard: ready", "guard: ready ready", '"ready ^ready"'),
    ("no-component", "error", COMPONENTS, "components: {}", "must have a component"),
    ("no-machine", "error", SERVER, "  Server: {machines: {}}\n", "'Server'"),
    ("unknown-message", "error", "message: Order", "message: Oder", "did you mean 'Order'"),
    ("unknown-message", "error", "type: text", "type: txet", "did you mean 'text'"),
    ("unknown-message", "error", "last: {type: Note}", "last: {type: Knote}", "did you mean 'Note'"),
    (
        "unknown-component",
        "error",
        "{from: Client, to: Server, message: Order}",
        "{from: Cleint, to: Server, message: Order}",
        "'Client'",
    ),
    ("unknown-component", "error", "[Client, Server, Client]", "[Client, Sever, Client]", "did you mean 'Server'"),
    ("unknown-channel", "error", "event: alarm", "event: alram", "did you mean 'alarm'"),
    (
        "unknown-state",
        "error",
        "initial: open\n",
        "states: [open, working]\n        initial: opne\n",
        "did you mean 'open'",
    ),
    ("unknown-name", "error", "guard: ready", "guard: raedy", "did you mean 'ready'"),
    ("unknown-name", "error", "count := 1", "cuont := 1", "did you mean 'count'"),
    ("unknown-field", "error", "job.amount", "job.amuont", "did you mean 'amount'"),
    ("unknown-function", "error", "guard: load < 3", "guard: sprt(load) < 3", "did you mean 'sqrt'"),
    ("type", "error", "guard: load < 3", "guard: load", "a guard must be bool"),
    ("type", "error", "guard: load < 3", "guard: load && true", "&& works on bool"),
    ("type", "error", "count := 1", "count := 0.5", "'count' is int"),
    ("type", "error", "log(note.words)", "log(note.words + 1)", "+ works on number"),
    ("enum-value", "error", "guard: ready", "guard: \"mode == 'bsuy'\"", "did you mean 'busy'"),
    ("assigned-input", "error", "count := 1", "ready := true", "set by the environment"),
    (
        "shadowed-name",
        "error",
        'order(job), guard: "job.amount',
        'order(load), guard: "load.amount',
        "'load' is a variable",
    ),
    ("direction", "error", "message: meet", "message: alarm(last)", "belongs to 'environment'"),
    ("direction", "error", "event: alarm", "event: reply", "belongs to 'Client'"),
    ("channel-ends", "error", "from: environment, to: Server", "from: environment, to: environment", "both its ends"),
    ("message-cycle", "error", "words: {type: text}", "words: {type: Order}, again: {type: Note}", "contains itself"),
    (
        "rendezvous",
        "error",
        "to: Server, message: Note, capacity: 0",
        "to: Client, message: Note, capacity: 0",
        "both ends at one",
    ),
    ("rendezvous", "error", "message: meet", "message: meet; meet", "has rendezvous on meet and meet"),
    ("interaction", "error", "[Client, Server, Client]", "[Client, Client]", "none leads from 'Client' to 'Client'"),
    ("interaction", "error", "[Client, Server, Client]", "[Client]", "two components"),
    ("unread-channel", "warning", ", event: meet}", "}", "no event of 'Server' receives 'meet'"),
    ("unwritten-channel", "warning", "idle, message: meet}", "idle}", "'Client' never sends 'meet'"),
    (
        "unreachable-state",
        "warning",
        "initial: open\n",
        "states: [open, working, lost]\n        initial: open\n",
        "'lost'",
    ),
    ("dead-transition", "warning", "guard: ready", "guard: ready && !ready", "never does"),
    ("dead-transition", "warning", "guard: load < 3", "guard: load < 3 && load > 2", "never does"),
    ("dead-transition", "warning", "c3: {from: done", "c3: {from: never", "'never', never reached"),
    ("no-way-back", "warning", "c3: {from: done, to: idle", "c3: {from: idle, to: idle", "'done' of 'ask'"),
    ("nondeterminism", "warning", "open, event: alarm}", "open, guard: load > 1}", "for example when load = 2"),
    (
        "nondeterminism",
        "warning",
        "s4: {from: open, to: open, event: meet}",
        "s4: {from: open, to: open, event: order(it), guard: it.amount < 2}",
        "job.amount = 1",
    ),
    (
        "endless-loop",
        "warning",
        "event: meet}",
        "message: reply(note)}",
        "'s4' can repeat in 'open' without end, beside s1",
    ),
    ("undecided-guard", "warning", "guard: load < 3", "guard: load * load * load == 343", "could not decide"),
    ("unknown-transition", "error", "initial: idle\n", "initial: idle\n        exclusive: [[c1, c9]]\n", "'c9'"),
    (
        "exclusive",
        "error",
        "initial: idle\n",
        "initial: idle\n        exclusive: [[c1, c2]]\n",
        "leave idle and waiting",
    ),
    ("exclusive", "error", "initial: idle\n", "initial: idle\n        exclusive: [[c1]]\n", "c1 are 1"),
    (
        "undecided-choice",
        "warning",
        "open, event: alarm}",
        "open, guard: load * load == 49 && load != 7}",
        "could not decide",
    ),
]


@pytest.mark.parametrize(("rule", "severity", "old", "new", "said"), CASES)
def test_one_change_brings_one_finding(rule: str, severity: str, old: str, new: str, said: str) -> None:
    assert old in SOUND
    text = SOUND.replace(old, new) if old == "Client" else SOUND.replace(old, new, 1)
    found = _rules(text)
    matching = [str(each) for each in check_text(text, "pair.yaml").findings if each.rule == rule]
    assert any(said in each for each in matching), found
    assert all(f": {severity}: " in each for each in matching)
    assert (check_text(text).model is None) == (
        severity == "error" or any(": error: " in each for each in found.values())
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("event: order(it), guard: it.amount <= 0", ""),
        ("event: order(it), guard: it.amount < 2", "error: 's1' and 's4' of 'serve' must exclude each other, but their"
         " guards hold together: when job.amount = 1;"),
        ("event: order", "hold together: when job.amount = 1;"),
        ("event: alarm(job), guard: \"job.words == 'x'\"", "hold together: when job of s4.words = 'x', job.am"),
        ("event: order, guard: load * load == 49 && load != 7", "warning: could not decide whether 's1' and 's4'"),
    ],
)  # fmt: skip
def test_transitions_that_exclude_each_other_are_proved_to(change: str, said: str) -> None:
    text = SOUND.replace("initial: open\n", "initial: open\n        exclusive: [[s1, s4]]\n")
    text = text.replace("s4: {from: open, to: open, event: meet}", f"s4: {{from: open, to: open, {change}}}")
    found = [str(one) for one in check_text(text, "pair.yaml").findings if "exclusi" in one.rule]
    assert len(found) == bool(said) and all(said in one for one in found)


def test_the_model_is_written_with_what_it_excludes() -> None:
    text = SOUND.replace("initial: open\n", "initial: open\n        exclusive: [[s2, s3]]\n").replace(
        "event: alarm}", "event: alarm, guard: load >= 3}"
    )
    model = parse_model(text)
    assert parse_model(write_model(model)) == model
    assert "exclusive: s2, s3" in to_text(model)
    assert "that s2 and s3 exclude each other is not written" in "".join(map(str, unsaid(model, ASPECTS)))


def test_a_finding_names_the_line() -> None:
    [finding] = check_text(SOUND.replace("guard: ready", "guard: raedy"), "pair.yaml").findings
    assert finding.where == f"pair.yaml:{SOUND[: SOUND.index('c1:')].count(chr(10)) + 1}"


def test_all_errors_come_at_once_and_reading_raises_with_all_of_them() -> None:
    broken = SOUND.replace("guard: ready", "guard: raedy").replace("alarm}", "alram}").replace("load < 3", "load")
    with pytest.raises(BadModel) as caught:
        parse_model(broken, "pair.yaml")
    lines = str(caught.value).splitlines()
    assert [line.split("[")[-1] for line in lines[1:4]] == ["unknown-name]", "unknown-channel]", "type]"]
    assert caught.value.slug == "model-errors"


def test_disjoint_real_guards_are_proved_apart() -> None:
    apart = SOUND.replace("open, event: alarm}", "open, guard: load >= 3 && load < 9}" + ALARM)
    assert check_text(apart).findings == ()


def test_the_witness_of_a_choice_satisfies_both_guards() -> None:
    both = SOUND.replace("open, event: alarm}", "open, guard: load > -5 && load != 0 && load < 1}" + ALARM)
    [finding] = check_text(both).findings
    assert finding.rule == "nondeterminism"
    assert -5 < int(finding.message.rpartition("load = ")[2]) < 0


def test_a_model_made_by_hand_is_checked_like_one_from_a_file() -> None:
    machine = Machine("m", "a", ("a", "a", "b c"), (Transition("t", "a", "z"), Transition("t", "a", "a")))
    wrong = Cefsm("by hand", (Component("A b", (machine,), (Variable("x", "bool", 1),)),))
    assert {finding.rule for finding in findings(wrong)} >= {"name", "duplicate", "unknown-state", "initial"}


def test_many_rivals_in_one_state_are_not_compared_for_ever() -> None:
    loops = tuple(Transition(f"t{at}", "a", "a") for at in range(3000))
    crowded = Cefsm("crowd", (Component("A", (Machine("m", "a", ("a",), loops),)),))
    found = findings(crowded)
    assert [each.rule for each in found].count("undecided-choice") == 1
    assert len(found) <= 501


def test_the_paper_s_own_gaps_are_warnings_and_no_others_show() -> None:
    checked = check_file(str(files("parcours_ramp") / "components" / "model.yaml"))
    assert checked.model is not None
    said = sorted(
        (finding.rule, *(name for name in _NAMED if repr(name) in finding.message)) for finding in checked.findings
    )
    assert said == [
        ("nondeterminism", "p11", "p12"),
        ("nondeterminism", "p41", "p44"),
        ("nondeterminism", "p43", "p46"),
        ("nondeterminism", "p63", "p64"),
        ("unread-channel", "modification_response"),
        ("unread-channel", "update"),
    ]


_NAMED = ["modification_response", "update", "p11", "p12", "p41", "p43", "p44", "p46", "p63", "p64"]


def test_the_obstacles_have_no_findings() -> None:
    assert check_file(str(files("parcours_navigation") / "cases" / "model.yaml")).findings == ()


def test_lines_do_not_matter_for_equality() -> None:
    machine = parse_model(SOUND).components[0].machines[0]
    assert replace(machine, line=machine.line + 7) == machine
