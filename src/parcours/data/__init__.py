"""Draws rows of test values from input domains: by a combination criterion and a seed, within constraints."""

from parcours.data.blocks import Block
from parcours.data.boundaries import at_boundaries
from parcours.data.choosing import MODEL_CRITERIA, RowSelection, choose
from parcours.data.constraints import Constraint
from parcours.data.domains import Domain, enumeration, split
from parcours.data.drawing import draw
from parcours.data.inputs import Group, InputModel
from parcours.data.measuring import BlockCoverage, HeldCombinations, TupleCoverage, cover, measure
from parcours.data.schema import parse_input_model, read_input_model
from parcours.data.selecting import CRITERIA, count, select

__all__ = [
    "CRITERIA", "MODEL_CRITERIA", "Block", "BlockCoverage", "Constraint", "Domain", "Group", "HeldCombinations",
    "InputModel", "RowSelection", "TupleCoverage", "at_boundaries", "choose", "count", "cover", "draw", "enumeration",
    "measure", "parse_input_model", "read_input_model", "select", "split",
]  # fmt: skip
