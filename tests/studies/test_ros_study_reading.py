"""A study.yaml of kind ros, read without ROS: what is wrong with it is said, and its suite is known."""

from __future__ import annotations

import re
import shutil
from pathlib import Path, PurePosixPath

import pytest

from parcours.errors import BadRequest
from parcours.study.copying import from_template, templates, write_new
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours_navigation.foreign.door import RosStudy

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros1_python"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return shutil.copytree(EXAMPLE, tmp_path / "robot")


def _write(folder: Path, *lines: str) -> None:
    (folder / "study.yaml").write_text("\n".join(["parcours: study/1", "name: robot", "kind: ros", *lines]) + "\n")


def test_its_suite_has_the_abstract_cases_then_the_system_cases(folder: Path) -> None:
    _write(folder, "cases: 2", "system: 3")
    study = find(str(folder))
    cases = list(study.suite(settings_of(study.parameters, {}), 7))
    assert [case.id.partition("/")[2] for case in cases[2:]] == ["system/0", "system/1", "system/2"]
    assert [case.number for case in cases] == [0, 1, 2, 3, 4]
    assert len(cases[2].values) > 0
    assert cases[2].values != cases[3].values


def test_settings_are_other_defaults(folder: Path) -> None:
    _write(folder, "settings: {protocol: empty, repeats: 5, record: bag}")
    found = settings_of(find(str(folder)).parameters, {"repeats": "6"})
    assert (found["protocol"], found["repeats"], found["record"]) == ("empty", 6, "bag")


def test_its_results_depend_on_binding_model_and_nodes(folder: Path) -> None:
    study = find(str(folder))
    assert isinstance(study, RosStudy)
    named = {"study.yaml", "binding.yaml", "model.yaml", "obstacle_filter.py", "avoider.py", "follower.py"}
    assert set(study.digests) == named
    assert study.files == {"model": folder / "model.yaml"}


@pytest.mark.parametrize(
    ("lines", "line", "said"),
    [
        (["binding: bindin.yaml"], 4, "there is no"),
        (["settings: {host: ros1}"], 4, "there is no parameter 'host'"),
        (["settings: {repeats: -1}"], 4, "must be from 0"),
        (["settings: {protocol: [a]}"], 4, "must be a single value"),
        (["cases: many"], 4, "cases must be an integer"),
        (["parameters: {speed: {default: 1.0}}"], 4, "has no parameters of its own"),
        (["nodes: 3"], 4, "nodes"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(folder: Path, lines: list[str], line: int, said: str) -> None:
    _write(folder, *lines)
    with pytest.raises(BadRequest, match=rf"study.yaml(?s:.*){line}.*{re.escape(said)}"):
        find(str(folder))


def test_system_cases_need_their_section(folder: Path) -> None:
    text = (folder / "binding.yaml").read_text()
    (folder / "binding.yaml").write_text(text[: text.index("\nsystem:")])
    _write(folder, "system: 1")
    with pytest.raises(BadRequest, match="foreign-system"):
        find(str(folder))


def test_findings_of_the_binding_are_the_study_s(folder: Path) -> None:
    text = (folder / "binding.yaml").read_text()
    (folder / "binding.yaml").write_text(text.replace("  goal:\n    topic", "  gaol:\n    topic"))
    with pytest.raises(BadRequest, match=r"binding.yaml.*\n.*did you mean 'goal'"):
        find(str(folder))


def test_a_study_without_any_case_is_refused(tmp_path: Path) -> None:
    contents = from_template(templates()["ros"], "robot")
    place = PurePosixPath("model.yaml")
    contents[place] = contents[place].partition(b"\ninteractions:")[0] + b"\n"
    write_new(tmp_path / "robot", contents, frozenset())
    with pytest.raises(BadRequest, match="no-abstract-cases"):
        find(str(tmp_path / "robot"))
