"""PICT models (Microsoft's pairwise tool) to input models and back, each with a report of what is lost."""

from parcours.data.pict.reading import PictReading, parse_pict, read_pict
from parcours.data.pict.writing import write_pict

__all__ = ["PictReading", "parse_pict", "read_pict", "write_pict"]
