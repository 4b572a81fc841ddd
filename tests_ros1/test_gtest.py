"""The Google Test program that Parcours writes, built as its README says: its verdicts on live nodes are ours."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from tests_ros1.ros1_messages import load

import parcours_ramp.gtest
from parcours.run.enforcement import Execution, enforce
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.live_enforcement import DrivenInstances
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.master import Master
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.noise import Noise
from parcours.run.port import links
from parcours.suite import Case, write_suite
from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import NEVER, Bound, judge, parse_bound
from parcours.verdict.timing.dependence import dependence
from parcours_ramp.components.model import component_model
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.components.study import component_plan, component_study, run_functional
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.gtest.export import Repeats, export_gtest, gtest_channels, timing_limits
from parcours_ramp.gtest.persistent_nodes import NODE_PROGRAM
from parcours_ramp.gtest.tables import GtestLimit, identifier

CASES = list(component_plan(0, 1).cases(0, 67))
TIMED = ":".join(f"Timing.ITP{itp}_*_0_0_0_row0" for itp in (1, 2, 3)) + ":Timing.ITP6_*_0_0_0_0_0_0_0_row0"
HEADERS = Path(parcours_ramp.gtest.__file__).parent / "cpp"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The exported and built program, with few repeats of its timing cases."""
    root = tmp_path_factory.mktemp("gtest")
    write_suite(root / "suite.jsonl", CASES)
    export_gtest(root / "suite.jsonl", root / "out", Repeats(repeats=8, warm_up=1, percent=50.0))
    for command in (["cmake", "-S", ".", "-B", "build"], ["cmake", "--build", "build"]):
        done = subprocess.run(command, cwd=root / "out", capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in done.stderr
    return root / "out"


@dataclass(frozen=True)
class Told:
    """What Google Test says of one test."""

    verdict: str
    why: str
    properties: dict[str, str]


def run(folder: Path, environment: dict[str, str], pattern: str, xml: str = "verdicts.xml") -> dict[str, Told]:
    """Run the tests of a pattern, and return what each is said to be, by suite and case."""
    command = [
        str(folder / "build" / "parcours_cases"),
        f"--gtest_filter={pattern}",
        f"--gtest_output=xml:{folder / xml}",
    ]
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False, timeout=120)
    return read_verdicts(folder / xml)


def read_verdicts(path: Path) -> dict[str, Told]:
    """Return the verdicts in Google Test's XML, by suite and case id."""
    found = {}
    for one in ElementTree.parse(path).getroot().iter("testcase"):
        said = [child for child in one if child.tag in ("failure", "skipped")]
        verdict = "pass" if not said else {"failure": "fail", "skipped": "inconclusive"}[said[0].tag]
        properties = {each.get("name", ""): each.get("value", "") for each in one.iter("property")}
        why = said[0].get("message", "") if said else ""
        found[f"{one.get('classname')} {properties['case']}"] = Told(verdict, why, properties)
    return found


@contextmanager
def standing(folder: Path, *more: str) -> Iterator[dict[str, str]]:
    """Start a master, and the nodes as a user does; yield the environment. Nothing is left of the nodes afterwards."""
    with Master() as master:
        environment = os.environ | master.environment | {"PARCOURS": sys.executable, "PYTHONUNBUFFERED": "1"}
        nodes = subprocess.Popen(
            [str(folder / "launch_nodes.sh"), "__name:=nodes", *more], env=environment, start_new_session=True
        )
        try:
            yield environment
        finally:
            nodes.send_signal(signal.SIGINT)
            assert nodes.wait(20) == 0
        names = {f"/{one.name}" for one in component_model().components}
        assert not any(names & set(who) for part in ask(master.uri, "getSystemState", "/test") for _, who in part)
    until = time.monotonic() + 10.0
    while living(nodes.pid) and time.monotonic() < until:  # the server they were forked from notices a moment later
        time.sleep(0.05)
    assert not living(nodes.pid)


