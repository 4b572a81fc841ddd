"""Blocks of test data count where they change what a component receives, not where they are drawn."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.data import Domain, InputModel, split
from parcours.data.inputs import constraint_of
from parcours.errors import BadRequest
from parcours.model.expression import parse_expression
from parcours.model.model_file import parse_model
from parcours.study import took
from parcours.study.components.battery import check_study
from parcours.study.components.landing import Landing, glance, landing_of
from parcours.study.components.study import NO_INPUTS, ComponentStudy
from parcours.study.components.systems import python_system
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request

LIFT = Path(__file__).parents[2] / "examples" / "lift"

MODEL = """
parcours: model/1
name: house
messages:
  Word: {fields: {word: {type: int}}}
  Sound: {fields: {loud: {type: bool}}}
channels:
  turn: {from: environment, to: Key, message: Word}
  push: {from: Key, to: Bolt, message: Word}
  done: {from: Bolt, to: Key, message: Sound}
  ring: {from: Key, to: Bell, message: Sound}
  rang: {from: Bell, to: Key, message: Sound}
components:
  Key:
    machines:
      hand:
        initial: free
        transitions:
          k1: {from: free, to: busy, event: turn(it), message: push(it)}
          k2: {from: busy, to: free, event: done(it)}
      bell:
        initial: quiet
        transitions:
          k3: {from: quiet, to: loud, message: ring(true)}
          k4: {from: loud, to: quiet, event: rang(it)}
  Bolt:
    machines:
      slide: {initial: open, transitions: {b1: {from: open, to: open, event: push(it), message: done(true)}}}
  Bell:
    machines:
      clapper: {initial: up, transitions: {r1: {from: up, to: up, event: ring(it), message: rang(it)}}}
"""


class Key:
    def turn(self, message: object) -> object:
        return took("k1", push=message)

    def done(self, message: object) -> object:
        return took("k2")

    def k3(self) -> object:
        return took("k3", ring={"loud": True})

    def rang(self, message: object) -> object:
        return took("k4")


class Bolt:
    def push(self, message: object) -> object:
        return took("b1", done={"loud": True})


class Bell:
    def ring(self, message: object) -> object:
        return took("r1", rang={"loud": True})


WORD = split("word", "1", [1, 3, 6, 9], kind="integer")
SPARE = split("spare", "m", [0.0, 1.0, 2.0])


def study(*domains: Domain, formula: str = "", rule: str = "") -> ComponentStudy:
    rules = (constraint_of("rule", parse_expression(rule), domains),) if rule else ()
    return ComponentStudy(
        "house", parse_model(MODEL, "house.yaml"), python_system(Key=Key, Bolt=Bolt, Bell=Bell),
        InputModel("house", domains, rules), supply={"turn": {"word": parse_expression(formula)}} if formula else {},
    )  # fmt: skip


def landing(study: ComponentStudy, seed: int = 1) -> Landing:
    return landing_of(study, study.plan(seed), {}, lambda what, done, total: None)


def visiting(study: ComponentStudy, component: str) -> list[str]:
    """Return the abstract cases that visit a component."""
    return [id for id, case in study.abstracts.items() if component in case.interaction.components]


def test_only_blocks_that_change_a_received_message_land() -> None:
    house = study(WORD, SPARE)
    found = landing(house)
    assert found.unreached == ("spare = [0, 1]", "spare = (1, 2]")
    push, ring = visiting(house, "Bolt"), visiting(house, "Bell")
    assert push and ring and all(list(found.abstracts((0, block))) == push for block in range(3))
    assert set(found.groups) == {("word",), ()} and list(found.groups[()]) == ring


def test_rows_need_to_combine_only_the_inputs_that_are_felt() -> None:
    found = landing(study(WORD, SPARE))
    assert (found.rows(("word",)), found.rows(("spare",)), found.rows(())) == (3, 2, 1)


def test_a_block_that_another_value_hides_gets_a_further_case_in_which_it_lands() -> None:
    house = study(WORD, split("lit", "1", [0, 1, 2], kind="integer", closed="left"), formula="word * min(lit, 1)")
    found, plan = landing(house), house.plan(1)
    assert found.further, "no case hides a block, so this seed tests nothing"
    assert all(int(id.rpartition("/")[2]) >= plan.n_rows for id in found.further)
    for id in visiting(house, "Bolt"):
        assert {(0, 0), (0, 1), (0, 2)} <= found.of[id].landed


def test_a_single_block_is_compared_with_another_of_its_values() -> None:
    found = landing(study(split("word", "1", [1, 9], kind="integer"), split("spare", "1", [2, 3], kind="integer")))
    assert found.unreached == ("spare = [2, 3]",)


def test_no_value_is_tried_that_the_rules_forbid() -> None:
    class Choosy(Key):
        def turn(self, message: Any) -> object:
            if message["word"] in (2, 5, 8):  # the middles of the blocks
                raise SystemExit(3)
            return super().turn(message)

    forbidden = study(WORD, rule="word != 2 && word != 5 && word != 8")
    parts = python_system(Key=Choosy, Bolt=Bolt, Bell=Bell)
    assert not landing(replace(forbidden, system=parts)).undecided
    assert landing(replace(study(WORD), system=parts)).undecided


def test_a_component_that_hangs_or_dies_leaves_its_abstract_case_undecided() -> None:
    def dies() -> object:
        raise SystemExit(3)

    house = study(WORD)
    broken = replace(house, system=python_system(Key=Key, Bolt=Bolt, Bell=dies))
    found = landing(broken)
    assert list(found.undecided) == visiting(house, "Bell")
    assert list(found.abstracts((0, 0))) == visiting(house, "Bolt")


def test_a_run_and_its_report_say_which_blocks_reached_nothing(tmp_path: Path) -> None:
    house = study(WORD, SPARE)
    request = Request(settings_of(house.parameters, {}, house.name), 1, tmp_path)
    house.run(request, lambda what, done, total: None)
    [table] = [one for one in house.report({"out": house.read(tmp_path)}).tables if one.title.startswith("Test data")]
    [row] = table.rows
    assert row[:3] == ("5", "3 of 5", 2) and row[3] == "spare = [0, 1], spare = (1, 2]"


def test_a_glance_ends_when_every_block_has_landed() -> None:
    house = study(WORD)
    found = glance(house, house.plan(1), {})
    assert (
        found.unreached == ()
        and found.is_whole
        and found.n_runs < sum(one.n_runs for one in landing(house).of.values())
    )


def test_a_study_without_inputs_is_refused() -> None:
    with pytest.raises(BadRequest, match="no-inputs"):
        landing(replace(study(WORD), inputs=NO_INPUTS))


def test_the_battery_warns_of_blocks_that_reach_nothing() -> None:
    found = [one for one in check_study(study(WORD, SPARE), lambda what, done, total: None) if one.level == "warning"]
    assert {"spare = [0, 1]", "spare = (1, 2]"} <= {one.where for one in found}


def test_the_command_prints_and_lists_the_same() -> None:
    shown = CliRunner().invoke(parcours, ["data", "landing", str(LIFT)])
    assert shown.exit_code == 0 and "2 of 2 blocks change a message that a component receives" in shown.stdout
    listed = json.loads(CliRunner().invoke(parcours, ["data", "landing", str(LIFT), "--json"]).stdout)
    assert listed["unreached"] == [] and all(len(one["abstract_cases"]) == 4 for one in listed["blocks"])
    assert find(str(LIFT)).name == listed["study"]
