"""Faults on purpose: a seeded plan decides what happens to each message of a channel and to each component."""

from parcours.run.faults.corruption import HOWS, FlatCodec, How, corrupted, corrupted_bytes
from parcours.run.faults.effects import UNTOUCHED, Effect, Effects, signals
from parcours.run.faults.plan import ChannelFault, ComponentFault, Fault, FaultPlan
from parcours.run.faults.text import parse_fault, parse_plan, read_plan

__all__ = [
    "HOWS", "UNTOUCHED", "ChannelFault", "ComponentFault", "Effect", "Effects", "Fault", "FaultPlan",
    "FlatCodec", "How", "corrupted", "corrupted_bytes", "parse_fault", "parse_plan", "read_plan", "signals",
]  # fmt: skip
