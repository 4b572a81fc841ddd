"""Actions as channels of a model: between two nodes, from the tester, and to it; on the tester's time."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest
from tests_ros2.conftest import Run

from parcours.errors import BadRequest
from parcours.run.binding import Binding, parse_binding, read_binding
from parcours.run.hosts.foreign.host import ForeignHost
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.recorded import rejudge
from parcours_navigation.foreign.running import ForeignStudy
from parcours_navigation.foreign.setup_steps import act

ERRAND = Path(__file__).parent / "errand" / "binding.yaml"
SUCCEEDED, CANCELED = 4.0, 5.0


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nodes' Python first in the path, on a domain of their own."""
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")


@pytest.fixture(params=[False, True], ids=["one domain", "two domains"])
def errand(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The binding; or one whose client and server are on two domains, neither that of the environment."""
    folder = shutil.copytree(ERRAND.parent, tmp_path / "errand")
    file, interfaces = folder / "binding.yaml", ERRAND.parents[2] / "examples" / "ros2_navigation" / "interfaces"
    text = file.read_text().replace("../../examples/ros2_navigation/interfaces", str(interfaces))
    for node, domain in (("/dispatcher", 64), ("/driver", 65)) if request.param else ():
        text = text.replace(f"ros_node: {node}\n", f"ros_node: {node}\n    domain: {domain}\n")
    file.write_text(text)
    return file


def without(node: str, file: Path) -> Binding:
    text = file.read_text()
    begin = text.index(f"  {node}:\n    command")
    file.write_text(text[:begin] + text[text.index("120 s\n", begin) + 6 :])
    return read_binding(file)


@pytest.mark.parametrize("ending", ["arrived", "stop"])
def test_goals_feedback_results_and_cancellations_pass_between_two_nodes(
    errand: Path, tmp_path: Path, ending: str
) -> None:
    with ForeignHost(read_binding(errand), tmp_path) as host:
        run = Run(host)
        try:
            assert run.say("order", lambda: run.has("receive", "left"))
            assert run.say(ending, lambda: run.has("receive", "done"))
        finally:
            run.session.end()
        said = run.message("done")
    assert (said.point.x, said.point.y) == (SUCCEEDED if ending == "arrived" else CANCELED, 7.0)
    assert 1 <= said.header.stamp.sec < 1_000_000, "nodes take their time from the tester"
    way = [one.channel for one in run.session.relay.events if one.kind == "receive"]
    called_back = ["cancel"] if ending == "stop" else []
    assert way == ["order", "goal", "left", ending, *called_back, "result", "done"]


def test_parts_of_an_action_that_are_not_bound_go_from_node_to_node(errand: Path, tmp_path: Path) -> None:
    text, domain = errand.read_text(), ", domain: 65" if "65" in errand.read_text() else ""
    heard = f"{{topic: /errand/_action/feedback, type: nav2_msgs/NavigateToPose_FeedbackMessage{domain}}}"
    errand.write_text(f"{text[: text.index('  left:')]}observe:\n  heard: {heard}\n")
    with ForeignHost(read_binding(errand), tmp_path) as host:
        run = Run(host)
        try:
            assert run.say("order", lambda: run.has("receive", "heard"))
            assert run.say("stop", lambda: run.has("receive", "done"))
        finally:
            run.session.end()
        said = run.message("done")
    assert (said.point.x, said.point.y) == (CANCELED, 7.0)


FLEET = Path(__file__).parent / "fleet" / "binding.yaml"


def test_robots_of_one_name_on_domains_of_their_own_serve_an_action_each_on_the_testers_time(tmp_path: Path) -> None:
    with ForeignHost(read_binding(FLEET), tmp_path) as host:
        run = Run(host)
        try:
            act(run.session, "before_case")
            assert run.say("north_goal", lambda: run.has("receive", "north_left"))
            assert run.say("south_goal", lambda: run.has("receive", "south_left"))
            assert run.say("south_arrived", lambda: run.has("receive", "south_result"))
            assert not run.has("receive", "north_result")
            assert run.say("north_arrived", lambda: run.has("receive", "north_result"))
        finally:
            run.session.end()
        feedback = [run.message(channel).feedback for channel in ("north_left", "south_left")]
        results = [run.message(channel).status for channel in ("north_result", "south_result")]
    assert ([one.distance_remaining for one in feedback], results) == ([3.0, 4.0], [SUCCEEDED, SUCCEEDED])
    assert all(1 <= one.current_pose.header.stamp.sec < 1_000_000 for one in feedback), "both follow /clock"


WRONG = {
    "no goal": ("    part: goal", "    part: feedback", "no channel is bound to that of /errand"),
    "wrong way": (
        "    part: feedback",
        "    part: cancel",
        r"must go from Dispatcher to Driver, but 'left' goes from Driver",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_parts_of_an_action_belong_to_a_goal_and_go_its_way(wrong: str) -> None:
    old, new, said = WRONG[wrong]
    with pytest.raises(BadRequest, match=said):
        parse_binding(ERRAND.read_text().replace(old, new), str(ERRAND))


@pytest.mark.parametrize("absent", ["", "Dispatcher", "Driver"])
def test_cases_of_the_model_pass_whoever_is_played_by_the_tester(errand: Path, tmp_path: Path, absent: str) -> None:
    binding = without(absent, errand) if absent else read_binding(errand)
    ids = [scene.id for scene in abstract_scenes(binding, 1) if scene.id.endswith("/0")]
    with ForeignHost(binding, tmp_path / "nodes") as host:
        order = ProcessOrder(str(errand), str(tmp_path), abstract=tuple(ids[:2]), record="mcap")
        results = list(ForeignStudy(host, order).run())
    for result in results:
        assert result.judged.judgement.passed, (result.id, result.judged.judgement.why)
    again, recorded, _ = rejudge(tmp_path / results[0].recording, binding)
    assert (again.judgement, recorded) == (results[0].judged.judgement, "pass")
