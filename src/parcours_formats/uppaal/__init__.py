"""Reads and writes UPPAAL's XML: networks of timed automata (docs/formats.md)."""

from parcours_formats.uppaal.uppaal_reader import read
from parcours_formats.uppaal.uppaal_writer import write

__all__ = ["read", "write"]
