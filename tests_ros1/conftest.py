"""What the tests on real ROS 1 share: the package with RAMP's messages, a master, and toys' transports."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from tests_ros1 import ros1_toys as toys

import parcours_ramp
from parcours.model.model_file import read_model
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.ros1.interfaces import write_package
from parcours.run.hosts.ros1.master import Master
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours_ramp.planner.wire import FORMS


def patient(binding: Path) -> None:
    """Give the nodes of a binding all the time that they may need to start on a busy machine."""
    text, n = re.subn(r"^( +)(ros_node: \S+)$", r"\1\2\n\1timeout: 120 s", binding.read_text(), flags=re.MULTILINE)
    assert n > 0
    binding.write_text(text)


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of RAMP's package; the paper's topics and services (Table I)."""
    folder = tmp_path_factory.mktemp("parcours_ramp")
    model = Path(parcours_ramp.__file__).parent / "components" / "model.yaml"
    write_package(folder, "parcours_ramp", interfaces(read_model(model)), FORMS)
    return folder


@pytest.fixture(scope="module")
def master() -> Iterator[str]:
    """The address of a master for all tests of a module: most of the time of a transport goes into starting one."""
    with Master() as started:
        yield started.uri


@pytest.fixture
def start(master: str) -> Iterator[Callable[..., Ros1Transport]]:
    """Starts transports of toys, as `ros1_toys.transport_of` does, and closes them however a test ends."""
    with ExitStack() as started:

        def begin(*arguments: Any, **options: Any) -> Ros1Transport:
            transport = toys.transport_of(*arguments, **options, master=master)
            started.callback(transport.close)
            return transport

        yield begin
