"""Models: reading and checking a YAML file, the guard language, the step relation, drawings."""

from parcours.model.checking import findings
from parcours.model.configuration import Configuration, Layout, Move
from parcours.model.drawing import predicate, to_text
from parcours.model.finding import Finding
from parcours.model.model_file import Checked, check_file, check_text, parse_model, read_model
from parcours.model.picture import to_svg
from parcours.model.stepping import enabled, initial, step
from parcours.model.steps import StepRelation
from parcours.model.structure import (
    ENVIRONMENT,
    Cefsm,
    Channel,
    Component,
    Field,
    Machine,
    MessageClass,
    Receive,
    Send,
    Transition,
    Variable,
)
from parcours.model.writing import write_model

__all__ = [
    "ENVIRONMENT", "Cefsm", "Channel", "Checked", "Component", "Configuration", "Field", "Finding", "Layout", "Machine",
    "MessageClass", "Move", "Receive", "Send", "StepRelation", "Transition", "Variable", "check_file", "check_text",
    "enabled", "findings", "initial", "parse_model", "predicate", "read_model", "step", "to_svg", "to_text",
    "write_model",
]  # fmt: skip
