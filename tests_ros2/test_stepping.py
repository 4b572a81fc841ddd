"""Plain nodes on simulated time: led by /clock, at exact instants, faster than the machine's clock."""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests_ros2.conftest import soon

from parcours.errors import BadRequest, HostFailure
from parcours.run.hosts.ros2.participant import Ros2Participant
from parcours.run.hosts.ros2.stepping import SteppedClock
from parcours.run.hosts.scheduling import real_time

EXAMPLE = Path(__file__).parent.parent / "examples" / "ros2_python"
PERIOD = 50_000_000
GOAL = (3.0, 0.0)


class Robot:
    """A robot that does what /cmd_vel says, and tells where it is on /odom."""

    def __init__(self, participant: Ros2Participant) -> None:
        from geometry_msgs.msg import PoseArray, PoseStamped, TwistStamped
        from nav_msgs.msg import Odometry

        self._odometry, self._command = Odometry, TwistStamped
        self._publisher = participant.node.create_publisher(Odometry, "/odom", 1)
        self._goals = participant.node.create_publisher(PoseStamped, "/goal", 1)
        self._obstacles = participant.node.create_publisher(PoseArray, "/obstacles", 1)
        participant.overhear(TwistStamped, "/cmd_vel", self._heard, 10)
        self.x = self.y = self.heading = 0.0
        self.stamps: list[int] = []
        self.began = 0
        self._speed = self._turn = 0.0

    @property
    def is_heard(self) -> bool:
        counts = [one.get_subscription_count() for one in (self._publisher, self._goals, self._obstacles)]
        return counts == [1, 1, 2]

    def _heard(self, raw: bytes) -> None:
        from rclpy.serialization import deserialize_message

        command = deserialize_message(raw, self._command)
        self.stamps.append(command.header.stamp.sec * 1_000_000_000 + command.header.stamp.nanosec)
        self._speed, self._turn = command.twist.linear.x, command.twist.angular.z

    @property
    def is_driving(self) -> bool:
        return self._speed > 0.0

    def begin(self) -> None:
        from geometry_msgs.msg import Pose, PoseArray, PoseStamped

        self.x = self.y = self.heading = self._speed = self._turn = 0.0
        self.move(0.0)
        goal, obstacle = PoseStamped(), Pose()
        goal.pose.position.x, goal.pose.position.y = GOAL
        obstacle.position.x, obstacle.position.y = 1.5, 0.1
        self._obstacles.publish(PoseArray(poses=[obstacle]))
        self._goals.publish(goal)

    def move(self, seconds: float) -> None:
        self.heading += self._turn * seconds
        self.x += self._speed * math.cos(self.heading) * seconds
        self.y += self._speed * math.sin(self.heading) * seconds
        here: Any = self._odometry()
        here.pose.pose.position.x, here.pose.pose.position.y = self.x, self.y
        here.pose.pose.orientation.z = math.sin(self.heading / 2)
        here.pose.pose.orientation.w = math.cos(self.heading / 2)
        self._publisher.publish(here)


@contextlib.contextmanager
def running(*names: str) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Programs of the example, on simulated time."""
    with real_time():
        nodes = [
            subprocess.Popen([sys.executable, str(EXAMPLE / f"{name}.py"), "--ros-args", "-p", "use_sim_time:=true"])
            for name in names
        ]
    try:
        yield nodes
    finally:
        for node in nodes:
            node.kill()
            node.wait()


@pytest.fixture
def participant() -> Iterator[Ros2Participant]:
    with real_time():
        one = Ros2Participant("tester")
        yield one
        one.close()


def drive(participant: Ros2Participant, seconds: int) -> tuple[Robot, list[tuple[float, float, float]], float]:
    """Return the robot, where it has been, and how long that took in real time [s]."""
    from geometry_msgs.msg import TwistStamped

    robot = Robot(participant)
    clock = SteppedClock(participant, ["/avoider", "/follower"], {"/cmd_vel": TwistStamped}, step=PERIOD)
    assert soon(lambda: robot.is_heard)
    robot.begin()
    for _ in range(100):  # it takes a while until the two nodes have found each other
        clock.advance(clock.now() + 20 * PERIOD)
        if robot.is_driving:
            break
    assert robot.is_driving
    robot.begin()
    clock.settle()
    clock.restart()
    robot.stamps.clear()
    robot.began = clock.instant
    way, began = [], time.perf_counter()
    for k in range(1, seconds * 20 + 1):
        clock.advance(k * PERIOD)
        robot.move(PERIOD * 1e-9)
        way.append((robot.x, robot.y, robot.heading))
    return robot, way, time.perf_counter() - began


def test_timers_fire_at_exact_instants_faster_than_real_time(participant: Ros2Participant) -> None:
    with running("avoider", "follower"):
        robot, way, took = drive(participant, 20)
    assert robot.stamps == [robot.began + k * PERIOD for k in range(1, 401)]
    assert math.hypot(robot.x - GOAL[0], robot.y - GOAL[1]) < 0.15
    assert max(abs(y) for _, y, _ in way) > 0.3  # round the obstacle
    assert took < 20


def test_a_run_is_repeated_to_the_last_bit() -> None:
    ways = []
    for name in ("one", "other"):
        with running("avoider", "follower"):
            tester = Ros2Participant(name)
            ways.append(drive(tester, 6)[1])
            tester.close()
    assert ways[0] == ways[1]
    assert ways[0][-1][0] > 1.0


def test_nodes_that_are_not_there_are_named(participant: Ros2Participant) -> None:
    with pytest.raises(HostFailure, match=r"/nobody serve none.*ros2-sim-time"):
        SteppedClock(participant, ["/nobody"], discovery=0.2)


def test_a_node_that_dies_is_named(participant: Ros2Participant) -> None:
    with running("avoider") as [node]:
        clock = SteppedClock(participant, ["/avoider"], within=1.0)
        assert clock.advance(PERIOD) == PERIOD
        node.kill()
        node.wait()
        with pytest.raises(HostFailure, match=r"silent is /avoider.*ros2-restless"):
            clock.advance(2 * PERIOD)


def test_a_step_takes_time(participant: Ros2Participant) -> None:
    with pytest.raises(BadRequest, match=r"0 ns.*ros2-step"):
        SteppedClock(participant, [], step=0)
