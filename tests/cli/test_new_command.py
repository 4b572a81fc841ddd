"""`parcours new`: what it writes passes at once, fails when it is broken, and overwrites nothing."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest
from parcours.study.copying import templates, write_new
from parcours.study.finding import find


def _call(*arguments: object) -> Result:
    return CliRunner().invoke(parcours, [str(one) for one in arguments])


def _passes(*arguments: object) -> Result:
    result = _call(*arguments)
    assert result.exit_code == 0, (result.output, result.exception)
    return result


def test_every_kind_of_study_has_a_template() -> None:
    assert {"components", "process", "planner", "ros"} <= set(templates())


@pytest.mark.parametrize("kind", ["components", "process"])
def test_a_new_study_passes_at_once(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "mine"
    written = _passes("new", folder, "--kind", kind).stdout
    assert all(f"wrote {one}" in written for one in folder.iterdir())
    assert "mine: 0 errors, 0 warnings" in _passes("study", "check", folder).stdout
    assert "8 of 8" in _passes("run", folder, "--out", tmp_path / "out").stdout


def test_a_new_planner_passes_its_first_cases(tmp_path: Path) -> None:
    _passes("new", tmp_path / "mine", "--kind", "planner")
    _passes("run", tmp_path / "mine", "--cases", 2, "--workers", 1, "--out", tmp_path / "out")


def test_a_new_ros_study_has_a_binding_without_findings(tmp_path: Path) -> None:
    _passes("new", tmp_path / "mine", "--kind", "ros")
    study = find(str(tmp_path / "mine"))
    ids = [case.id for case in study.suite({one.name: one.default for one in study.parameters}, 1)]
    assert (study.kind, ids) == ("ros", ["mine/detections_to_near-tp11.tp21-0.0/0"])


@pytest.mark.parametrize(
    ("kind", "file", "old", "new", "why"),
    [
        ("components", "crossing.py", "20.0 if", "8.0 if", "but is 8.0"),
        ("components", "crossing.py", 'slow = message["needed"] > 10.0', "slow = False", "expected l2, got l1"),
        ("process", "light.py", "20.0 if", "8.0 if", "but is 8.0"),
    ],
)
def test_it_fails_when_it_is_broken(tmp_path: Path, kind: str, file: str, old: str, new: str, why: str) -> None:
    _passes("new", tmp_path / "mine", "--kind", kind)
    text = (tmp_path / "mine" / file).read_text()
    assert text.count(old) == 1
    (tmp_path / "mine" / file).write_text(text.replace(old, new))
    result = _call("run", tmp_path / "mine", "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert why in result.stdout


def test_the_program_of_a_process_study_imports_nothing_of_parcours(tmp_path: Path) -> None:
    _passes("new", tmp_path / "mine", "--kind", "process")
    imported = [line for line in (tmp_path / "mine/light.py").read_text().splitlines() if "import" in line]
    assert imported == ["import json", "import sys"]


def test_nothing_that_is_there_is_overwritten_and_nothing_else_is_written(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text("mine")
    result = _call("new", tmp_path)
    assert isinstance(result.exception, BadRequest)
    assert "it holds study.yaml" in str(result.exception)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("study.yaml", "mine")]


def test_what_cannot_be_written_in_full_is_not_written_at_all(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("a file where a folder is needed")
    contents = {PurePosixPath("a"): b"1", PurePosixPath("c/d"): b"2", PurePosixPath("b/c"): b"3"}
    with pytest.raises(BadRequest, match="must be writable"):
        write_new(tmp_path, contents, frozenset())
    assert [one.name for one in tmp_path.iterdir()] == ["b"]


@pytest.mark.parametrize(
    ("folder", "name"), [("a b", "a_b"), ("42", "42"), ("no", "no"), ("Größe", "Groe"), (".x", "x")]
)
def test_the_name_of_the_folder_is_made_fit_for_ids(tmp_path: Path, folder: str, name: str) -> None:
    _passes("new", tmp_path / folder)
    assert find(str(tmp_path / folder)).name == name


def test_a_folder_called_like_a_registered_study_is_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "parcours run ./ramp_system --out" in _passes("new", "ramp_system").stdout


def test_an_unknown_kind_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    result = _call("new", tmp_path / "mine", "--kind", "robot")
    assert result.exit_code == 2
    assert "'components'" in result.stderr
    assert not (tmp_path / "mine").exists()
