"""What the tests on real ROS 1 share: the package with RAMP's messages, and a master."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import parcours.studies
from parcours.model.reading import read_model
from parcours.planners.ramp.wire import FORMS
from parcours.run.hosts.ros1.interfaces import interfaces, write_package
from parcours.run.hosts.ros1.master import Master


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of RAMP's package; the paper's topics and services (Table I)."""
    folder = tmp_path_factory.mktemp("parcours_ramp")
    model = Path(parcours.studies.__file__).parent / "ramp_components" / "model.yaml"
    write_package(folder, "parcours_ramp", interfaces(read_model(model)), FORMS)
    return folder


@pytest.fixture(scope="module")
def master() -> Iterator[str]:
    """The address of a master for all tests of a module: most of the time of a fabric goes into starting one."""
    with Master() as started:
        yield started.uri
