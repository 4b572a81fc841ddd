"""The behavioural and the structural model of RAMP's components, and their input domains."""

from __future__ import annotations

import functools
from importlib.resources import files
from pathlib import Path

from parcours.data import InputModel, parse_input_model
from parcours.model import parse_model
from parcours.model.structure import Cefsm
from parcours.verdict.conformance import Allowance
from parcours_ramp.planner.parameters import original

OUTSIDE = Allowance(unmodelled=frozenset({"trajectory_request", "evaluation_request"}), conversations=True)
"""What a planner asks within a planning or control cycle, which Table II leaves out."""


@functools.cache
def component_model(schedule: str = "guarded") -> Cefsm:
    """Return the model of the six components (Fig. 3, Tables I and II), with what holds of data under a schedule."""
    text = (files(__package__) / "model.yaml").read_text(encoding="utf-8")
    constants = {} if schedule == "guarded" else {"margin": original().plan_margin, "halts_at_once": 0.0}
    return parse_model(text, "ramp_components/model.yaml", constants)


@functools.cache
def component_inputs() -> InputModel:
    """Return the input domains of the messages: five parameters, ten blocks (section IV-C)."""
    text = (files(__package__) / "domains.yaml").read_text(encoding="utf-8")
    return parse_input_model(text, "ramp_components/domains.yaml")


def component_files() -> dict[str, Path]:
    """Return where the model and the input domains lie."""
    here = Path(__file__).parent
    return {"model": here / "model.yaml", "data": here / "domains.yaml"}
