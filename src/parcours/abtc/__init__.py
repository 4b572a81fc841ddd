"""Internal paths -> abstract test cases: interactions (ITPs), rendezvous (RCC), serialisation (RSA)."""

from parcours.abtc.combining import Combination, Combinations, Dropped, combinations
from parcours.abtc.interactions import InteractionPath, component_graph, interaction_paths
from parcours.abtc.notation import notation
from parcours.abtc.points import POLICIES, Policy
from parcours.abtc.rendezvous import Meeting, Rendezvous, meetings, rendezvous_pairs
from parcours.abtc.sequencing import Emission, Event, Reception, serialise
from parcours.abtc.serialising import AbstractCase, Start, abstract_cases, case_counts, serialisations

__all__ = [
    "POLICIES",
    "AbstractCase",
    "Combination",
    "Combinations",
    "Dropped",
    "Emission",
    "Event",
    "InteractionPath",
    "Meeting",
    "Policy",
    "Reception",
    "Rendezvous",
    "Start",
    "abstract_cases",
    "case_counts",
    "combinations",
    "component_graph",
    "interaction_paths",
    "meetings",
    "notation",
    "rendezvous_pairs",
    "serialisations",
    "serialise",
]
