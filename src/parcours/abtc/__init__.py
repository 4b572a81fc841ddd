"""Abstract test cases: interactions (ITPs), rendezvous (RCC), serialisation (RSA, APSESCC)."""

from parcours.abtc.combining import Combination, Combinations, Dropped, combinations
from parcours.abtc.interactions import InteractionPath, component_graph, interaction_paths
from parcours.abtc.interleaving import (
    Serialised,
    count_sequences,
    measure_sequences,
    order_of,
    order_of_case,
    sample_sequences,
    sequences,
    side_by_side,
)
from parcours.abtc.order import Order
from parcours.abtc.rendezvous import Meeting, Rendezvous, meetings, rendezvous_pairs
from parcours.abtc.requiring import require_cases
from parcours.abtc.sequencing import Emission, Event, Reception, serialise
from parcours.abtc.serialising import (
    POLICIES,
    AbstractCase,
    Policy,
    Start,
    abstract_cases,
    case_counts,
    find_case,
    notation,
    serialisations,
)
from parcours.abtc.symmetry import interchangeable, representatives

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
    "Order",
    "Policy",
    "Reception",
    "Rendezvous",
    "Serialised",
    "Start",
    "abstract_cases",
    "case_counts",
    "combinations",
    "component_graph",
    "count_sequences",
    "find_case",
    "interaction_paths",
    "interchangeable",
    "measure_sequences",
    "meetings",
    "notation",
    "order_of",
    "order_of_case",
    "rendezvous_pairs",
    "representatives",
    "require_cases",
    "sample_sequences",
    "sequences",
    "serialisations",
    "serialise",
    "side_by_side",
]
