"""Which criterion subsumes which: tests that satisfy the stronger one satisfy the weaker one, on any graph."""

from __future__ import annotations

from parcours.paths.criteria.grammar import Criterion, parse_criterion

SUBSUMES: dict[str, tuple[str, ...]] = {
    "edge": ("node",),
    "edge-pair": ("edge",),
    "N-switch": ("edge",),
    "prime": ("edge", "complete-round-trip"),
    "complete-round-trip": ("simple-round-trip",),
    "all-du-paths": ("all-uses",),
    "all-uses": ("all-defs",),
    "channel": ("message",),
}
"""For each criterion the next weaker ones; a longer switch subsumes a shorter one, a higher bound a lower one.

Prime paths do not subsume edge pairs: a loop, and what follows it, is a pair but visits a state twice. Nor do they
subsume all-uses: definitions and uses stand on transitions here, and a loop that defines may come before one that uses.
"""


def subsumes(stronger: str | Criterion, weaker: str | Criterion) -> bool:
    """Return whether tests that satisfy the one criterion satisfy the other, whatever the graph.

    Args:
        stronger: one of `parcours.paths.CRITERIA`.
        weaker: another.

    Raises:
        BadRequest: one of them is not written like that.

    >>> subsumes("prime", "node"), subsumes("prime", "edge-pair"), subsumes("2-switch", "edge-pair")
    (True, False, True)
    """
    above, below = _as_switch(stronger), _as_switch(weaker)
    if above.name == below.name:
        return above.number >= below.number and set(above.walks) >= set(below.walks)
    written = ("N-switch" if above.number else "edge") if above.name == "switch" else above.name
    return any(subsumes(following, below) for following in SUBSUMES.get(written, ()))


def _as_switch(given: str | Criterion) -> Criterion:
    criterion = parse_criterion(given) if isinstance(given, str) else given
    switches = {"edge": 0, "edge-pair": 1}
    return Criterion("switch", switches[criterion.name]) if criterion.name in switches else criterion