def living(session: int) -> list[str]:
    """Return the processes of a session."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] not in "ZX":
            found.append(path.parent.name)
    return found


def verdicts_here(node_program: str) -> dict[str, tuple[str, str]]:
    """Return the verdicts of our own tester on nodes of that node_program, by case."""
    model = component_model()
    nodes = nodes_of(links(model), [one.name for one in model.components], node_program)
    transport = Ros1Transport(nodes, interfaces(model), CODEC, ["parcours_ramp.components.warm"])

    def execute(case: Case) -> Execution:
        tester = ComponentTester(case)
        return enforce(
            component_study().events(case), DrivenInstances(transport, CODEC, tester), tester.supply, case=case.id
        )

    try:
        judged = {case.id: run_functional(case, execute).judgement for case in CASES}
    finally:
        transport.close()
    return {id: (str(one.verdict), one.why) for id, one in judged.items()}


def test_all_cases_pass_as_they_do_here_and_timing_cases_are_timed(folder: Path) -> None:
    with standing(folder) as environment:
        functional = run(folder, environment, "Functional.*")
        timing = run(folder, environment, TIMED)  # another tester of the same nodes
    assert {id: told.why for id, told in functional.items() if told.verdict != "pass"} == {}
    assert {id.split()[1]: told.verdict for id, told in functional.items()} == {
        id: verdict for id, (verdict, _) in verdicts_here(NODE_PROGRAM).items()
    }
    assert len(functional) == 67
    assert len(timing) == 4
    for told in timing.values():
        durations, noise = (list(map(int, told.properties[name].split())) for name in ("durations_ns", "noise_ns"))
        assert len(durations) == 8 and len(noise) >= 8 and min(durations) > 100_000
        judged = judge(durations, parse_bound(told.properties["bound"]), Noise(tuple(noise)))
        assert told.verdict == str(judged.verdict)
        assert int(told.properties["p50_ns"]) == sorted(durations)[3]
        assert int(told.properties["max_ns"]) == int(told.properties["p99_ns"]) == max(durations)


def of_interactions(verdicts: dict[str, tuple[str, str]]) -> dict[str, set[str]]:
    """Return which verdicts the cases of each interaction path have."""
    itps = (f"ITP{k}" for k in range(1, 7))
    return {itp: {verdict for id, (verdict, _) in verdicts.items() if f"/{itp}-" in id} for itp in itps}


def test_deviations_are_found_at_the_same_events_in_the_same_words(folder: Path) -> None:
    spoilt = "tests_ros1.ros1_spoilt:deviating"
    with standing(folder, "--program", spoilt) as environment:
        there = run(folder, environment, "Functional.*")
    here = verdicts_here(spoilt)
    assert {id.split()[1]: told.verdict for id, told in there.items()} == {id: one for id, (one, _) in here.items()}
    deviations = {id: why for id, (_, why) in here.items() if why.startswith("event ")}
    assert [(why, there[f"Functional {id}"].why) for id, why in deviations.items()
            if why not in there[f"Functional {id}"].why] == []  # fmt: skip
    assert len(deviations) > 20
    assert of_interactions(here)["ITP1"] == {"fail"} and of_interactions(here)["ITP4"] == {"pass"}
    assert any("got ValueError: no operator" in told.why for told in there.values())
    assert any("sending nothing" in told.why for told in there.values())


def test_what_is_not_as_table_viii_expects_fails_as_it_does_here(folder: Path) -> None:
    spoilt = "tests_ros1.ros1_spoilt:lying"
    with standing(folder, "--program", spoilt) as environment:
        there = run(folder, environment, "Functional.*")
    here = verdicts_here(spoilt)
    assert {id.split()[1]: told.verdict for id, told in there.items()} == {id: one for id, (one, _) in here.items()}
    failed = {itp: {"fail"} for itp in ("ITP1", "ITP2", "ITP3", "ITP5", "ITP6")}
    assert of_interactions(here) == failed | {"ITP4": {"pass"}}
    assert not any("event " in told.why for told in there.values())
    for words in (
        "10..500 expected",
        "at most 2 expected",
        "a knot moved by 0 m",
        "controls follow one",
        "0 m from the",
    ):
        assert any(words in told.why for told in there.values())


def test_checksums_of_the_program_are_those_by_which_ros_knows_the_messages(folder: Path) -> None:
    messages = load(folder)
    for one in gtest_channels(interfaces(component_model())):
        classes = messages[one.name]
        known = classes.message if one.role == "topic" else classes.service
        assert (one.type, one.md5sum) == (known._type, known._md5sum)
        assert [name for _, name in one.fields] == classes.message.__slots__


def test_who_is_not_there_is_named(folder: Path) -> None:
    program = [str(folder / "build" / "parcours_cases"), f"--gtest_filter=Functional.{identifier(CASES[0])}"]
    began = time.monotonic()
    nobody = os.environ | {"ROS_MASTER_URI": "http://127.0.0.1:1"}
    done = subprocess.run(program, env=nobody, capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 1 and time.monotonic() - began < 9.0
    assert re.search(r"ROS master http://127.0.0.1:1.*must answer within 5 s", done.stdout)
    assert "[       OK ]" not in done.stdout
    launch = [str(folder / "launch_nodes.sh")]
    told = subprocess.run(
        launch, env=nobody | {"PARCOURS": sys.executable}, capture_output=True, text=True, check=False
    )
    assert told.returncode != 0 and "[no-master]" in told.stderr
    with Master() as master:
        alone = os.environ | master.environment | {"PARCOURS_NODES_WITHIN": "1"}
        done = subprocess.run(program, env=alone, capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 1 and "[       OK ]" not in done.stdout
    missing = "Control PathModification Planner Sensing TrajectoryEvaluation TrajectoryGenerator"
    assert f"missing are: {missing}; start them with launch_nodes.sh" in done.stdout


def test_a_node_that_is_killed_fails_the_case_and_no_later_one_passes(folder: Path) -> None:
    with standing(folder) as environment:
        victim = environment["ROS_MASTER_URI"]
        pattern = f"Timing.{identifier(CASES[0])}:Functional.*"
        command = [str(folder / "build" / "parcours_cases"), f"--gtest_filter={pattern}", "--gtest_repeat=50"]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            for line in program.stdout:
                if "[       OK ]" in line:
                    os.kill(ask(ask(victim, "lookupNode", "/test", "/Planner"), "getPid", "/test"), signal.SIGKILL)
                    break
            rest = program.stdout.read().split("\nRepeating all tests")[0]
    assert "Planner" in rest
    first = rest.index("Failure")
    assert "[       OK ]" not in rest[first:]


def test_durations_are_judged_as_here(tmp_path: Path) -> None:
    stream = random.Random(5)
    repeats = Repeats(repeats=60, percent=90.0)
    limit = next(iter(timing_limits([CASES[0]], repeats).values()))
    bound = Bound(limit.limit, limit.percent, strict=False)
    # The program takes repeats to be independent; so these are, as far as their order shows.
    drawn = [_durations(stream, limit) for _ in range(400)]
    mixed = [(stream.sample(times, len(times)), noise) for times, noise in drawn]
    rows = [(times, noise) for times, noise in mixed if not dependence(np.array(times), bound.last).is_seen]
    lines = ["#include <iostream>", '#include "parcours_timing.hpp"', "using namespace parcours;", "int main() {"]
    lines += [f'  const Limit limit{{"", {limit.limit}, {limit.percent}, 0, 0, {limit.ranks[0]}, {limit.ranks[1]},']
    lines += [f"                    {limit.ranks[2]}, 0, {limit.noise_ranks[0]}, {limit.noise_ranks[1]}, 0}};"]
    lines += ["  for (int n_times, n_noise; std::cin >> n_times >> n_noise;) {"]
    lines += ["    std::vector<std::int64_t> times(n_times), noise(n_noise);"]
    lines += ["    for (auto& one : times) std::cin >> one;", "    for (auto& one : noise) std::cin >> one;"]
    lines += ["    std::cout << static_cast<int>(time_verdict(times, noise, limit).verdict);", "  }", "}"]
    (tmp_path / "judge.cpp").write_text("\n".join(lines))
    build = ["g++", "-std=c++17", f"-I{HEADERS}", "judge.cpp", "-o", "judge"]
    subprocess.run(build, cwd=tmp_path, check=True)
    text = "\n".join(
        f"{len(times)} {len(noise)} {' '.join(map(str, [*sorted(times), *noise]))}" for times, noise in rows
    )
    told = subprocess.run([tmp_path / "judge"], input=text, capture_output=True, text=True, check=True).stdout
    ours = [judge(times, bound, Noise(tuple(noise))).verdict for times, noise in rows]
    assert [(Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE)[int(one)] for one in told] == ours
    assert set(ours) == {Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE}


def _durations(stream: random.Random, limit: GtestLimit) -> tuple[list[int], list[int]]:
    """Return repeats around the limit and noise of any size, in order of size."""
    spread, level = limit.limit * 10 ** stream.uniform(-3.0, -0.5), limit.limit * stream.uniform(0.8, 1.2)
    times = [max(0, round(stream.gauss(level, spread))) for _ in range(limit.repeats)]
    if stream.random() < 0.2:
        times[0] = NEVER
    most = limit.limit * 10 ** stream.uniform(-4.0, 0.0)
    return sorted(times), sorted(round(stream.uniform(0.0, most)) for _ in range(limit.repeats * limit.noise_samples))
