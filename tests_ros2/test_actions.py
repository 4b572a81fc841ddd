"""Actions as channels of a model: between two nodes, from the tester, and to it; on the tester's time."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from parcours.errors import BadRequest
from parcours.run.binding import Binding, parse_binding, read_binding
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.recorded import rejudge
from parcours_navigation.foreign.running import ForeignStudy
from parcours_navigation.foreign.tester_messages import Maker

ERRAND = Path(__file__).parent / "errand" / "binding.yaml"
SUCCEEDED, CANCELED = 4.0, 5.0


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nodes' Python first in the path, on a domain of their own."""
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "46")


def without(node: str) -> Binding:
    text = ERRAND.read_text()
    begin = text.index(f"  {node}:\n    command")
    return parse_binding(text[:begin] + text[text.index("60 s\n", begin) + 5 :], str(ERRAND))


@pytest.mark.parametrize("ending", ["arrived", "stop"])
def test_goals_feedback_results_and_cancellations_pass_between_two_nodes(tmp_path: Path, ending: str) -> None:
    with ForeignHost(read_binding(ERRAND), tmp_path) as host:
        session = Session(host, whole(host.binding))
        maker = Maker(host.compile())

        def say(channel: str, until: Callable[[], bool]) -> None:
            session.relay.inject(channel, maker.of_the_environment(channel, session.now()))
            last = session.now() + 20_000_000_000
            while not until() and session.now() < last:
                session.poll(session.now() + 5_000_000)
            assert until(), [(one.kind, one.channel, one.text) for one in session.relay.events]

        def has(kind: str, channel: str) -> bool:
            return any((one.kind, one.channel) == (kind, channel) for one in session.relay.events)

        try:
            session.start()
            say("order", lambda: has("receive", "left"))
            say(ending, lambda: has("receive", "done"))
        finally:
            session.end()
        [done] = [one.payload for one in session.relay.events if (one.kind, one.channel) == ("receive", "done")]
        said = Decoder(host.binding, host.graph.types).message("done", done.content)  # type: ignore[attr-defined]
    assert (said.point.x, said.point.y) == (SUCCEEDED if ending == "arrived" else CANCELED, 7.0)
    assert 1 <= said.header.stamp.sec < 1_000_000, "nodes take their time from the tester"
    way = [one.channel for one in session.relay.events if one.kind == "receive"]
    called_back = ["cancel"] if ending == "stop" else []
    assert way == ["order", "goal", "left", ending, *called_back, "result", "done"]


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
def test_cases_of_the_model_pass_whoever_is_played_by_the_tester(tmp_path: Path, absent: str) -> None:
    binding = without(absent) if absent else read_binding(ERRAND)
    ids = [scene.id for scene in abstract_scenes(binding, 1) if scene.id.endswith("/0")]
    with ForeignHost(binding, tmp_path / "nodes") as host:
        order = ProcessOrder(str(ERRAND), str(tmp_path), abstract=tuple(ids[:2]), record="mcap")
        results = list(ForeignStudy(host, order).run())
    for result in results:
        assert result.judged.judgement.passed, (result.id, result.judged.judgement.why)
    again, recorded, _ = rejudge(tmp_path / results[0].recording, binding)
    assert (again.judgement, recorded) == (results[0].judged.judgement, "pass")
