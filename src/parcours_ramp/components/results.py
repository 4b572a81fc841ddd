"""What the paper's report shows of component cases: Table VIII and Fig. 5a."""

from __future__ import annotations

from parcours.report.pieces import Figure, Table
from parcours.report.timings import timing_figure, timing_table
from parcours.study.components.results import (
    FILE,
    ComponentResult,
    ComponentResults,
    component_results,
    component_table,
    read_components,
    timed,
    write_components,
)

__all__ = [
    "FILE",
    "ComponentResult",
    "ComponentResults",
    "component_results",
    "component_table",
    "read_components",
    "timed",
    "timing_pieces",
    "write_components",
]


def timing_pieces(given: ComponentResults, where: str) -> tuple[Table | Figure, ...]:
    """Return Fig. 5a and the table beside it; nothing if no case was timed.

    Args:
        given: the results.
        where: the components were, in words.
    """
    cases = timed(given)
    if not cases:
        return ()
    note = (
        f"Durations on the wall clock of this machine, {where}, from the first to the last event of an abstract case; "
        "warm-up left out. A verdict that noise could have made is refused. Durations are measured anew in every run, "
        "so they are not part of the results that repeat bit for bit."
    )
    noise = max(given.noise.values(), key=lambda one: one.p99)
    return (
        timing_table("Table VIII, performance", cases, note),
        timing_figure("Fig. 5a: duration of component interactions", cases, noise),
    )
