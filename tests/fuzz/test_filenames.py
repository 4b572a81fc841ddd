"""Whatever a thing is called, its file lies in the folder it belongs to, and no two things share one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as st

from parcours.cli.model import command as model_command
from parcours.filenames import LONGEST, file_name
from parcours.run.binding.slots import ProcessSlot
from parcours.run.binding.structure import NodeProcess
from parcours.run.hosts.foreign import host as foreign_host
from parcours.study.components.archive import Archive
from parcours_navigation.foreign.recorded import recording_place
from parcours_ramp.components.study import component_study

ESCAPE = "x/../../../../OUTSIDE"
NAMES = st.one_of(
    st.text(),
    st.text("./~%-2FE\\\0 \n", max_size=8),
    st.text("ab/~", min_size=140, max_size=160),
    st.text("é", min_size=70),
)


@given(NAMES)
@example("..")
@example("/etc/passwd")
@example("a" * LONGEST + "/../x")
@example("\ud800")
def test_a_file_of_any_name_lies_in_its_folder_and_can_be_made(name: str) -> None:
    written = file_name(name)
    assert written not in ("", ".", "..") and not {"/", "\\", "\0", "\n"} & set(written)
    assert (Path("/folder") / written).parent == Path("/folder")
    assert len(written.encode()) <= LONGEST


@given(st.lists(NAMES, max_size=20, unique=True))
@example(["a/b", "a~b", "a%7Eb", "a%2Fb", ".a", "%2Ea", "", "%", "A", "a"])
@example(["a" * LONGEST, "a" * (LONGEST + 1), "a" * (LONGEST + 2), file_name("a" * (LONGEST + 2))])
def test_no_two_names_share_a_file(names: list[str]) -> None:
    assert len(set(map(file_name, names))) == len(names)


@pytest.mark.parametrize("name", ["Planner-motion", "main loop", "Sensor#1", "ITP4-tp11.tp41+tp42-3.0", "Über.v2"])
def test_an_ordinary_name_stays_as_it_is(name: str) -> None:
    assert file_name(name) == name


def test_pictures_of_a_model_stay_in_their_folder(tmp_path: Path) -> None:
    file, folder = tmp_path / "model.yaml", tmp_path / "deep" / "er" / "pictures"
    file.write_text(
        "parcours: model/1\nname: m\ncomponents:\n  C:\n    machines:\n"
        + "".join(
            f"      '{name}': {{initial: a, states: [a, b], transitions: {{t{n}: {{from: a, to: b}}}}}}\n"
            for n, name in enumerate((ESCAPE, "x~..~..~..~..~OUTSIDE"))
        )
    )
    done = CliRunner().invoke(model_command, ["show", str(file), "--svg", str(folder)])
    assert done.exit_code == 0, done.output
    made = list(tmp_path.rglob("*.svg"))
    assert len(made) == 2 and {path.parent for path in made} == {folder}


def test_recordings_of_component_cases_stay_in_their_folder_and_apart(tmp_path: Path) -> None:
    archive = Archive(component_study(), tmp_path / "recordings", "mcap", "here", {})
    paths = {archive.path("functional", id) for id in (ESCAPE, "s/a-b/0", "s/a/b-0", "s-a-b/0")}
    assert len(paths) == 4 and {path.parent for path in paths} == {tmp_path / "recordings"}


def test_recordings_of_foreign_cases_stay_in_their_folder_and_apart() -> None:
    places = {recording_place(id, "bag") for id in ("../" + ESCAPE, "a_b/0", "a/b/0", "a/b_0")}
    assert len(places) == 4 and {Path(place).parent for place in places} == {Path("recordings")}


def test_output_of_foreign_nodes_stays_in_its_folder_and_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    logs: list[Path] = []

    def process(name: str, command: object, cwd: Path, env: object, log: Path, priority: int) -> Any:
        logs.append(log)
        return SimpleNamespace(descriptor=0, await_start=lambda: None, is_alive=True)

    monkeypatch.setattr(foreign_host, "KeptProcess", process)
    host = object.__new__(foreign_host.ForeignHost)
    host.folder, host.running = tmp_path, {}
    graph = SimpleNamespace(environment={}, arguments=lambda slot: (), watch=lambda descriptor, look: None)
    host.graph = cast(Any, graph)
    host.start([ProcessSlot(name, NodeProcess(name, (), ("run",))) for name in (ESCAPE, "Node#1", "Node_1")])
    assert len(set(logs)) == 3 and {log.parent for log in logs} == {tmp_path}
