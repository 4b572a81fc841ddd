"""`parcours example`: all that ships is listed, and a copy needs none of its neighbours."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest
from parcours.study.copying import tree
from parcours.study.examples import contents_of, examples

ROOT = Path(__file__).parents[2] / "examples"


def _call(*arguments: object) -> Result:
    return CliRunner().invoke(parcours, [str(one) for one in arguments])


def test_all_examples_are_listed_with_a_sentence_each() -> None:
    listed = json.loads(_call("example", "--json").stdout)
    assert {one["name"] for one in listed} == {path.stem for path in ROOT.iterdir()}
    assert [one["name"] for one in listed if len(one["doc"].split()) < 5] == []


@pytest.mark.parametrize("name", [path.stem for path in sorted(ROOT.iterdir())])
def test_a_copy_refers_to_nothing_outside_of_its_folder(name: str) -> None:
    contents = contents_of(examples()[name])
    for place, content in contents.items():
        if place.suffix == ".yaml":
            lines = [line for line in content.decode().splitlines() if not line.lstrip().startswith("#")]
            assert [line for line in lines if "../" in line] == [], place
            named = re.findall(r"(?m)^(?:model|data|binding): *(\S+)$", "\n".join(lines))
            assert {place.parent / one for one in named} <= set(contents)


@pytest.mark.parametrize("name", ["lift", "lift_threads", "lift_perl"])
def test_a_copied_study_passes_alone(tmp_path: Path, name: str) -> None:
    copied = _call("example", name, tmp_path / "copy")
    assert f"parcours run {tmp_path / 'copy'} --out" in copied.stdout
    result = _call("run", tmp_path / "copy", "--out", tmp_path / "out")
    assert result.exit_code == 0, (result.output, result.exception)


def test_what_was_built_is_no_part_of_an_example(tmp_path: Path) -> None:
    for name in ("__pycache__", "build"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.txt").touch()
    (tmp_path / "program").write_bytes(b"\x7fELF\x02\x01")
    (tmp_path / ".hidden").touch()
    (tmp_path / "source.c").touch()
    assert [str(place) for place in tree(tmp_path)] == ["source.c"]


def test_without_a_folder_it_takes_the_name_and_never_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert _call("example", "lift").exit_code == 0
    before = (tmp_path / "lift/lift.py").stat()
    again = _call("example", "lift")
    assert isinstance(again.exception, BadRequest)
    assert "lift.py" in str(again.exception)
    assert (tmp_path / "lift/lift.py").stat() == before


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    result = _call("example", "lfit")
    assert isinstance(result.exception, BadRequest)
    assert "did you mean 'lift'?" in str(result.exception)
