"""RAMP's components by name, each made for one case."""

from __future__ import annotations

from parcours.errors import BadRequest, one_of
from parcours.kernels import Record
from parcours.run.port import Component
from parcours_ramp.planner.control import Control
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.path_modification import PathModification
from parcours_ramp.planner.planner import Planner
from parcours_ramp.planner.sensing import Sensing
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation
from parcours_ramp.planner.trajectory_generator import TrajectoryGenerator

COMPONENTS = ("Planner", "TrajectoryGenerator", "TrajectoryEvaluation", "PathModification", "Control", "Sensing")


def component(
    name: str, parameters: Parameters, seed: int, case: int, begin: Record, goal: tuple[float, float]
) -> Component:
    """Return a fresh component.

    Args:
        name: one of COMPONENTS.
        parameters: RAMP's parameters.
        seed: campaign seed.
        case: case number.
        begin: POSE the robot begins in.
        goal: (x, y) [m].

    Raises BadRequest: RAMP has none of that name.
    """
    match name:
        case "Planner":
            return Planner(parameters, seed, case, begin, goal)
        case "TrajectoryGenerator":
            return TrajectoryGenerator(parameters)
        case "TrajectoryEvaluation":
            return TrajectoryEvaluation(parameters)
        case "PathModification":
            return PathModification(parameters, seed, case)
        case "Control":
            return Control(parameters)
        case "Sensing":
            return Sensing()
    rule = f"no component is called {name!r}"
    raise BadRequest("RAMP", rule, one_of(name, list(COMPONENTS)), slug="component-unknown")
