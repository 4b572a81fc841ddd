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
from parcours.study.mutation.mutant import sampled
from parcours.study.mutation.source import Module, Sources

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
        "--twin",
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
    arguments = ["mutate", str(lift), "--sample", "0", "--twin", "8", "--workers", "2", "--out", str(tmp_path / "out")]
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
    found = outcomes("examples/lift", "--of", "model", "--operators", "message,guard", out=tmp_path)
    assert found["Panel:p1:1:message"] == ["conformance"]  # request dropped
    assert {"Cabin:c1:1:guard", "Door:d1:2:guard"} <= set(found)
    assert found["Door:d1:2:guard"] == ["model check"]  # dropped: no clean run contradicts it, but d2 excludes d1


def test_messages_lost_and_doubled_on_the_way_are_noticed(tmp_path: Path) -> None:
    found = outcomes("examples/lift", "--of", "channels", "--operators", "drop,duplicate", out=tmp_path)
    assert {"component cases", "golden twin"} <= set(found["request:Cabin:1:drop"])
    assert len(found) == 10


def test_the_simulation_of_a_campaign_is_mutated_and_judged_by_its_oracles(tmp_path: Path) -> None:
    only = ("--only", "parking:drive", "--operators", "arithmetic", "--cases", "40", "--twin", "0", "--sample", "6")
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
    only = ("--only", "Cabin.__init__", "--operators", "off by one", "--twin", "0", "examples/lift")
    edge, pair = (outcomes(*only, "--paths", name, out=tmp_path / name) for name in ("edge", "edge-pair"))
    assert set(edge) == set(pair)
    assert {"component cases", "golden twin"} <= set(pair["lift:Cabin.__init__:2:off-by-one"])


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
        ["mutate", str(tmp_path), "--only", "Panel.call", "--operators", "relation,stale", "--twin", "0",
         "--workers", "2", "--out", str(tmp_path / "out"), "--json"],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    found = {one["id"]: (one["end"], one["seen"]) for one in json.loads(run.stdout)["mutants"]}
    end, seen = found["lift:Panel.call:1:stale"]  # n = n + 1 left out
    assert end == "timeout" and "its loops go round and round" in seen["component cases"][1]
    end, seen = found["lift:Panel.call:3:relation"]  # floor <= 0
    assert end == "died" and "ended with exit code 3" in seen["component cases"][1]
    assert found["lift:Panel.call:1:relation"][0] == "ended"
