"""Reads and writes models of PICT, Microsoft's pairwise tool, with a report of what is lost."""

from parcours.data.formats import DataFormat
from parcours_formats.pict.pict_reader import parse_pict, read_pict
from parcours_formats.pict.pict_writer import write_pict

__all__ = ["FORMATS", "parse_pict", "read", "read_pict", "write", "write_pict"]

FORMATS = {"pict": DataFormat("PICT", (".pict", ".txt"), "parcours_formats.pict")}
"""Name -> format (entry points `parcours.data_formats`)."""

read, write = read_pict, write_pict
