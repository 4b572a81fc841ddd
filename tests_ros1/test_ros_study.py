"""A study of kind ros: foreign nodes run, kept case by case, judged again, and checked for their author."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests_ros1.conftest import patient

from parcours.errors import BadRequest, HostFailure
from parcours.study import Request, Run, judge_case
from parcours.study.copying import from_template, templates, write_new
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Study
from parcours_navigation.foreign.isolation import ProcessOrder, run_apart

EXAMPLE = Path(__file__).parents[1] / "examples" / "ros1_python"


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """The study that `parcours new --kind ros` writes: two nodes, one case."""
    write_new(tmp_path / "small", from_template(templates()["ros"], "small"), frozenset())
    _edit(tmp_path / "small" / "binding.yaml", "quiescence: 1 s", "quiescence: 3 s")
    return tmp_path / "small"


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """A copy of the example with three nodes, a faster robot, and all the time that they may need."""
    folder = shutil.copytree(EXAMPLE, tmp_path / "large")
    _edit(folder / "binding.yaml", "/follower/speed: 0.25", "/follower/speed: 1.2")
    _edit(folder / "binding.yaml", "v_max: 0.25", "v_max: 1.2")
    _edit(folder / "binding.yaml", "quiescence: 1 s", "quiescence: 3 s")
    patient(folder / "binding.yaml")
    return folder


def _edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1, old
    file.write_text(text.replace(old, new))


def _run(study: Study, out: Path, n_cases: int | None = None, chosen: tuple[str, ...] = (), **given: object) -> Run:
    return study.run(Request(settings_of(study.parameters, given), 1, out, n_cases, chosen), _quiet)


def _quiet(what: str, done: int, total: int) -> None:
    """Report nothing."""


def _verdicts(study: Study, out: Path) -> dict[str, str]:
    return {one.id: str(one.verdict) for one in study.read(out).cases()}


def test_a_new_study_passes_and_its_recording_says_so_again(small: Path, tmp_path: Path) -> None:
    study = find(str(small))
    run = _run(study, tmp_path / "out", record="mcap")
    assert (run.interrupted, run.text) == (False, f"all 1 cases are finished in {tmp_path / 'out'}")
    id = "small/detections_to_near-tp11.tp21-0.0/0"
    assert _verdicts(study, tmp_path / "out") == {id: "pass"}
    [recording] = (tmp_path / "out" / "recordings").iterdir()
    again = study.rejudge(recording)
    assert (again.case, again.recorded, again.agrees) == (id, "pass", True)
    [table] = study.report({"out": study.read(tmp_path / "out")}).tables
    assert table.rows[0][0] == id


STEPS = """
constants: {far: 7.5}
before_case:
- {set: /tester/gap, formula: far * 2}
- {wait: /tester/gap, is: 15.0, timeout: 20 s}
- {call: /filter/set_logger_level, type: roscpp/SetLoggerLevel, timeout: 20 s,
   inject: {base: {logger: rosout, level: INFO}}}
- {publish: /tester/ready, type: std_msgs/Bool, inject: {set: {data: far > 7}}}
after_case:
- {wait: /tester/gap, is: 16, timeout: 1 s}
"""


def test_steps_are_done_between_cases_and_formulas_know_the_constants(small: Path, tmp_path: Path) -> None:
    file = small / "binding.yaml"
    _edit(file, "position.y: obstacle.y", "position.y: obstacle.y - far * 0")
    file.write_text(file.read_text() + STEPS.partition("after_case")[0])
    study = find(str(small))
    _run(study, tmp_path / "out")
    assert list(_verdicts(study, tmp_path / "out").values()) == ["pass"]
    file.write_text(file.read_text() + STEPS[STEPS.index("after_case") :])
    with pytest.raises(HostFailure, match=r"after_case: /tester/gap must become 16 within 1 s, but is 15\.0"):
        _run(find(str(small)), tmp_path / "again")


def test_a_node_that_is_silent_fails_its_case(small: Path, tmp_path: Path) -> None:
    _edit(small / "filter.py", "self.publisher.publish(kept)", "pass")
    study = find(str(small))
    _run(study, tmp_path / "out")
    assert list(_verdicts(study, tmp_path / "out").values()) == ["fail"]


def test_a_run_that_was_stopped_goes_on_where_it_was(
    large: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = find(str(large)), tmp_path / "out"
    orders: list[ProcessOrder] = []

    def noted(order: ProcessOrder) -> Iterator[dict[str, object]]:
        orders.append(order)
        return run_apart(order)

    def stopped(what: str, done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr("parcours_navigation.foreign.door.run_apart", noted)
    first = study.run(Request(settings_of(study.parameters, {}), 1, out, 2), stopped)
    assert first.interrupted
    assert len(_verdicts(study, out)) == 1
    assert study.read(out).planned == 2
    assert not _run(study, out, 2).interrupted
    assert list(_verdicts(study, out).values()) == ["pass", "pass"]
    assert [len(order.abstract) for order in orders] == [2, 1]
    _run(study, out, 2)
    assert len(orders) == 2  # nothing was left to do


def test_a_chosen_system_case_is_driven(large: Path, tmp_path: Path) -> None:
    study = find(str(large))
    _run(study, tmp_path / "out", chosen=("system/3",), protocol="empty")
    results = study.read(tmp_path / "out")
    assert _verdicts(study, tmp_path / "out") == {"small_navigation/system/3": "pass"}
    assert 0.0 < results.measures()["length"].values[0] < 20.0


def test_a_case_that_the_study_does_not_have_is_refused(large: Path, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=r"has no nothing/0, system\b.*case-unknown"):
        _run(find(str(large)), tmp_path / "out", chosen=("nothing/0", "system"))


def test_one_case_is_judged_like_that_of_any_study(small: Path) -> None:
    study = find(str(small))
    case = next(iter(study.suite(settings_of(study.parameters, {}), 1)))
    judged = judge_case(case, str(small))
    assert (str(judged.verdict), judged.case) == ("pass", case)


def test_the_check_says_what_the_nodes_do_not_register(small: Path) -> None:
    assert list(find(str(small)).check(_quiet)) == []
    _edit(small / "guard.py", '"/near"', '"/nearby"')
    for node in ("Filter", "Guard"):
        assert node in (small / "binding.yaml").read_text()
    (small / "binding.yaml").write_text((small / "binding.yaml").read_text().replace("timeout: 20 s", "timeout: 6 s"))
    [finding] = find(str(small)).check(_quiet)
    assert finding.level == "error"
    assert "/near" in f"{finding.where} {finding.rule}"
