"""RAMP's components by name, each made for one case."""

from __future__ import annotations

from collections.abc import Callable

from parcours.errors import BadRequest, one_of
from parcours.kernels import Record
from parcours.run.port import Component
from parcours_ramp.planner.control import Control
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.path_modification import PathModification
from parcours_ramp.planner.planner import Planner
from parcours_ramp.planner.service import Sensing
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation
from parcours_ramp.planner.trajectory_generator import TrajectoryGenerator

COMPONENTS = ("Planner", "TrajectoryGenerator", "TrajectoryEvaluation", "PathModification", "Control", "Sensing")


def component(
    name: str, parameters: Parameters, seed: int, case: int, begin: Record, goal: tuple[float, float]
) -> Component:
    """Return a fresh component.

    Args:
        goal: (x, y) [m].

    Raises BadRequest: RAMP has none of that name.
    """
    makers: dict[str, Callable[[], Component]] = {
        "Planner": lambda: Planner(parameters, seed, case, begin, goal),
        "TrajectoryGenerator": lambda: TrajectoryGenerator(parameters),
        "TrajectoryEvaluation": lambda: TrajectoryEvaluation(parameters),
        "PathModification": lambda: PathModification(parameters, seed, case),
        "Control": lambda: Control(parameters),
        "Sensing": Sensing,
    }
    if name not in makers:
        rule = f"no component is called {name!r}"
        raise BadRequest("RAMP", rule, one_of(name, list(COMPONENTS)), slug="component-unknown")
    return makers[name]()
