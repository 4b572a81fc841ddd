from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.abtc import Event, serialise
from parcours.cli.export import command
from parcours.errors import BadRequest, BadSuite
from parcours.run.hosts import frames
from parcours.suite import Case, write_suite
from parcours_ramp.components.study import component_plan, interaction_cases, paper_sample
from parcours_ramp.gtest import export
from parcours_ramp.gtest.export import MOST_CASES, Repeats, export_gtest, timing_limits
from parcours_ramp.gtest.tables import GtestCase, GtestChannel, GtestStimulus, folder_texts, identifier, literal, tables

ABSTRACT = next(iter(interaction_cases()))
CHANNEL = GtestChannel("obstacles", "Sensing", "Planner", "topic", "/obstacles", "p/O", "0" * 32, "int64 n", "", ())
ASKS = replace(CHANNEL, name="trajectory_request", role="request", other="obstacles")


def case_of(row: int = 0, abstract: str = ABSTRACT) -> Case:
    return Case("ramp_components", row, abstract, row, (), (), 5.0, seed=0)


def as_test(case: Case, document: bytes = b"{}", data: bytes = b"", *, events: tuple[Event, ...] = ()) -> GtestCase:
    events = events or serialise(interaction_cases()[ABSTRACT])[:2]
    stimulus = GtestStimulus(1, "supply", "obstacles", data)
    return GtestCase(case, document, events, ("poll",) * len(events), (stimulus,), "trajectory_size")


def shape(program: str) -> str:
    """Return the program without what stands in its literals, their number, and how long messages are."""
    return re.sub(r"\d+", "0", re.sub(r'"(?:\\[0-7]{3}|[^"\\])*"(\s+"(?:\\[0-7]{3}|[^"\\])*")*', "L", program))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400))
def test_a_literal_says_all_bytes_and_nothing_else(data: bytes) -> None:
    written = literal(data)
    # octal escapes and adjacent literals mean the same in Python
    pieces = re.findall(r'"[^"]*"', written)
    assert b"".join(ast.literal_eval(f"b{piece}") for piece in pieces) == data
    assert re.fullmatch(r'"[^"\n]*"(\n    "[^"\n]*")*', written)
    assert not re.search(r"\\(?![0-7]{3})", written)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60), st.binary(max_size=60), st.text(max_size=30))
def test_what_a_suite_holds_puts_no_code_into_the_program(document: bytes, data: bytes, title: str) -> None:
    channels = [CHANNEL, ASKS]
    usual = tables([as_test(case_of())], channels, ["Planner"], "cases")
    hostile = tables([as_test(case_of(), document, data)], channels, ["Planner"], title)
    assert shape(hostile).split("\n")[1:] == shape(usual).split("\n")[1:]
    assert re.fullmatch(r"// [\w.,:\- ]*", hostile.split("\n")[0])


def test_every_case_gets_one_test_under_a_name_of_its_own() -> None:
    cases = [as_test(case_of(row)) for row in range(3)]
    program = tables(cases, [CHANNEL, ASKS], ["Planner"], "three cases")
    names = re.findall(r"^TEST\(Functional, (\w+)\)", program, re.MULTILINE)
    assert names == [identifier(one.case) for one in cases] and len(set(names)) == 3
    assert "TEST(Timing" not in program
    assert program.count("constexpr Event") == 1  # shared by the cases of one abstract case
    twice = [as_test(case_of(abstract="a.b")), as_test(case_of(abstract="a-b"))]
    with pytest.raises(BadRequest, match=r"both a_b_row0; leave one of them out \[export-cases\]"):
        tables(twice, [CHANNEL, ASKS], [], "")
    with pytest.raises(BadRequest, match="export-cases"):
        tables([], [CHANNEL], [], "")


def test_events_of_another_model_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"'trajectory_request' is not one \[export-event\]"):
        tables([as_test(case_of())], [CHANNEL], [], "")
    waiting = replace(serialise(interaction_cases()[ABSTRACT])[1], after=(0, 0, 0))
    with pytest.raises(BadRequest, match="export-event"):
        tables([as_test(case_of(), events=(waiting,))], [CHANNEL, ASKS], [], "")


