"""Reads and writes GraphWalker's JSON; graphs with its labels share all but the document (docs/formats-graphs.md)."""

from parcours_formats.graphwalker.graphwalker_json import read, write

__all__ = ["read", "write"]
