"""Goals are sent to action servers, and lifecycle nodes are led: navigation stacks on real ROS 2."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests_ros2.stacks.conftest import TASK, complaint, edit, observation

from parcours.errors import ParcoursError
from parcours_navigation.foreign import stack
from parcours_navigation.foreign.stack import StackPlanner, running
from parcours_navigation.protocol import Command, Map, Observation


def on_a_field(time: float, goal: tuple[float, float]) -> Observation:
    """What is seen on an empty field from (1, 1), on the way to a goal."""
    seen = observation(time, path=False)
    seen.robot[:] = 1.0, 1.0, 0.0, 0.0, 0.0
    seen.obstacles = seen.obstacles[:0]
    seen.map = Map(np.zeros((100, 200), np.uint8), 0.1, (-10.0, -5.0))
    seen.task = replace(TASK, goal=goal)
    return seen


def test_a_goal_is_sent_to_an_action_server_and_ends_with_its_case(folder: Path) -> None:
    edit(folder / "navigator.py", ("        result = N", "        print(goal.is_cancel_requested, why, flush=True)\n"
         "        result = N"), ("        done = self.done", '        print("goal", flush=True)\n'
         "        done = self.done"))  # fmt: skip
    sent = StackPlanner(folder / "navigator.yaml")
    for goal in ((3.0, 1.0), (-3.0, 1.0)):
        sent.reset(TASK)
        first = [sent.observe(on_a_field(0.1 * k, (3.0, 1.0))) for k in range(3)][-1]
        assert isinstance(first, Command) and first.v > 0.3
        assert sent.observe(on_a_field(0.3, goal)) == (first if goal[0] > 0.0 else Command(0.0, -0.8))
    sent.reset(TASK)
    log = running(str(folder / "navigator.yaml")).output("navigator")
    assert log.splitlines() == ["goal", "True ", "goal", "goal", "False another goal came", "True "]


NO_GOAL = {
    "refused": ("navigator.py", ("GoalResponse.ACCEPT if", "GoalResponse.REJECT if"), "stack-goal", "was refused"),
    "goes on": ("navigator.py", ("self.goal.is_cancel_requested or ", ""), "stack-goal", "must end within 10 s"),
    "not served": ("navigator.yaml", ("navigate: /navigate_to_pose", "navigate: /navigate"), "absent-topic",
                   "'navigate' needs a node that serves the action /navigate, but none does"),
}  # fmt: skip


@pytest.mark.parametrize("wrong", NO_GOAL)
def test_what_is_wrong_with_a_goal_is_said(folder: Path, wrong: str) -> None:
    file, change, slug, said = NO_GOAL[wrong]
    edit(folder / file, change)
    with pytest.raises(ParcoursError, match=said) as caught:
        sent = StackPlanner(folder / "navigator.yaml")
        for _ in range(2):
            sent.reset(TASK)
            sent.observe(on_a_field(0.0, (3.0, 1.0)))
    assert slug in str(caught.value)


def test_a_lifecycle_node_is_activated_and_led_by_steps(folder: Path) -> None:
    edit(folder / "dwa.py", ("from rclpy.node import", "from rclpy.lifecycle import TransitionCallbackReturn,"),
         ("        self.period = 0.1\n", "        self.said = []\n\n    def on_configure(self, state):\n"
          "        self.period = 0.1\n"), ("        self.create_timer(self.period, self.drive)\n", """
        self.timer = self.create_timer(self.period, self.drive)
        return self.say("configure")

    def say(self, what):
        print(what, flush=True)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        return self.say("activate")

    def on_deactivate(self, state):
        return self.say("deactivate")
"""))  # fmt: skip
    binding = folder / "dwa.yaml"
    edit(binding, ("    ros_node: /dwa\n", "    ros_node: /dwa\n    life: active\n"))
    binding.write_text(
        f"{binding.read_text()}before_case: [{{life: /dwa, is: inactive}}, {{life: /dwa, is: active}}]\n"
    )
    led = StackPlanner(binding)
    led.reset(TASK)
    assert isinstance(led.observe(observation(0.0)), Command)
    said = ["configure", "activate", "deactivate", "activate"]
    assert running(str(binding)).output("dwa").splitlines() == said
    stack.end(str(binding))
    edit(folder / "dwa.py", ('return self.say("configure")', "return TransitionCallbackReturn.FAILURE"))
    assert "must become active, but from unconfigured it refuses to configure" in str(complaint(binding))
