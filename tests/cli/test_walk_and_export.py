from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import parcours_here
from parcours.model import read_model
from parcours.paths import measure

MODEL = Path(__file__).parents[2] / "src/parcours_ramp/components/model.yaml"


def parcours(*arguments: object, code: int = 0) -> tuple[str, str]:
    """Run the command and return what it wrote on standard output and on standard error."""
    ended, out, complaints = parcours_here(*arguments)
    assert ended == code and "Traceback" not in complaints, complaints
    return out, complaints


def test_steps_are_json_lines_that_measure_as_the_summary_says() -> None:
    printed, said = parcours("walk", MODEL, "--walker", "guided", "--until", "edge>=90% or steps>=500", "--json")
    steps = [json.loads(line) for line in printed.splitlines()]
    summary = json.loads(said)
    assert [step["step"] for step in steps] == list(range(1, summary["steps"] + 1))
    ids = [id for step in steps for id in (step["transition"], step.get("partner")) if id]
    missed = [f"{need.machine}: {need}" for need in measure(read_model(MODEL), "edge", ids).missed]
    assert summary["coverage"]["edge"]["missed"] == missed and summary["ended"] == "held"


def test_one_seed_gives_one_walk_on_the_terminal_and_in_a_file(tmp_path: Path) -> None:
    options = ("walk", MODEL, "--component", "Planner", "--until", "steps>=30", "--seed", "7", "--states")
    printed, said = parcours(*options, "--json")
    assert parcours(*options, "--out", tmp_path / "walk.jsonl")[0] == ""
    assert (tmp_path / "walk.jsonl").read_text() == printed
    assert "the stop condition holds: 30 steps" in parcours(*options)[1] and '"seed": 7' in said


def test_generator_strings_walk_bare_graphs_too() -> None:
    _, said = parcours("walk", MODEL, "--generator", "Shortest_All_Paths(edge_coverage(100))", "--ignore-guards")
    assert "edge: 37 of 37" in said and "37 steps" in said


def test_a_machine_of_its_own_name_needs_no_component() -> None:
    options = ("--until", "steps>=30", "--seed", "7")
    alone = parcours("walk", MODEL, "--machine", "execution", *options)
    assert alone == parcours("walk", MODEL, "--machine", "execution", "--component", "Control", *options)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--walker", "drunk"), "unknown-walker"),
        (("--until", "edge>=100"), "walk-syntax"),
        (("--until", "egde>=100%"), "did you mean 'edge'"),
        (("--until", "reached(nowhere)"), "unknown-target"),
        (("--generator", "random(never)", "--walker", "random"), "walk-options"),
        (("--generator", "predefined_path(predefined_path)"), "no-predefined-path"),
        (("--machine", "service"), "machine-alone"),
        (("--machine", "executionn"), "did you mean 'execution'"),
        (("--until", "steps>=1e400"), "too large"),
        (("--component", "Plannner"), "did you mean 'Planner'"),
        (("--at-dead-end", "turn"), "unknown-dead-end"),
        (("--out", "/proc/nowhere/walk.jsonl"), "trace-unwritable"),
    ],
)
def test_a_mistake_in_a_walk_costs_one_paragraph(arguments: tuple[str, ...], says: str) -> None:
    assert says in parcours("walk", MODEL, *arguments, code=2)[1]


def test_a_suite_becomes_a_script_beside_it_or_far_from_it(tmp_path: Path) -> None:
    suite, script = tmp_path / "suite.jsonl", tmp_path / "deep" / "test_suite.py"
    parcours("suite", "ramp_components", "--cases", "5", "--out", suite)
    assert "wrote 5 tests" in parcours("export", "pytest", suite, "--out", script, "--refer")[0]
    assert "Path(__file__).parent / '../suite.jsonl'" in script.read_text()
    for given, says in (
        ("schedule=guarded", "parameter-unknown"),
        ("host", "parameter-form"),
        ("percent=9", "parameter-range"),
    ):
        assert says in parcours("export", "pytest", suite, "--out", script, "--set", given, code=2)[1]
    assert "unreadable-file" in parcours("export", "pytest", tmp_path / "none", "--out", script, code=2)[1]
