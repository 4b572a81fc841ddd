from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import pytest

from parcours import kernels
from parcours.study import judge_case
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.suite import Case, write_suite
from parcours.suite.exporting import to_pytest
from parcours.verdict.judgement import Verdict


def suite_of(name: str, n_cases: int) -> list[Case]:
    study = find(name)
    return list(study.suite(settings_of(study.parameters, {}), 1, n_cases))


def run(folder: Path, *arguments: str, code: int) -> str:
    """Run pytest in a folder of its own, with the plugin, and return what it printed."""
    command = [sys.executable, "-m", "pytest", "-p", "parcours.pytest_plugin", "-p", "no:cacheprovider", *arguments]
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_one_item_a_case_named_by_its_abstract_case_and_judged_as_by_the_study(tmp_path: Path) -> None:
    verdicts = {case.id: judge_case(case).verdict for case in suite_of("ramp_system", 12)}
    assert set(verdicts.values()) >= {Verdict.PASS, Verdict.FAIL}
    (tmp_path / "test_other.py").write_text("def test_other(): pass\n")
    report = tmp_path / "report.xml"
    study = ("--parcours-study", "ramp_system", "--parcours-cases", "12")
    printed = run(tmp_path, *study, f"--junitxml={report}", code=1)
    listed = {}
    for case in ET.parse(report).getroot().iter("testcase"):
        outcome = next((child.tag for child in case if child.tag != "properties"), "pass")
        listed[f"{case.get('classname')}/{case.get('name')}"] = outcome
    assert listed.keys() == verdicts.keys()  # and test_other.py was not asked for
    words = {Verdict.PASS: "pass", Verdict.FAIL: "failure", Verdict.INCONCLUSIVE: "skipped"}
    assert listed == {id: words[verdict] for id, verdict in verdicts.items()}
    failed = next(id for id, verdict in verdicts.items() if verdict is Verdict.FAIL)
    assert f"case    {failed}" in printed and "parcours replay out" in printed
    again = next(line for line in printed.splitlines() if "again" in line and failed.partition("/")[2] in line)
    assert "--parcours-seed 1" in again and "Traceback" not in printed
    one = again.partition("pytest ")[2].split()
    alone = run(tmp_path, *one, code=1)
    assert "1 failed" in alone and "passed" not in alone and f"case    {failed}" in alone


def test_a_suite_file_is_collected_beside_the_files_named_and_k_and_n_hold_for_it(tmp_path: Path) -> None:
    write_suite(tmp_path / "suite.jsonl", suite_of("ramp_components", 9))
    (tmp_path / "test_other.py").write_text("def test_other(): pass\n")
    printed = run(
        tmp_path, "test_other.py", "--parcours-suite", "suite.jsonl", "-k", "ITP1 or other", "-rA", "-q",
        "-p", "xdist", "-n", "2", code=0,
    )  # fmt: skip
    assert "PASSED test_other.py::test_other" in printed
    assert "PASSED ramp_components::ITP1-tp12.tp21.tp12-0.0.0/0" in printed
    assert Counter(line.split("::")[0] for line in printed.splitlines() if line.startswith("PASSED"))[
        "PASSED ramp_components"
    ] == sum("ITP1" in case.abstract for case in suite_of("ramp_components", 9))


@pytest.mark.parametrize("options", [(), ("-q",), ("-p", "xdist", "-n", "1")])
def test_compiling_is_announced_before_it_begins_and_only_where_there_is_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    none = ("--parcours-study", "ramp_components", "--parcours-cases", "1", "-k", "none_of_them", *options)
    monkeypatch.setenv("PARCOURS_CACHE_DIR", str(tmp_path))
    assert run(tmp_path, *none, code=5).count("compiling for this machine first") == 1
    if options:
        return
    assert "compiling for" not in run(tmp_path, *none, "--collect-only", code=5)
    folder = kernels.kernel_cache.__wrapped__()
    folder.mkdir(exist_ok=True)
    (folder / "some.nbc").touch()
    assert "compiling for" not in run(tmp_path, *none, code=5)


def test_a_session_that_does_not_ask_loads_nothing_of_it(tmp_path: Path) -> None:
    (tmp_path / "test_other.py").write_text(
        "import sys\n\ndef test_other():\n    loaded = [name for name in sys.modules if name.startswith('parcours.')]\n"
        "    assert loaded == ['parcours.pytest_plugin'] and 'numpy' not in sys.modules\n"
    )
    assert "1 passed" in run(tmp_path, code=0)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--parcours-study", "ramp_sytem"), "did you mean 'ramp_system'"),
        (("--parcours-study", "ramp_system", "--parcours-cases", "0"), "case-count"),
        (("--parcours-study", "ramp_components", "--parcours-set", "schedule=guarded"), "parameter-unknown"),
        (("--parcours-study", "ramp_system", "--parcours-set", "schedule=fast"), "parameter-choice"),
        (("--parcours-study", "ramp_system", "--parcours-set", "guarded"), "parameter-form"),
        (("--parcours-study", "ramp_components", "--parcours-case", "ITP9"), "case-unknown"),
        (("--parcours-suite", "nowhere.jsonl"), "unreadable-file"),
    ],
)
def test_a_mistake_is_a_usage_error(tmp_path: Path, arguments: tuple[str, ...], says: str) -> None:
    printed = run(tmp_path, *arguments, code=4)
    assert says in printed and "Traceback" not in printed


def test_an_exported_script_runs_by_itself_and_tells_the_same_verdicts(tmp_path: Path) -> None:
    cases = suite_of("ramp_system", 6)
    (tmp_path / "test_suite.py").write_text(to_pytest(cases, "test_suite.py", settings={"schedule": "guarded"}))
    count = Counter(judge_case(case, schedule="guarded").verdict for case in cases)
    failed = count[Verdict.FAIL]
    printed = run(tmp_path, "test_suite.py", "-q", code=1 if failed else 0)
    assert f"{count[Verdict.PASS]} passed" in printed
    assert f"test_case[{cases[0].id}]" in run(tmp_path, "test_suite.py", "--collect-only", "-q", code=0)
