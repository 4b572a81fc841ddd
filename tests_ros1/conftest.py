"""What the tests on real ROS 1 share: the package with RAMP's messages."""

from __future__ import annotations

from pathlib import Path

import pytest

import parcours.studies
from parcours.model.reading import read_model
from parcours.planners.ramp.wire import FORMS
from parcours.run.hosts.ros1.interfaces import interfaces, write_package


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of RAMP's package; the paper's topics and services (Table I)."""
    folder = tmp_path_factory.mktemp("parcours_ramp")
    model = Path(parcours.studies.__file__).parent / "ramp_components" / "model.yaml"
    write_package(folder, "parcours_ramp", interfaces(read_model(model)), FORMS)
    return folder
