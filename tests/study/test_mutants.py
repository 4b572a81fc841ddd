"""Mutants of Python components: what is changed, one build for all of them, and what the tests of a study notice."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours import kernels
from parcours.cli import parcours
from parcours.model.formulas import clauses
from parcours.run.trace import Trace, TraceEvent
from parcours.study.components.study import ComponentStudy
from parcours.study.finding import find
from parcours.study.mutation.comparing import compare
from parcours.study.mutation.mutant import sampled
from parcours.study.mutation.observing import AnyStudy
from parcours.study.mutation.running import MutationRequest
from parcours.study.mutation.source import Module, Sources
from parcours.study.mutation.suites import Suite, random_cases, with_suite
from parcours.study.mutation.twin import difference_of, fact_of
from parcours.study.parameters import settings_of
from parcours.study.protocol import Judged, Showing
from parcours.suite import Case
from parcours.verdict.judgement import Verdict

BOX = """
from parcours.study import took
PERIOD = 0.5
class Box:
    def open(self, message):
        n = 1
        while n < 3:
            n = n + 1
        if message["lid"] and min(n, 2) == 2:
            return took("b1", lid={"angle": PERIOD})
        return took("b2")
"""


def sources(text: str, folder: Path) -> Sources:
    path = folder / "box.py"
    path.write_text(text)
    return Sources((Module("box", path, text),), (("b1", "b2"),), ("lid",))


def built(text: str, folder: Path) -> dict[str, object]:
    """Return the namespace of a module that holds all its mutants, with their numbers by id."""
    found = sources(text, folder)
    numbers = {one.id: k for k, one in enumerate(found.mutants(), start=1)}
    tree = found.build(folder / "box.py", numbers)
    assert tree is not None
    names: dict[str, object] = {"numbers": numbers}
    exec(compile(tree, "box.py", "exec"), names)
    return names


def test_every_operator_finds_its_place_and_says_what_it_changes(tmp_path: Path) -> None:
    found = {one.id.partition(":")[2]: one.change for one in sources(BOX, tmp_path).mutants()}
    wanted = {
        "Box.open:1:relation": "n < 3 -> (n <= 3)",
        "Box.open:1:stale": "n = n + 1 -> pass",
        "Box.open:1:arithmetic": "n + 1 -> (n - 1)",
        "Box.open:1:logic": "message[\"lid\"] and min(n, 2) == 2 -> (message['lid'] or min(n, 2) == 2)",
        "Box.open:1:function": "min(n, 2) -> max(n, 2)",
        "Box.open:1:limit": "min(n, 2) -> n",
        "Box.open:1:transition": "\"b1\" -> 'b2'",
        "Box.open:1:message": 'took("b1", lid={"angle": PERIOD}) -> took(\'b1\')',
        "Box.open:1:period": "PERIOD -> (PERIOD * 2.0)",
    }
    assert {id: found.get(id) for id in wanted} == wanted


def test_a_diff_holds_the_changed_line_only(tmp_path: Path) -> None:
    [one] = [one for one in sources(BOX, tmp_path).mutants() if one.id.endswith("Box.open:1:relation")]
    assert [line for line in one.diff.splitlines() if line[0] in "+-"][2:] == [
        "-        while n < 3:", "+        while (n <= 3):"
    ]  # fmt: skip


def test_one_build_is_the_original_and_each_mutant_by_its_number(tmp_path: Path) -> None:
    names = built("def add(a, b):\n    c = a + b\n    c = 2 * c\n    return c\n", tmp_path)
    numbers, add = names["numbers"], names["add"]
    assert isinstance(numbers, dict) and callable(add)
    said = {}
    try:
        for id, number in numbers.items():
            kernels.choose(number)
            said[id.partition(":")[2]] = add(3, 4)
    finally:
        kernels.choose(0)
    assert add(3, 4) == 14
    assert said["add:1:arithmetic"] == -2  # (3 - 4) * 2
    assert said["add:1:stale"] == 7
    assert said["add:1:off-by-one"] == 21


def test_what_every_mutant_changes_is_python(tmp_path: Path) -> None:
    for one in sources(BOX, tmp_path).mutants():
        if "twice" not in one.change:
            after = one.change.partition(" -> ")[2]
            ast.parse(after)


def test_a_loop_that_never_ends_is_ended_by_the_rounds_it_goes(tmp_path: Path) -> None:
    names = built("def count(n):\n    k = 0\n    while k < n:\n        k = k + 1\n    return k\n", tmp_path)
    numbers, count = names["numbers"], names["count"]
    assert isinstance(numbers, dict) and callable(count)
    kernels.choose(numbers["box:count:1:stale"], 1000)
    try:
        with pytest.raises(kernels.Spent):
            count(10)
        assert kernels.rounds_left() < 0
    finally:
        kernels.choose(0)


def test_a_kernel_reads_the_number_when_it_runs_also_from_disk(tmp_path: Path) -> None:
    (tmp_path / "inner.py").write_text(
        textwrap.dedent("""
        from pathlib import Path
        from parcours import kernels
        kernels.keep_kernels_in(Path(__file__).parent / "kernels")
        @kernels.kernel
        def f(x):
            return x - 1 if kernels.chosen(3) == 5 else x + 1
        first = f(10)
        kernels.choose(5)
        print(first, f(10), sorted(kernels.places_run()))
        """)
    )
    for _ in range(2):
        said = subprocess.run([sys.executable, "inner.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert said.stdout.split() == ["11", "9", "[3]"]


def test_a_larger_sample_holds_the_smaller_one(tmp_path: Path) -> None:
    all = sources(BOX, tmp_path).mutants()
    few, more = ({one.id for one in sampled(all, n, seed=1)} for n in (5, 9))
    assert len(few) == 5 and len(more) == 9 and few < more
    assert sampled(all, 0, 1) == all


def test_mutants_of_the_lift_are_noticed_but_for_what_no_oracle_looks_at(tmp_path: Path) -> None:
    whole = [
        "mutate",
        "examples/lift",
        "--sample",
        "0",
        "--twin-cases",
        "8",
        "--workers",
        "2",
        "--out",
        str(tmp_path / "all"),
    ]
    run = CliRunner().invoke(parcours, [*whole, "--fail-if", "score < 99%"])
    assert run.exit_code == 0, run.output
    lift = tmp_path / "lift"
    shutil.copytree("examples/lift", lift)
    model = (lift / "model.yaml").read_text()
    model = re.sub(r"close\([0-9.]+\)", "close", model).replace("it.hold >= 500 ms && it.hold <= 10 s", "true")
    (lift / "model.yaml").write_text(model)  # it says no more for how long the door waits
    arguments = [
        "mutate",
        str(lift),
        "--sample",
        "0",
        "--twin-cases",
        "8",
        "--workers",
        "2",
        "--out",
        str(tmp_path / "out"),
    ]
    run = CliRunner().invoke(parcours, [*arguments, "--json", "--fail-if", "score < 99%"])
    assert run.exit_code == 1, run.output
    document = json.loads(run.stdout)
    ends = {one["id"]: (one["end"], sorted(one["seen"])) for one in document["mutants"]}
    assert len(ends) > 30 and {end for end, _ in ends.values()} == {"ended"}
    survivors = [id for id, (_, seen) in ends.items() if seen == ["golden twin"]]
    assert survivors == ["lift:Cabin.request:1:constant", "lift:Cabin.request:1:unit"]  # how long the door waits
    assert "component cases" in ends["lift:Cabin.door:1:stale"][1]
    again = CliRunner().invoke(parcours, [*arguments, "--fail-if", "score < 75%"])
    assert again.exit_code == 0 and "golden twin" in again.output and '+        return took("c1"' in again.output


def test_a_list_runs_nothing(tmp_path: Path) -> None:
    run = CliRunner().invoke(parcours, ["mutate", "examples/lift", "--list", "--only", "Door.d3"])
    assert run.exit_code == 0 and "lift:Door.d3:1:transition  lift.py:38" in run.output


def test_an_unknown_operator_is_refused_with_those_there_are() -> None:
    run = CliRunner().invoke(parcours, ["mutate", "examples/lift", "--list", "--operators", "relations"])
    assert getattr(run.exception, "slug", "") == "mutants-operator"


def outcomes(*arguments: str, out: Path) -> dict[str, list[str]]:
    """Return what has seen each mutant."""
    run = CliRunner().invoke(parcours, ["mutate", *arguments, "--workers", "2", "--out", str(out), "--json"])
    assert run.exit_code == 0, run.output
    return {one["id"]: sorted(one["seen"]) for one in json.loads(run.stdout)["mutants"]}


def test_a_model_that_sends_something_else_finds_clean_runs_at_fault(tmp_path: Path) -> None:
    found = outcomes("examples/lift", "--target", "model", "--operators", "message,guard", out=tmp_path)
    assert found["Panel:p1:1:message"] == ["conformance"]  # request dropped
    assert {"Cabin:c1:1:guard", "Door:d1:2:guard"} <= set(found)
    assert found["Door:d1:2:guard"] == ["model check"]  # dropped: no clean run contradicts it, but d2 excludes d1


def test_messages_lost_and_doubled_on_the_way_are_noticed(tmp_path: Path) -> None:
    found = outcomes("examples/lift", "--target", "channels", "--operators", "drop,duplicate", out=tmp_path)
    assert {"component cases", "golden twin"} <= set(found["request:Cabin:1:drop"])
    assert len(found) == 10


def test_the_simulation_of_a_campaign_is_mutated_and_judged_by_its_oracles(tmp_path: Path) -> None:
    only = (
        "--only",
        "parking:drive",
        "--operators",
        "arithmetic",
        "--cases",
        "40",
        "--twin-cases",
        "0",
        "--sample",
        "6",
    )
    found = outcomes("examples/parking", *only, out=tmp_path)
    assert len(found) == 6 and ["campaign oracles", "golden twin"] in found.values()


def test_a_study_says_which_files_are_mutated(tmp_path: Path) -> None:
    for file in Path("examples/lift").iterdir():
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "gear.py").write_text("def ratio(n):\n    return 2 * n\n")
    with (tmp_path / "study.yaml").open("a") as study:
        study.write("mutants: [gear.py]\n")
    run = CliRunner().invoke(parcours, ["mutate", str(tmp_path), "--list"])
    assert run.exit_code == 0 and "gear:ratio:1:arithmetic  gear.py:2" in run.output and "lift:" not in run.output


def test_another_criterion_selects_other_cases(tmp_path: Path) -> None:
    only = (
        "--only",
        "Cabin.__init__:2",
        "--operators",
        "off by one",
        "--twin-cases",
        "0",
        "--cases",
        "1",
        "examples/lift",
    )
    edge, pair = (outcomes(*only, "--criterion", name, out=tmp_path / name) for name in ("edge", "edge-pair"))
    assert edge == {"lift:Cabin.__init__:2:off-by-one": ["component cases", "conformance", "golden twin"]}
    assert pair == {"lift:Cabin.__init__:2:off-by-one": ["component cases", "golden twin"]}  # at its first step


def test_mutants_that_die_or_never_end_are_noticed_and_cost_only_themselves(tmp_path: Path) -> None:
    for name in ("study.yaml", "model.yaml", "domains.yaml"):
        (tmp_path / name).write_bytes(Path("examples/lift", name).read_bytes())
    text = Path("examples/lift/lift.py").read_text().replace(
        '        return took("p1", request=message)',
        """        n = 0
        while n < 3:
            n = n + 1
        if message["floor"] < 0:
            os._exit(3)
        return took("p1", request=message)""",
    )  # fmt: skip
    (tmp_path / "lift.py").write_text(text.replace("from parcours.study", "import os\nfrom parcours.study"))
    run = CliRunner().invoke(
        parcours,
        ["mutate", str(tmp_path), "--only", "Panel.call", "--operators", "relation,stale", "--twin-cases", "0",
         "--workers", "2", "--out", str(tmp_path / "out"), "--json"],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    found = {one["id"]: (one["end"], one["seen"]) for one in json.loads(run.stdout)["mutants"]}
    end, seen = found["lift:Panel.call:1:stale"]  # n = n + 1 left out
    assert end == "timeout" and "its loops go round and round" in seen["component cases"][1]
    end, seen = found["lift:Panel.call:3:relation"]  # floor <= 0
    assert end == "died" and "ended with exit code 3" in seen["component cases"][1]
    assert found["lift:Panel.call:1:relation"][0] == "ended"


def patient_lift(folder: Path) -> Path:
    """Copy the lift; only a formula of its model says how long the door waits."""
    lift = folder / "lift"
    shutil.copytree("examples/lift", lift)
    model = (lift / "model.yaml").read_text()
    (lift / "model.yaml").write_text(re.sub(r"close\([0-9.]+\)", "close", model))
    return lift


def test_a_survivor_says_in_which_field_of_which_message_it_parts_from_the_original(tmp_path: Path) -> None:
    arguments = [
        str(patient_lift(tmp_path)),
        "--only",
        "Cabin.request:1:constant",
        "--no-data-oracles",
        "--twin-cases",
        "0",
        "--workers",
        "1",
    ]
    run = CliRunner().invoke(parcours, ["mutate", *arguments, "--out", str(tmp_path / "out"), "--json"])
    assert run.exit_code == 0, run.output
    [one] = json.loads(run.stdout)["mutants"]
    assert one["seen_by"].startswith("close.hold is ") and "; in lift/ITP" in one["seen_by"]


def test_suites_are_compared_on_the_same_mutants_beside_as_many_random_tests(tmp_path: Path) -> None:
    study = find(str(patient_lift(tmp_path)))
    assert isinstance(study, ComponentStudy)
    settings = settings_of(study.parameters, {}, study.name)
    request = MutationRequest([settings], "code", 0, only="Cabin.request", workers=1)
    suites = (Suite("edge", "each_choice"), Suite("edge", "each_choice", data=False), Suite("random", "random"))
    found, interrupted = compare(study, request, tmp_path, lambda what, done, n: None, suites)
    rows = {str(row[0]): row for row in found.table().rows}
    assert not interrupted and set(rows) == {"edge+each_choice", "edge+each_choice+no-data", "random+random"}
    judged, unjudged = (found.noticed(suite) for suite in suites[:2])
    assert {"lift:Cabin.request:1:constant"} <= judged - unjudged and unjudged < judged <= found.effective()
    assert rows["edge+each_choice"][1:3] == (8, 8)
    assert 0 < int(str(rows["random+random"][2])) <= int(str(rows["random+random"][1])) <= 8
    assert len(list(tmp_path.glob("kernels-*"))) <= 1


def test_random_walks_end_where_a_test_may_and_are_the_same_for_a_seed() -> None:
    study = find("ramp_components")
    assert isinstance(study, ComponentStudy)
    cases = random_cases(study.model, 3)
    assert list(cases) == list(random_cases(study.model, 3)) != list(random_cases(study.model, 4))
    for case in list(cases.values())[:50]:
        for _, path in case.combination.references:
            assert path.is_closed
    first = [case.interaction.name for case in cases.values()][: len({one.interaction.name for one in cases.values()})]
    assert len(set(first)) == len(first)  # every interaction is as likely, whatever its number of cases


def test_a_suite_without_data_oracles_keeps_its_cases_and_no_formula() -> None:
    study = find("ramp_components")
    assert isinstance(study, ComponentStudy)
    bare = with_suite(study, Suite(data=False))
    assert isinstance(bare, ComponentStudy)
    assert not any(True for _ in clauses(bare.model)) and any(True for _ in clauses(study.model))
    assert [case.id for case in bare.suite({}, 5)] == [case.id for case in study.suite({}, 5)]


def test_a_mixed_suite_has_the_same_abstract_cases_and_its_first_are_of_all_interactions() -> None:
    study = find("ramp_components")
    assert isinstance(study, ComponentStudy)
    mixed = with_suite(study, Suite("edge-pair", mixed=True), 2)
    assert isinstance(mixed, ComponentStudy)
    plain = with_suite(study, Suite("edge-pair"))
    assert isinstance(plain, ComponentStudy) and set(mixed.abstracts) == set(plain.abstracts)
    assert len({case.interaction.name for case in list(mixed.abstracts.values())[:6]}) == 6


def test_a_trace_parts_from_another_in_a_transition_a_field_or_what_no_model_names() -> None:
    class Plain:
        def flatten(self, channel: str, payload: object) -> list[object]:
            return [payload]

    def trace(*payloads: object) -> Trace:
        return Trace(
            "simulated", tuple(TraceEvent(k, "send", "A", "", "c", k, "", one) for k, one in enumerate(payloads))
        )

    def parts(one: Trace, other: Trace, view: object = lambda channel, payload: payload) -> str:
        return difference_of(one, other, Plain(), view)  # type: ignore[arg-type]

    before = {"points": [{"v": 1.0}, {"v": 2.0}]}
    assert parts(trace(before), trace(before)) == ""
    assert parts(trace(before), trace({"points": [{"v": 1.0}, {"v": 3.0}]})) == "c.points[1].v is 3.0, was 2.0"
    assert parts(trace(before), trace({"points": [{"v": 1.0}]})) == "c.points has 1 items, had 2"
    assert parts(trace(before), trace(before, before)) == "A send c in the place of nothing"
    assert parts(trace(1), trace(2), lambda channel, payload: {"v": 0}) == "c: in what the model does not name"
    assert fact_of((("x", "1"), ("y", "2")), (("x", "1"), ("y", "3"))) == "y is 3, was 2"


class Talking:
    """A study of another kind whose cases 0 and 100 show their messages."""

    name = kind = doc = where = family = "talking"
    parameters = ()

    def suite(self, settings: object, seed: int, n: int | None = None) -> object:
        return (Case("talking", k, "a", k, (), (), 1.0, seed) for k in range(n or 300))

    def judge(self, case: Case, settings: object) -> Judged:
        return Judged(case, Verdict.PASS, "", (), "")

    def show(self, case: Case, settings: object) -> Judged:
        return Judged(case, Verdict.FAIL if case.number else Verdict.PASS, "a message is wrong", (), "")


def test_sampled_cases_of_a_study_that_shows_messages_are_a_stage_of_their_own() -> None:
    subject = AnyStudy(Talking(), {}, 0)  # type: ignore[arg-type]
    assert subject.stages == ("campaign oracles", "system messages")
    cases = list(subject.cases(101))
    said = [subject.observe(cases[k]).noticed for k in (0, 1, 100)]
    assert said[0] == {"campaign oracles": "", "system messages": ""}
    assert said[1] == {"campaign oracles": ""}
    assert said[2] == {"campaign oracles": "", "system messages": "fail: a message is wrong"}
    assert subject.observe(cases[100], judged=False).noticed == {"campaign oracles": ""}
    assert isinstance(find("ramp_system"), Showing)
