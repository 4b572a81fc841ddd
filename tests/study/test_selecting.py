"""Abstract cases whose guards contradict each other are left out, and short runs take their place."""

from __future__ import annotations

import pytest

from parcours.errors import BadModel
from parcours.model import parse_model
from parcours.model.structure import Cefsm
from parcours.study.components.messages import ModelMessages
from parcours.study.components.selecting import Selection, select_cases, short_runs
from parcours.study.components.stimuli import Chooser

ALTERNATING_BIT = """
parcours: model/1
name: abp
messages:
  Payload: {fields: {value: {type: int}}}
  Frame: {fields: {bit: {type: bool}, value: {type: int}}}
  Ack: {fields: {bit: {type: bool}}}
channels:
  put: {from: environment, to: Sender, message: Payload}
  data: {from: Sender, to: Receiver, message: Frame}
  ack: {from: Receiver, to: Sender, message: Ack}
  get: {from: Receiver, to: environment, message: Payload}
components:
  Sender:
    variables: {bit: {type: bool, initial: false}, value: {type: int, initial: 0}}
    machines:
      send:
        initial: ready
        transitions:
          s1: {from: ready, to: waiting, event: put(it), action: value := it.value, message: "data(bit, it.value)"}
          s2: {from: waiting, to: ready, event: ack(it), guard: it.bit == bit, action: bit := !bit}
          s3: {from: waiting, to: waiting, event: ack(it), guard: it.bit != bit}
          s4: {from: waiting, to: waiting, message: "data(bit, value)"}
  Receiver:
    variables: {expected: {type: bool, initial: false}}
    machines:
      receive:
        initial: idle
        transitions:
          r1: {from: idle, to: got, event: data(it), guard: it.bit == expected, action: expected := !expected,
               message: get(it.value)}
          r2: {from: got, to: idle, message: ack(!expected)}
          r3: {from: idle, to: idle, event: data(it), guard: it.bit != expected, message: ack(it.bit)}
"""


def selected(text: str, criterion: str = "edge") -> tuple[Cefsm, Selection]:
    model = parse_model(text, "m.yaml")
    return model, select_cases(model, criterion, "", Chooser(model, ModelMessages(model), {}, {}, {}))


def test_tours_that_no_values_allow_are_replaced_by_short_runs_that_take_all_they_would() -> None:
    model, found = selected(ALTERNATING_BIT)
    assert found.infeasible and not set(found.infeasible) & set(found.cases)
    taken = {
        each.id for case in found.cases.values() for _, path in case.combination.references for each in path.transitions
    }
    assert taken == {each.id for component in model.components for each in component.transitions()}


def test_every_case_that_is_kept_has_values_under_which_its_guards_hold() -> None:
    from parcours.abtc import serialise

    model, found = selected(ALTERNATING_BIT)
    chooser = Chooser(model, ModelMessages(model), {}, {}, {})
    assert all(not chooser.stimuli(serialise(case), {}).infeasible for case in found.cases.values())


def test_what_is_left_out_says_which_guard_cannot_hold() -> None:
    _, found = selected(ALTERNATING_BIT)
    assert all("cannot hold" in why and "[it.bit" in why for why in found.infeasible.values())


def test_a_model_whose_guards_never_hold_is_refused_with_the_guard() -> None:
    never = ALTERNATING_BIT.replace("guard: it.bit == expected,", "guard: it.bit && !it.bit,").replace(
        "guard: it.bit != expected,", "guard: it.bit && !it.bit,"
    )
    with pytest.raises(BadModel, match=r"it\.bit && !it\.bit.*\[no-feasible-cases\]"):
        selected(never)


def test_a_model_without_guards_keeps_its_tours() -> None:
    import re

    _, found = selected(re.sub(r", guard: [^,}]+", "", ALTERNATING_BIT))
    assert not found.infeasible and all("x" not in id.split("-")[1] for id in found.cases)


def test_short_runs_begin_in_the_initial_state_and_end_where_a_test_may_end() -> None:
    machine = parse_model(ALTERNATING_BIT, "m.yaml").components[0].machines[0]
    runs = short_runs(machine)
    assert all(run[0].source == run[-1].target == "ready" for run in runs)
    assert [len(run) for run in runs] == sorted(len(run) for run in runs)


def test_a_criterion_whose_paths_never_meet_is_refused_and_one_whose_paths_do_is_named() -> None:
    gives_up = ALTERNATING_BIT.replace("          s4: {", "          s5: {from: waiting, to: ready}\n          s4: {")
    with pytest.raises(BadModel) as caught:
        selected(gives_up, "specified:s1 s4 s4 s5, r1 r2")
    assert caught.value.slug == "no-abstract-cases" and "tp21 and tp11 have no rendezvous" in caught.value.rule
    assert caught.value.remedy == "choose a criterion whose paths meet; those of `edge` do"
