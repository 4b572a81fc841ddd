"""Abstract test cases: interactions (ITPs), rendezvous (RCC), serialisation (RSA, APSESCC)."""

from parcours.abtc.combining import combinations
from parcours.abtc.interactions import component_graph, interaction_paths
from parcours.abtc.interleaving import (
    count_sequences,
    order_of,
    order_of_case,
    sample_sequences,
    sequences,
    side_by_side,
)
from parcours.abtc.order import Order
from parcours.abtc.ordering import MARK, Orders, in_order, order_names, parse_orders
from parcours.abtc.rendezvous import meetings, rendezvous_pairs
from parcours.abtc.requiring import require_cases
from parcours.abtc.sequencing import Emission, Event, Reception, serialise
from parcours.abtc.serialising import POLICIES, AbstractCase, Start, abstract_cases, case_counts, find_case, notation
from parcours.abtc.visits import Visits, as_one_instance, ask_alone

__all__ = [
    "MARK", "POLICIES", "AbstractCase", "Emission", "Event", "Order", "Orders", "Reception", "Start", "Visits",
    "abstract_cases", "as_one_instance", "ask_alone", "case_counts", "combinations", "component_graph",
    "count_sequences", "find_case", "in_order", "interaction_paths", "meetings", "notation", "order_names", "order_of",
    "order_of_case", "parse_orders", "rendezvous_pairs", "require_cases", "sample_sequences", "sequences", "serialise",
    "side_by_side",
]  # fmt: skip
