"""The reachable configurations of a model, and what is wrong among them."""

from parcours.model.composition.exploring import explore
from parcours.model.composition.space import SEVERITY, Discovery, Space

__all__ = ["SEVERITY", "Discovery", "Space", "explore"]
