"""Our own YAML (docs/model-format.md) in the frame of the foreign formats: nothing is lost either way."""

from __future__ import annotations

from parcours.model.formats.reading import Reading, Writing
from parcours.model.reading import parse_model
from parcours.model.structure import Cefsm
from parcours.model.writing import write_model


def read(text: str, origin: str) -> Reading:
    """Return the model of a YAML text.

    Raises:
        BadModel: as `parse_model`.
    """
    return Reading(parse_model(text, origin))


def write(cefsm: Cefsm) -> Writing:
    """Return the YAML text of a model."""
    return Writing(write_model(cefsm))
