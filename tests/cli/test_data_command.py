"""`parcours data`: rows, coverage of tables, sizes of criteria, and models converted, from the command line."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli.data import command
from parcours.data import read_input_model
from parcours.errors import BadRequest

DOMAINS = str(files("parcours_ramp") / "components" / "domains.yaml")
PICT = """\
paper: A4, A3, roll, ~none
tray: upper, lower
copies: 1, 10, 100
IF [paper] = "roll" THEN [tray] = "lower";
"""


def data(*arguments: str) -> str:
    result = CliRunner().invoke(command, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.parametrize("name", ["draw", "measure", "criteria", "convert"])
def test_every_command_explains_itself_by_an_example(name: str) -> None:
    assert "Example: parcours data" in data(name, "--help")


def test_drawn_rows_measure_as_what_their_criterion_promises(tmp_path: Path) -> None:
    drawn = json.loads(data("draw", DOMAINS, "--combine", "pairwise", "--max-time", "0.1", "--json"))
    assert drawn["fewest"] <= len(drawn["rows"]) and drawn["hit"] == drawn["blocks"] == 10
    (tmp_path / "rows.json").write_text(json.dumps(drawn))
    found = json.loads(data("measure", str(tmp_path / "rows.json"), "--data", DOMAINS, "--json"))
    assert found["share"] == 1.0 and not found["missing"] and found["counted"] == len(drawn["rows"])
    wide = data("measure", str(tmp_path / "rows.json"), "--data", DOMAINS, "--strength", "3", "--show", "1")
    assert "missing: " in wide and "more" in wide


def test_rows_go_on_after_one_set_and_stop_before(tmp_path: Path) -> None:
    assert len(json.loads(data("draw", DOMAINS, "--cases", "7", "--json"))["rows"]) == 7
    first = json.loads(data("draw", DOMAINS, "--cases", "2", "--json"))["rows"]
    assert first == json.loads(data("draw", DOMAINS, "--json"))["rows"][:2]


def test_must_have_rows_come_first_and_keep_their_values(tmp_path: Path) -> None:
    model = read_input_model(DOMAINS)
    table = tmp_path / "must.csv"
    table.write_text(",".join(model.names) + "\n0.3,3,1.0,2,0.5\n")
    drawn = json.loads(data("draw", DOMAINS, "--include", str(table), "--json"))
    assert drawn["rows"][0] == [0.3, 3, 1.0, 2, 0.5] and drawn["hit"] == drawn["blocks"]


def test_a_table_tells_rows_bound_negative_tests_and_what_is_forbidden(tmp_path: Path) -> None:
    (tmp_path / "printer.pict").write_text(PICT)
    shown = data("draw", str(tmp_path / "printer.pict"), "--combine", "pairwise", "--max-time", "0.1")
    assert "9 rows satisfy it; no set has fewer than 9" in shown
    assert "1 more rows are negative tests" in shown and "forbidden by the rules: paper = roll, tray = upper" in shown


def test_boundary_values_are_drawn_on_request() -> None:
    drawn = json.loads(data("draw", DOMAINS, "--boundaries", "--combine", "base_choice", "--json"))
    assert drawn["negative"] == 10 and drawn["hit"] == drawn["blocks"]


def test_criteria_are_compared_by_their_set_sizes() -> None:
    found = {
        each["criterion"]: (each["rows"], each["fewest"]) for each in json.loads(data("criteria", DOMAINS, "--json"))
    }
    assert found["each_choice"] == (3, 3) and found["base_choice"] == (6, 6) and found["pairwise"] == (9, 9)
    assert found["3-wise"] == found["all_combinations"] == (18, 18)
    assert "all_combinations" in data("criteria", DOMAINS)


def test_pict_models_become_yaml_and_back_and_losses_are_said(tmp_path: Path) -> None:
    source, there, back = (str(tmp_path / name) for name in ("printer.pict", "printer.yaml", "again.pict"))
    Path(source).write_text(PICT.replace("copies", "the copies"))
    assert "it is called the_copies here" in data("convert", source, there)
    assert "lost" not in data("convert", there, back)
    assert Path(back).read_text().splitlines()[:3] == [
        "paper: A4, A3, roll, ~none", "tray: upper, lower", "the_copies: 1, 10, 100",
    ]  # fmt: skip


def test_a_target_of_unknown_kind_or_place_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="unknown-format"):
        data("convert", DOMAINS, str(tmp_path / "model.xls"))
    with pytest.raises(BadRequest, match="folder-unwritable"):
        data("convert", DOMAINS, str(tmp_path / "absent" / "model.yaml"))


def test_losses_of_a_pict_model_are_told_and_equal_runs_print_the_same(tmp_path: Path) -> None:
    (tmp_path / "p.pict").write_text(PICT.replace("upper", "upper (5)"))
    arguments = ["draw", str(tmp_path / "p.pict"), "--combine", "pairwise", "--json"]
    first, again = (CliRunner().invoke(command, arguments, catch_exceptions=False) for _ in range(2))
    assert first.stdout == again.stdout and json.loads(first.stdout)["n_undecided"] == 0
    assert "lost: line 2: parameter 'tray': the weight of 'upper' is not kept" in first.stderr
