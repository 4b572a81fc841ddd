"""What the tests of navigation stacks share: the examples in a folder of their own, and what a robot sees."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import ParcoursError
from parcours_navigation.foreign import stack
from parcours_navigation.foreign.stack import read_stack
from parcours_navigation.foreign.stack_nodes import StackNodes
from parcours_navigation.protocol import Limits, Map, Observation, Scan, Task

EXAMPLES = Path(__file__).parents[2] / "examples" / "ros2_navigation"
TASK = Task((3.0, 1.0), 0.2, 0.2, Limits(0.5, 1.5, 1.0, 2.0), 0.1, 4.0, 7)
BAND = Path(sys.executable).parent


@pytest.fixture(autouse=True)
def surroundings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{BAND}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "44")  # other tests leave their nodes on that of this run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the examples whose nodes run in the network of the tests, to be changed."""
    copy = tmp_path / "stacks"
    shutil.copytree(EXAMPLES, copy)
    for binding in copy.glob("*.yaml"):
        if "\nstack:\n" in binding.read_text():
            edit(binding, ("\nstack:\n", "\nstack:\n  network: shared\n"))
    return copy


@pytest.fixture(autouse=True)
def ended() -> Iterator[None]:
    """No test finds the nodes of another."""
    yield
    for path in list(stack._RUNNING):
        stack.end(path)


def edit(file: Path, *changes: tuple[str, str]) -> None:
    text = file.read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text)


def observation(time: float, path: bool = True) -> Observation:
    cells = np.zeros((3, 4), np.uint8)
    cells[1, 2], cells[2, 3] = 100, 255
    way = np.array([[0.5, 1.0], [3.0, 1.0]]) if path else None
    robot, others = np.array([1.0, 2.0, 0.5, 0.25, -0.5]), np.array([[2.0, 3.0, 0.0, 0.1, 0.0, 0.3]])
    scan = Scan(np.array([1.0, np.inf, 2.0]), -0.5, 0.5, 4.0)
    return Observation(time, robot, others, TASK, scan, Map(cells, 0.5, (-1.0, -2.0)), way)


def complaint(binding: Path) -> ParcoursError:
    with pytest.raises(ParcoursError) as caught:
        nodes = StackNodes(read_stack(binding))
        nodes.close()
    return caught.value
