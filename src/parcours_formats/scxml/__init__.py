"""SCXML (W3C State Chart XML) to models and back (docs/formats.md)."""

from __future__ import annotations

from parcours.model.conversion import Reading, Writing
from parcours.model.structure import Cefsm


def read(text: str, origin: str) -> Reading:
    """Return the chart of an SCXML document as a model.

    Args:
        text: XML with the root element `scxml`.
        origin: the file's name, for messages.

    Raises:
        BadModel: the document is not well formed, or says what cannot be translated.
    """
    from parcours_formats.scxml.scxml_reader import read_chart

    return read_chart(text, origin)


def write(cefsm: Cefsm) -> Writing:
    """Return a model as an SCXML document."""
    from parcours_formats.scxml.scxml_writer import write_chart

    return write_chart(cefsm)
