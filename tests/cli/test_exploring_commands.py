"""`parcours explore` and `parcours abtc`: what they print, stream and return."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli import parcours

MODEL = Path(str(files("parcours_ramp"))) / "components" / "model.yaml"
OBSTACLES = Path(str(files("parcours_navigation"))) / "cases" / "model.yaml"

SUPPER = """
parcours: model/1
name: supper
components:
  Table:
    variables: {left: {type: bool, initial: true}, right: {type: bool, initial: true}}
    machines:
      Ann: {initial: thinks, transitions: {
        a1: {from: thinks, to: waits, guard: left, action: left := false},
        a2: {from: waits, to: thinks, guard: right, action: left := true}}}
      Bob: {initial: thinks, transitions: {
        b1: {from: thinks, to: waits, guard: right, action: right := false},
        b2: {from: waits, to: thinks, guard: left, action: right := true}}}
"""


def run(*arguments: object, code: int = 0) -> str:
    done = CliRunner().invoke(parcours, [str(each) for each in arguments])
    assert done.exit_code == code, done.output
    return done.stdout


def test_explore_prints_a_deadlock_with_its_witness_and_returns_1(tmp_path: Path) -> None:
    file = tmp_path / "supper.yaml"
    file.write_text(SUPPER)
    printed = run("explore", file, code=1).splitlines()
    assert printed[0] == "supper: 4 states, 6 transitions" and printed[1].startswith("complete; ")
    assert "Table.Ann in waits, Table.Bob in waits [deadlock] (1 states, first after 2 moves)" in printed[2]
    assert [line.split() for line in printed[3:5]] == [["1", "a1"], ["2", "b1"]]
    assert len(run("explore", file, "--show", 0, code=1).splitlines()) == 3


def test_explore_speaks_json(tmp_path: Path) -> None:
    file = tmp_path / "supper.yaml"
    file.write_text(SUPPER)
    data = json.loads(run("explore", file, "--json", code=1))
    (found,) = data["findings"]
    assert (data["states"], data["complete"], found["kind"], found["steps"]) == (4, True, "deadlock", 2)
    assert [move["transition"] for move in found["witness"]] == ["a1", "b1"]


def test_a_bound_is_said_and_returns_3(tmp_path: Path) -> None:
    file = tmp_path / "supper.yaml"
    file.write_text(SUPPER)
    printed = run("explore", file, "--max-states", 3, code=3)
    assert "stopped at the bound of 3 states: 3 states known, 2 of them not expanded" in printed
    assert "nothing is wrong so far" in printed


KEPT = """\
parcours: model/1
name: kept
messages: {N: {fields: {v: {type: int}}}}
channels:
  in: {from: environment, to: C, message: N}
  out: {from: C, to: D, message: N, capacity: 0}
components:
  C:
    variables: {n: {type: int, initial: 0}}
    machines:
      m:
        initial: a
        transitions:
          t1: {from: a, to: b, event: in(x), guard: x.v >= 0, action: n := x.v}
          t2: {from: b, to: a, guard: n != 7}
          t3: {from: b, to: a, guard: n == 7, message: out(n)}
  D: {machines: {m: {initial: s, transitions: {d1: {from: s, to: s, event: out(y)}}}}}
"""


def test_a_kept_open_value_makes_what_was_not_seen_no_finding(tmp_path: Path) -> None:
    file = tmp_path / "kept.yaml"
    file.write_text(KEPT)
    printed = run("explore", file)
    assert "complete for the values tried: t1 keeps the open value 'x.v'" in printed
    assert "nothing is wrong for the values tried" in printed
    data = json.loads(run("explore", file, "--json"))
    assert (data["complete"], data["exact"], data["findings"]) == (True, False, [])
    asked = ("paths", file, "--composition", "--criterion", "rendezvous")
    covered = run(*asked)
    assert "not met: t3 -> d1" in covered and "no run can meet" not in covered
    data = json.loads(run(*asked, "--json"))
    assert (data["impossible"], data["unmet"], data["exact"]) == ([], ["t3 -> d1"], False)


def test_the_environment_alone_makes_no_fault() -> None:
    assert "nothing is wrong" in run("explore", OBSTACLES)


def test_abtc_lists_counts_and_compares() -> None:
    assert len(run("abtc", MODEL).splitlines()) == 67
    assert json.loads(run("abtc", MODEL, "--count", "--json"))["total"] == 67
    assert json.loads(run("abtc", MODEL, "--policies", "--json"))["all-states"]["total"] == 83690
    assert "every-transition" in run("abtc", MODEL, "--policies")


def test_sequences_of_one_case_are_counted_sampled_and_listed() -> None:
    case = ("abtc", MODEL, "--case", "ITP1-tp12.tp21.tp12-0.0.2", "--sequences")
    assert run(*case, "count").split()[-1] == "8190"
    drawn = json.loads(run(*case, "sample", "--sample", 3, "--json"))
    assert len(drawn) == 3 and {len(each["events"]) for each in drawn} == {17}
    assert drawn == json.loads(run(*case, "sample", "--sample", 3, "--json"))
    assert len(run(*case, "all").splitlines()) == 8190


@pytest.mark.parametrize("arguments", [("--policy", "every-transition"), ("--sequences", "all"),
                                       ("--policy", "every-transition", "--json")])  # fmt: skip
def test_millions_of_cases_are_streamed(arguments: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "parcours", "abtc", str(MODEL), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(500)]
        process.kill()
    assert len({*lines}) == 500 and "tp12" in lines[1]


def test_an_unknown_case_is_refused_with_examples() -> None:
    done = CliRunner().invoke(parcours, ["abtc", str(MODEL), "--case", "ITP9"])
    assert "unknown-abstract" in str(done.exception) and "ITP1-tp12.tp21.tp12-0.0.0" in str(done.exception)
