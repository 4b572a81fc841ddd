"""Studies that are Python objects or registered by packages; and what their tester chooses so that guards hold."""

from __future__ import annotations

import importlib.metadata
import itertools
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest
from parcours.model.model_file import parse_model
from parcours.run.recording import read_recording
from parcours.study import Request, finding
from parcours.study.components.study import ComponentStudy
from parcours.study.finding import find, registered
from parcours.study.parameters import settings_of
from parcours.verdict.judgement import Verdict

LIFT = Path(__file__).parents[2] / "examples" / "lift"

OBJECTS = """
from pathlib import Path
import lift
from parcours.data import read_input_model
from parcours.model import read_model
from parcours.study.components.study import ComponentStudy
from parcours.study.components.systems import python_system

HERE = Path(__file__).parent
STUDY = ComponentStudy(
    "lift", read_model(HERE / "model.yaml"), python_system(Panel=lift.Panel, Cabin=lift.Cabin, Door=lift.Door),
    read_input_model(HERE / "domains.yaml"),
)

def made():
    return STUDY

class Kept:
    study = STUDY

class Half:
    name, kind, parameters = "half", "campaign", ()
    def suite(self, settings, seed, n_cases=None): return iter(())

HALF, NOTHING = Half(), None
def raises(): raise ValueError("no study today")
"""


@pytest.fixture
def lift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a lift of one's own, with a study as an object beside it, in the current folder."""
    folder = Path(shutil.copytree(LIFT, tmp_path / "lift", ignore=shutil.ignore_patterns("__pycache__")))
    (folder / "objects.py").write_text(OBJECTS)
    monkeypatch.chdir(folder)
    monkeypatch.delitem(sys.modules, "lift", raising=False)  # of another test's folder
    yield folder
    sys.modules.pop("lift", None)


def call(*words: object) -> Result:
    return CliRunner().invoke(parcours, [str(word) for word in words])


def verdicts(given: str, out: Path, **settings: object) -> list[tuple[str, Verdict, str]]:
    study = find(given)
    study.run(Request(settings_of(study.parameters, settings), 1, out), lambda what, done, total: None)
    return [(one.id, one.verdict, one.why) for one in study.read(out).cases()]


@pytest.mark.parametrize(
    "given", ["objects.py:STUDY", "{}/objects.py:STUDY", "objects.py:made", "objects.py:Kept.study"]
)
def test_an_object_gives_what_its_study_file_gives(given: str, lift: Path) -> None:
    given = given.format(lift)
    assert verdicts(given, lift / "out") == verdicts(str(lift), lift / "other")
    study = find(given)
    assert isinstance(study, ComponentStudy) and study.where == str(lift / given.rpartition("/")[2])
    assert call("report", lift / "out").exit_code == 0
    assert call("replay", lift / "out", 2).exit_code == 0


def test_the_components_of_an_object_are_found_by_nodes(lift: Path) -> None:
    assert verdicts("objects.py:STUDY", lift / "out", host="processes") == verdicts("objects.py:STUDY", lift / "other")


def test_the_results_of_an_object_depend_on_the_files_loaded_with_it(lift: Path) -> None:
    assert call("run", "objects.py:STUDY", "--out", "out").exit_code == 0
    study = find("objects.py:STUDY")
    assert isinstance(study, ComponentStudy) and {"objects.py", "lift.py"} <= set(study.digests)


def test_two_studies_whose_neighbours_have_one_name_have_each_its_own(lift: Path) -> None:
    other = Path(shutil.copytree(lift, lift.parent / "other"))
    (other / "lift.py").write_text((other / "lift.py").read_text().replace("def d3(self)", "def d4(self)"))
    assert {verdict for _, verdict, _ in verdicts(f"{lift}/objects.py:STUDY", lift / "out")} == {Verdict.PASS}
    assert Verdict.FAIL in {verdict for _, verdict, _ in verdicts(f"{other}/objects.py:STUDY", other / "out")}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("objects.py:HALF", "but Half lacks run, read, report, judge; see docs/studies.md [study-form]"),
        ("objects.py:NOTHING", "but NoneType lacks name, kind"),
        ("objects.py:STUDI", "'STUDI' must be defined there, but is not; did you mean 'STUDY'?"),
        ("objects.py:Kept.studi", "did you mean 'study'?"),
        ("objects.py:raises", "ValueError"),
    ],
)
def test_what_is_no_study_says_what_it_lacks(given: str, says: str, lift: Path) -> None:
    refused = call("run", given, "--out", "out").exception
    assert isinstance(refused, BadRequest) and says in str(refused)
    assert not (lift / "out").exists()


# Packages that register studies


@dataclass
class Package:
    name: str


def register(monkeypatch: pytest.MonkeyPatch, **targets: str) -> None:
    points = []
    for name, target in targets.items():
        point = EntryPoint(name, target, finding.GROUP)
        object.__setattr__(point, "dist", Package(f"package-of-{name}"))
        points.append(point)
    shipped = importlib.metadata.entry_points(group=finding.GROUP)

    def entry_points(group: str) -> Sequence[EntryPoint]:
        return [*shipped, *points] if group == finding.GROUP else importlib.metadata.entry_points(group=group)

    monkeypatch.setattr(finding, "entry_points", entry_points)


