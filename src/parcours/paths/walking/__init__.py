"""Models walked online: walkers, stop conditions and what was covered, one move at a time."""

from parcours.paths.spaces import GraphSpace, ModelSpace, part_of
from parcours.paths.walking.conditions import parse_condition
from parcours.paths.walking.graphwalker import parse_generators
from parcours.paths.walking.walk import Phase, Walk, WalkStep, phase
from parcours.paths.walking.walkers import WALKERS, Ending, Planned

__all__ = [
    "WALKERS",
    "Ending",
    "GraphSpace",
    "ModelSpace",
    "Phase",
    "Planned",
    "Walk",
    "WalkStep",
    "parse_condition",
    "parse_generators",
    "part_of",
    "phase",
]  # fmt: skip
