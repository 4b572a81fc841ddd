"""UPPAAL XML (networks of timed automata) to models and back (docs/formats.md)."""

from __future__ import annotations

from parcours.model.conversion import Reading, Writing
from parcours.model.structure import Cefsm


def read(text: str, origin: str) -> Reading:
    """Return the system of a UPPAAL file as a model.

    Args:
        text: XML with the root element `nta`.
        origin: the file's name, for messages.

    Raises:
        BadModel: the file is not well formed, or says what cannot be translated.
    """
    from parcours_formats.uppaal.uppaal_reader import read_system

    return read_system(text, origin)


def write(cefsm: Cefsm) -> Writing:
    """Return a model as a UPPAAL file."""
    from parcours_formats.uppaal.uppaal_writer import write_system

    return write_system(cefsm)
