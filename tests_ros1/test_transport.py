"""RAMP's messages between two rospy processes: topics and persistent services of the package's Python classes."""

from __future__ import annotations

import queue
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import rospy
from tests_ros1.ros1_messages import fields, load, message

from parcours.run.hosts.ros1.master import Master
from parcours_ramp.planner.wire import FORMS

_ECHO = """
import ast, sys
from pathlib import Path
import rospy
from tests_ros1.ros1_messages import load, message
messages = load(Path(sys.argv[1]))
rospy.init_node("echo")
best = messages["best_trajectory"].message
back = rospy.Publisher("/echoed", best, queue_size=8, tcp_nodelay=True)
def serve(request):
    return message(messages["modification_response"].message, answer)
answer = ast.literal_eval(sys.argv[2])
rospy.Service("/path_modification", messages["modification_request"].service, serve)
rospy.Subscriber("/best_trajectory", best, back.publish, tcp_nodelay=True)
rospy.spin()
"""
_OF_KIND: dict[str, Any] = {"float": 0.5, "int": 3, "bool": True, "floats": [0.1, 0.2], "ints": [1, 2, 3]}


def _values(channel: str, floats: int = 2) -> tuple[Any, ...]:
    many = _OF_KIND | {"floats": np.linspace(0.0, 1.0, floats).tolist()}
    return tuple(many[field.kind] for field in FORMS[channel])


def _same(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_trajectory_of_50_kilobytes_and_a_request_travel_to_another_process_and_back(package: Path) -> None:
    messages = load(package)
    answer = _values("modification_response")
    with Master():
        command = [sys.executable, "-c", _ECHO, str(package), repr(answer)]
        with subprocess.Popen(command, cwd=Path(__file__).parent.parent) as echo:
            try:
                rospy.init_node("tester", disable_signals=True)
                arrived: queue.Queue[Any] = queue.Queue()
                best = messages["best_trajectory"].message
                rospy.Subscriber("/echoed", best, arrived.put, tcp_nodelay=True)
                there = rospy.Publisher("/best_trajectory", best, queue_size=8, tcp_nodelay=True)
                rospy.wait_for_service("/path_modification", 20.0)
                while not there.get_num_connections():
                    rospy.sleep(0.01)
                values = _values("best_trajectory", floats=1200)
                got = None
                while got is None:  # its publisher may not know yet that somebody listens
                    there.publish(message(best, values))
                    try:
                        got = arrived.get(timeout=0.2)
                    except queue.Empty:
                        assert echo.poll() is None
                assert _same(fields(got), values)
                ask = rospy.ServiceProxy(
                    "/path_modification", messages["modification_request"].service, persistent=True
                )
                request = message(messages["modification_request"].message, _values("modification_request"))
                for _ in range(10):
                    assert _same(fields(ask(request)), answer)
            finally:
                echo.terminate()
                echo.wait(10)
                rospy.signal_shutdown("done")