@pytest.fixture
def importable(lift: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (lift / "objects.py").rename(lift / "lift_objects_of_a_test.py")
    monkeypatch.syspath_prepend(str(lift))
    return lift


def test_a_registered_study_is_found_by_its_name_and_runs(importable: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    register(monkeypatch, elevator="lift_objects_of_a_test:STUDY")
    assert [one.package for one in registered() if one.name == "elevator"] == ["package-of-elevator"]
    assert find("elevator").where == "elevator"
    assert all(verdict is Verdict.PASS for _, verdict, _ in verdicts("elevator", importable / "out"))
    assert call("report", importable / "out").exit_code == 0
    with pytest.raises(BadRequest, match=r"did you mean 'elevator'"):
        find("elevatr")


def test_a_package_that_is_broken_is_named_and_hides_no_other(
    importable: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    register(monkeypatch, broken="no_such_module_at_all:STUDY", half="lift_objects_of_a_test:HALF")
    with pytest.raises(
        BadRequest, match=r"package-of-broken registers it as no_such_module_at_all:STUDY, .*ModuleNotFo"
    ):
        find("broken")
    listed = call("studies")
    assert listed.exit_code == 0 and "ramp_system" in listed.output
    assert "broken" in listed.output and "package-of-half" in listed.output
    assert call("run", "--help").exit_code == 0


# What the tester chooses


def test_guards_hold_in_every_case_by_what_the_tester_sends_and_sets(lift: Path) -> None:
    study = find(str(lift))
    assert isinstance(study, ComponentStudy)
    study.run(Request(settings_of(study.parameters, {"record": "mcap"}), 1, lift / "out", 24), lambda *said: None)
    taken: set[str] = set()
    for path in sorted((lift / "out" / "recordings").iterdir()):
        events = read_recording(path, study.recorded).trace.events
        floor = {one.component: 0 for one in events}
        for event, then in itertools.pairwise(events):
            if event.kind == "receive" and event.channel == "request" and then.kind == "take":
                wanted = event.payload["floor"]  # type: ignore[index]
                assert (wanted == floor[event.component]) == (then.transition == "c4"), path
                floor[event.component] = wanted
        taken |= {one.transition for one in events if one.kind == "take"}
    assert taken == {transition.id for part in study.model.components for transition in part.transitions()}


def test_test_inputs_reach_the_fields_of_their_names_unless_a_guard_forbids_it(lift: Path) -> None:
    study = find(str(lift))
    assert isinstance(study, ComponentStudy)
    free = forced = 0
    for case in study.plan(3, 40).cases():
        known = settings_of(study.parameters, {})
        tester = study.tester(case, known)
        taken = [one for one in study.visits(case, known).enforced if one.receives and one.receives.event is None]
        calls = [tester.supply(one) for one in taken if one.receives and one.receives.channel in ("call", "request")]
        wanted = int(case.values[case.names.index("floor")])
        assert all(isinstance(one, dict) and 0 <= one["floor"] <= 9 for one in calls)
        free += sum(one == {"floor": wanted} for one in calls)
        forced += sum(one != {"floor": wanted} for one in calls)
    assert free >= 10 and forced >= 5


@pytest.mark.parametrize(("unit", "warned"), [("ms", True), ("s", False)])
def test_a_test_input_in_another_unit_than_its_field_is_warned_of(lift: Path, unit: str, warned: bool) -> None:
    data = f"parcours: data/1\nname: lift\nparameters:\n  hold: {{unit: {unit}, edges: [0.5, 1, 9]}}\n"
    (lift / "domains.yaml").write_text(data)
    study = find(str(lift))
    assert isinstance(study, ComponentStudy)
    found = [one for one in study.check(lambda *_: None) if "given its values as they are" in one.rule]
    assert [one.where for one in found] == ["test input 'hold'"] * warned
    assert all("is in ms, but field Order.hold" in one.rule and one.level == "warning" for one in found)


NARROW = """
parcours: model/1
name: narrow
messages:
  Word: {fields: {word: {type: int}}}
channels:
  ask: {from: environment, to: Desk, message: Word}
  hand: {from: Desk, to: File, message: Word}
components:
  Desk:
    machines:
      m:
        initial: a
        transitions:
          d1: {from: a, to: a, event: ask(it), guard: it.word > 3, message: hand(it)}
  File:
    machines:
      m:
        initial: a
        transitions:
          f1: {from: a, to: a, event: hand(it), guard: it.word > 5}
          f2: {from: a, to: b, event: hand(it), guard: it.word < 2}
interactions: {ITP1: [Desk, File]}
"""


def test_cases_that_no_message_makes_run_are_left_out_with_the_guards_that_forbid_it(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(NARROW)
    (tmp_path / "desk.py").write_text(
        "from parcours.study import took\n"
        "class Desk:\n    def ask(self, it): return took('d1', hand=it)\n"
        "class File:\n    def hand(self, it): return took('f1' if it['word'] > 5 else 'f2')\n"
    )
    (tmp_path / "study.yaml").write_text("parcours: study/1\nname: narrow\nsystem: desk.py\npaths: node\n")
    study = find(str(tmp_path))
    assert isinstance(study, ComponentStudy) and parse_model(NARROW, "x").name == "narrow"
    results = verdicts(str(tmp_path), tmp_path / "out")
    assert results and all(verdict is Verdict.PASS for _, verdict, _ in results)
    assert study.infeasible and not set(study.infeasible) & set(study.abstracts)
    assert all("d1 [it.word > 3]" in why and "f2 [it.word < 2]" in why for why in study.infeasible.values())
    said = call("study", "check", tmp_path).output
    assert "is left out: " in said and "f2 [it.word < 2]" in said
