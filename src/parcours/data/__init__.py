"""Input domains and a combination criterion become rows of values, drawn by seed within constraints."""

from parcours.data.bookkeeping import BlockCoverage, cover
from parcours.data.constraints import Constraint
from parcours.data.domains import Block, Domain, InputModel, split
from parcours.data.drawing import draw
from parcours.data.reading import parse_input_model, read_input_model
from parcours.data.selecting import CRITERIA, count, select

__all__ = [
    "CRITERIA", "Block", "BlockCoverage", "Constraint", "Domain", "InputModel", "count", "cover", "draw",
    "parse_input_model", "read_input_model", "select", "split",
]  # fmt: skip
