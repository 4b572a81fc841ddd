"""Models: a YAML file to a checked Cefsm, its guard language, its step relation and its drawings."""

from parcours.model.finding import Finding
from parcours.model.reading import Checked, check_file, check_text, parse_model, read_model
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

__all__ = [
    "ENVIRONMENT",
    "Cefsm",
    "Channel",
    "Checked",
    "Component",
    "Field",
    "Finding",
    "Machine",
    "MessageClass",
    "Receive",
    "Send",
    "Transition",
    "Variable",
    "check_file",
    "check_text",
    "parse_model",
    "read_model",
]
