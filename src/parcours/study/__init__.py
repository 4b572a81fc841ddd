"""The door: what a study is, how one is found, and studies made of a model and a system under test."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from parcours.study.components.simple import Took, took

if TYPE_CHECKING:
    from parcours.study.campaign.rules import Fact, Rule
    from parcours.study.campaign.study import CampaignStudy
    from parcours.study.components.references import above, below
    from parcours.study.components.study import ComponentStudy, Limit
    from parcours.study.components.systems import python_system
    from parcours.study.finding import judge_case
    from parcours.study.parameters import Parameter, Settings
    from parcours.study.protocol import Judged, Measure, Reported, Request, Results, Run, Study

# Name -> the module that has it, loaded on demand: a component that only says what it `took` loads none of them.
_ROOMS = {
    "CampaignStudy": "campaign.study", "ComponentStudy": "components.study", "Fact": "campaign.rules",
    "Judged": "protocol", "Limit": "components.study", "Measure": "protocol", "Parameter": "parameters",
    "Reported": "protocol", "Request": "protocol", "Results": "protocol", "Rule": "campaign.rules", "Run": "protocol",
    "Settings": "parameters", "Study": "protocol", "above": "components.references",
    "below": "components.references", "judge_case": "finding", "python_system": "components.systems",
}  # fmt: skip
__all__ = [
    "CampaignStudy", "ComponentStudy", "Fact", "Judged", "Limit", "Measure", "Parameter", "Reported", "Request",
    "Results", "Rule", "Run", "Settings", "Study", "Took", "above", "below", "judge_case", "python_system", "took",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Load a name when it is asked for."""
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found: object = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    return found
