"""Reads and writes SCXML, W3C's State Chart XML (docs/formats.md)."""

from parcours_formats.scxml.scxml_reader import read
from parcours_formats.scxml.scxml_writer import write

__all__ = ["read", "write"]
