from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli.paths import command
from parcours.errors import BadRequest, BadResults
from parcours.paths.measuring.files import read_sequences

DOOR = """
parcours: model/1
name: house
messages: {Knock: {fields: {}}}
channels: {bell: {from: Street, to: Hall, message: Knock, capacity: 0}}
components:
  Street:
    machines:
      guest: {initial: away, transitions: {ring: {from: away, to: away, message: bell}}}
  Hall:
    machines:
      door:
        initial: shut
        transitions:
          open: {from: shut, to: ajar, event: bell(it)}
          wait: {from: ajar, to: ajar}
          close: {from: ajar, to: shut}
          sleep: {from: shut, to: shut}
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "house.yaml"
    path.write_text(DOOR)
    return path


def run(*arguments: object) -> str:
    done = CliRunner().invoke(command, [str(each) for each in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_each_machine_is_covered_with_what_is_known_of_the_optimum(model: Path) -> None:
    street, hall = json.loads(run(model, "--criterion", "edge-pair", "--json"))
    assert (street["machine"], street["requirements"], street["fewest"]) == ("guest", 1, 1)
    assert hall["requirements"] == 8
    assert hall["shortest"] <= hall["length"] == sum(len(path["transitions"]) for path in hall["paths"])
    printed = run(model, "--criterion", "edge-pair", "--component", "Hall")
    assert "Street" not in printed
    assert "gap" in printed


def test_paths_that_guards_may_forbid_are_said_to_be(model: Path) -> None:
    assert CliRunner().invoke(command, [str(model)]).stderr == ""
    model.write_text(DOOR.replace("wait: {from", "wait: {guard: false, from"))
    assert "parcours feasible" in CliRunner().invoke(command, [str(model)]).stderr
    assert CliRunner().invoke(command, [str(model), "--component", "Street"]).stderr == ""


def test_one_machine_keeps_the_names_it_has_among_all(model: Path) -> None:
    (hall,) = json.loads(run(model, "--machine", "door", "--json"))
    assert [path["name"] for path in hall["paths"]] == ["tp21"]


def test_a_limit_on_the_length_makes_more_paths(model: Path) -> None:
    _, hall = json.loads(run(model, "--criterion", "prime", "--max-length", 4, "--json"))
    assert max(len(path["transitions"]) for path in hall["paths"]) <= 4
    assert len(hall["paths"]) > hall["fewest"] == 1


def test_criteria_over_channels_cover_the_composition(model: Path) -> None:
    found = json.loads(run(model, "--criterion", "rendezvous", "--json"))
    assert found["impossible"] == []
    assert any("ring+open" in path for path in found["paths"])
    assert "ring+open" in run(model, "--composition")


def test_requirements_are_listed_by_machine(model: Path) -> None:
    needs = json.loads(run(model, "--criterion", "prime", "--machine", "door", "--list", "--json"))
    assert {tuple(need["steps"]) for need in needs} == {("wait",), ("sleep",), ("open", "close"), ("close", "open")}
    assert "5 requirements" in run(model, "--criterion", "prime", "--list")


def test_recorded_runs_are_measured_with_the_tours_asked_for(model: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs.txt"
    runs.write_text('ring+open wait close\n["sleep"]\n')
    asked = (model, "--criterion", "prime", "--coverage-of", runs, "--component", "Hall")
    assert "met 2 of 4" in run(*asked)
    found = json.loads(run(*asked, "--tours", "sidetrips", "--json"))
    assert (len(found["met"]), found["missed"][0]["steps"]) == (3, ["close", "open"])
    assert "met 1 of 1" in run(model, "--criterion", "rendezvous", "--coverage-of", runs)


def test_names_that_are_not_there_are_refused(model: Path) -> None:
    with pytest.raises(BadRequest, match=r"'hall' was given; did you mean 'Hall'.*\[unknown-component\]"):
        run(model, "--component", "hall")
    with pytest.raises(BadRequest, match=r"'gate' was given.*\[unknown-machine\]"):
        run(model, "--machine", "gate")


def test_steps_of_walks_and_events_of_runs_are_sequences(tmp_path: Path) -> None:
    file = tmp_path / "steps.jsonl"
    file.write_text(
        '{"step":1,"transition":"ring","partner":"open"}\n{"step":2,"transition":"close","restart":true}\n'
        '{"parcours":"trace/1","clock":"wall"}\n[5,"send","Hall","","bell",1,""]\n[7,"take","Hall","open","",-1,""]\n'
        '[9,"take","Hall","close","",-1,""]\n{"events":3}\n'
    )
    assert read_sequences(file) == [["ring+open"], ["close"], ["open", "close"]]


@pytest.mark.parametrize("line", ["[1, 2]", '["a", 1]', "{", "[" * 100_000, '"t1', "[null]"])
def test_a_line_that_is_no_sequence_is_refused_with_its_number(line: str, tmp_path: Path) -> None:
    file = tmp_path / "runs.jsonl"
    file.write_text(f"t1 t2\n{line}\n")
    if line.startswith(("[", "{")):
        with pytest.raises(BadResults, match=r"runs.jsonl:2: .*\[sequence-line\]"):
            read_sequences(file)
    else:
        assert read_sequences(file) == [["t1", "t2"], [line]]


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "noise").write_bytes(b"\xff\xfe\x00")
    for name in ("noise", "absent"):
        with pytest.raises(BadResults, match=r"\[sequences-unreadable\]"):
            read_sequences(tmp_path / name)


def test_a_limit_on_the_requirements_holds_everywhere(model: Path, tmp_path: Path) -> None:
    (tmp_path / "runs.txt").write_text("wait\n")
    asked = (model, "--criterion", "prime", "--max-requirements", 2)
    for more in ([], ["--list"], ["--composition"], ["--coverage-of", tmp_path / "runs.txt"]):
        with pytest.raises(BadRequest, match=r"stopped at 3 of \d+ steps in all, .*\[too-many-requirements\]"):
            run(*asked, *more)
