"""`parcours feasible` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli.feasible import command
from parcours.errors import BadRequest

MODEL = """
parcours: model/1
name: gate
components:
  Gate:
    variables:
      x: {type: clock}
      coins: {type: int, initial: 0, range: [0, 2]}
      paid: {type: bool, role: input}
    machines:
      gate:
        initial: shut
        transitions:
          pay: {from: shut, to: shut, guard: paid && coins < 2, action: coins := coins + 1; x := 0}
          open: {from: shut, to: wide, guard: coins == 2 && x >= 1 && x < 3}
          shut: {from: wide, to: shut, action: coins := 0, duration: [4, 5]}
          jam: {from: wide, to: shut, guard: coins == 1}
"""


def feasible(folder: Path, *arguments: str) -> Result:
    path = folder / "gate.yaml"
    path.write_text(MODEL)
    return CliRunner().invoke(command, [str(path), *arguments], catch_exceptions=False)


def test_every_requirement_is_reported_once_with_its_verdict_and_paths_carry_windows(tmp_path: Path) -> None:
    (found,) = json.loads(feasible(tmp_path, "--json").stdout)
    assert [each["requirement"] for each in found["covered"]] == ["pay", "open", "shut"]
    assert found["infeasible"][0]["requirement"] == "jam" and found["undecided"] == []
    path = found["paths"][found["covered"][2]["path"]]
    assert path["transitions"][:4] == ["pay", "pay", "open", "shut"] and path["ends"]
    assert path["windows_s"][3] == [5.0, None] and path["timing"] == ""
    assert path["moves"][0]["inputs"]["Gate.paid"] is True


def test_tables_show_verdicts_values_and_times(tmp_path: Path) -> None:
    printed = feasible(tmp_path, "--machine", "gate", "--component", "Gate").stdout
    assert "3 covered, 1 infeasible, 0 undecided" in printed
    assert "guard of 'jam': coins == 1" in printed
    assert "paid = true" in printed and "earliest [s]" in printed


def test_names_that_the_model_does_not_have_are_refused(tmp_path: Path) -> None:
    for arguments in (("--component", "Gat"), ("--machine", "gat"), ("--criterion", "egde")):
        with pytest.raises(BadRequest, match="did you mean"):
            feasible(tmp_path, *arguments)


def test_the_help_tells_which_criteria_work_and_those_do(tmp_path: Path) -> None:
    told = " ".join(CliRunner().invoke(command, ["--help"]).stdout.split())
    works, refused = told.split("all-du-paths do.")
    for criterion in ("node", "edge-pair", "prime", "complete-round-trip"):
        assert criterion in works and feasible(tmp_path, "--criterion", criterion, "--json").exit_code == 0
    for criterion in ("simple-round-trip", "all-defs", "all-uses"):
        assert criterion in refused
        with pytest.raises(BadRequest, match="must name a state or a sequence"):
            feasible(tmp_path, "--criterion", criterion)