def test_a_suite_becomes_a_folder_that_holds_all_a_compiler_needs(tmp_path: Path) -> None:
    suite, folder = tmp_path / "suite.jsonl", tmp_path / "out"
    cases = list(component_plan(4, 1).cases(0, 5))
    write_suite(suite, cases)
    done = export_gtest(suite, folder)
    program = (folder / "test_cases.cpp").read_text()
    assert (done.n_functional, done.n_timing) == (5, program.count("\nTEST(Timing, "))
    headers = {path.name for path in folder.glob("*.hpp")}
    included = {name for path in folder.glob("*pp") for name in re.findall(r'#include "(.*)"', path.read_text())}
    assert headers == included
    for case in cases:
        assert literal(case.id) in program
    assert {path.name for path in (folder / "srv").iterdir()} == {
        "TrajectoryGeneration.srv",
        "TrajectoryEvaluation.srv",
        "PathModification.srv",
    }
    assert (folder / "launch_nodes.sh").stat().st_mode & 0o111
    readme = (folder / "README.md").read_text()
    assert "5 functional cases" in readme and "suite.jsonl" in readme and "@" not in readme
    assert "@" not in folder_texts("", dict.fromkeys(("FUNCTIONAL", "TIMING", "SUITE", "SHA256"), "@`$x"))["README.md"]


def test_the_timing_cases_are_those_of_the_paper_with_its_limits() -> None:
    plan = component_plan(7)
    timed = timing_limits(list(plan.cases(0, len(plan))), Repeats())
    assert sorted(timed) == sorted(case.id for case in paper_sample(plan))
    limits = [one.limit for one in timed.values()]
    assert (min(limits), max(limits)) == (5_000_000, 100_000_000)
    assert {one.bound.split()[0] for one in timed.values()} == {"p95"}
    for wrong in (Repeats(repeats=0), Repeats(warm_up=-1), Repeats(percent=100.0)):
        with pytest.raises(BadRequest, match=r"count-range|timing-bound-range"):
            timing_limits(list(plan.cases(0, 3)), wrong)


def test_what_is_no_case_of_the_study_is_refused(tmp_path: Path) -> None:
    good = component_plan(0, 1).case(0)
    suite, folder = tmp_path / "suite.jsonl", tmp_path / "out"
    for wrong, complaint in (
        (replace(good, study="ramp_system"), r"only cases of ramp_components .* \[export-study\]"),
        (replace(good, abstract="nothing"), r"but nothing is not one; write the suite again.* \[export-case\]"),
        (replace(good, names=("a", *good.names[1:])), r"must have the inputs motion, .* \[export-case\]"),
        (replace(good, values=(good.values[0], 1e6, *good.values[2:])), r"path must lie in its domain, but is 1e\+06"),
        (replace(good, values=(good.values[0], 3.5, *good.values[2:])), r"path must lie in its domain, but is 3.5"),
    ):
        write_suite(suite, [good, replace(wrong, number=1)])
        with pytest.raises(BadRequest, match=complaint):
            export_gtest(suite, folder)
    write_suite(suite, [replace(good, number=k, row=k) for k in range(MOST_CASES + 1)])
    with pytest.raises(BadRequest, match="export-size"):
        export_gtest(suite, folder)
    write_suite(suite, [good, replace(good, number=1)])
    with pytest.raises(BadRequest, match="export-cases"):
        export_gtest(suite, folder)
    write_suite(suite, [])
    with pytest.raises(BadRequest, match="export-cases"):
        export_gtest(suite, folder)
    suite.write_text(suite.read_text().replace("parcours", "#include"))
    with pytest.raises(BadSuite):
        export_gtest(suite, folder)
    assert not folder.exists()


def test_the_command_says_what_it_wrote_and_what_it_refuses(tmp_path: Path) -> None:
    suite, folder = tmp_path / "suite.jsonl", tmp_path / "out"
    write_suite(suite, component_plan(0, 1).cases(0, 2))
    done = CliRunner().invoke(
        command, ["gtest", str(suite), "--out", str(folder), "--repeats", "20", "--percent", "80"]
    )
    assert done.exit_code == 0 and f"wrote 2 functional and 2 timing tests to {folder}" in done.output
    program = (folder / "test_cases.cpp").read_text()
    assert program.count('"p80 <') == 2 and ", 80.0, 20, 3, " in program
    (tmp_path / "file").touch()
    refused = CliRunner().invoke(command, ["gtest", str(suite), "--out", str(tmp_path / "file" / "out")])
    assert isinstance(refused.exception, BadRequest) and refused.exception.slug == "folder-unwritable"


def test_the_frames_that_the_programs_wait_for_are_frames_of_the_wire() -> None:
    programs = Path(export.__file__).parent / "cpp"
    text = "".join(file.read_text() for file in programs.glob("*.hpp"))
    named = set(re.findall(r'report(?:->|\.)kind [!=]= "(\w+)"', text))
    assert {"Turned", "Died"} < named <= {frame.__name__ for frame in frames.Frame.__subclasses__()}
