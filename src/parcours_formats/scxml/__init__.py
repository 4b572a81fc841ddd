"""SCXML (W3C State Chart XML) to models and back (docs/formats.md)."""

from parcours_formats.scxml.scxml_reader import read
from parcours_formats.scxml.scxml_writer import write

__all__ = ["read", "write"]
