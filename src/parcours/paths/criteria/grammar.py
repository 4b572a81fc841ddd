"""Names of criteria with their parameters, and which criterion subsumes which."""

from __future__ import annotations

import re
from dataclasses import dataclass

from parcours.errors import BadRequest, require_known

GRAPH_CRITERIA = {
    "node": "every state",
    "edge": "every transition",
    "edge-pair": "every two transitions, one straight after the other",
    "N-switch": "every N + 1 transitions in a row, as 2-switch",
    "prime": "every prime path: a longest path on which no state comes twice",
    "simple-round-trip": "for each state that has one, a prime path from there back to it",
    "complete-round-trip": "every prime path that returns to where it began",
    "complete:N": "every path from the start to a final state of at most N transitions",
    "tag": "every state and transition that has a tag, for each of its tags",
    "specified:WALKS": "the walks given: transitions between blanks, walks between commas",
}
"""What each criterion over a graph requires."""

DATA_CRITERIA = {
    "all-defs": "from every definition of a variable some use of it",
    "all-uses": "from every definition every use that it reaches",
    "all-du-paths": "from every definition to every use every path on which no state comes twice",
}
"""What each criterion over the variables of a machine requires."""

COMMUNICATION_CRITERIA = {
    "channel": "a message delivered on every channel",
    "message": "a message delivered of every class",
    "rendezvous": "on every channel every transition that sends, received by every one that receives",
}
"""What each criterion over the channels of a model requires."""

CRITERIA = {**GRAPH_CRITERIA, **DATA_CRITERIA, **COMMUNICATION_CRITERIA}
"""All criteria: how each is written, and what it requires."""


@dataclass(frozen=True, slots=True)
class CoverageCriterion:
    """A criterion with its parameter.

    Attributes:
        name: as in `CRITERIA`, without the parameter: `switch`, `complete`, `specified`.
        number: of `switch` and `complete`.
        walks: of `specified`: transition ids in order.

    >>> print(CoverageCriterion("switch", 2), CoverageCriterion("specified", walks=(("t1", "t2"), ("t3",))))
    2-switch specified:t1 t2, t3
    """

    name: str
    number: int = 0
    walks: tuple[tuple[str, ...], ...] = ()

    @property
    def family(self) -> str:
        """What it looks at: graph, data or communication."""
        if self.name in DATA_CRITERIA:
            return "data"
        return "communication" if self.name in COMMUNICATION_CRITERIA else "graph"

    def __str__(self) -> str:
        if self.name == "switch":
            return f"{self.number}-switch"
        if self.name == "complete":
            return f"complete:{self.number}"
        if self.name == "specified":
            return f"specified:{', '.join(' '.join(walk) for walk in self.walks)}"
        return self.name


def parse_criterion(text: str) -> CoverageCriterion:
    """Return the criterion that a text names.

    Args:
        text: one of `CRITERIA`, with a number for N, or walks for WALKS. Transitions whose ids hold blanks or commas
            cannot be written so: give `CoverageCriterion("specified", walks=...)` instead.

    Raises BadRequest: no criterion is written like that.

    >>> parse_criterion("2-switch")
    CoverageCriterion(name='switch', number=2, walks=())
    >>> parse_criterion("complete:few")
    Traceback (most recent call last):
    parcours.errors.BadRequest: coverage criterion 'complete:few': it needs a number from 1 to 999999999, but 'few' \
was given; write it as complete:5 [criterion-number]
    """
    text = text.strip()
    head, colon, rest = text.partition(":")
    if head == "specified":
        walks = tuple(tuple(walk.split()) for walk in rest.split(",") if walk.strip())
        if not walks:
            rule = "it needs walks of transitions, but none was given"
            raise BadRequest(f"coverage criterion {text!r}", rule, "write it as specified:t1 t2, t3", slug="no-walks")
        return CoverageCriterion("specified", walks=walks)
    if head == "complete":
        return CoverageCriterion("complete", _number(text, rest, 1, "complete:5"))
    if head.endswith("-switch") and not colon:
        return CoverageCriterion("switch", _number(text, head.removesuffix("-switch"), 0, "2-switch"))
    require_known(text, list(CRITERIA), "coverage criterion", slug="unknown-criterion")
    return CoverageCriterion(text)


def _number(text: str, given: str, least: int, example: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", given) or int(given) < least:
        rule = f"it needs a number from {least} to 999999999, but {given!r} was given"
        raise BadRequest(f"coverage criterion {text!r}", rule, f"write it as {example}", slug="criterion-number")
    return int(given)


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


def subsumes(stronger: str | CoverageCriterion, weaker: str | CoverageCriterion) -> bool:
    """Return whether tests that satisfy the one criterion satisfy the other, whatever the graph.

    Raises BadRequest: one of them is not written like that.
    """
    above, below = _as_switch(stronger), _as_switch(weaker)
    if above.name == below.name:
        return above.number >= below.number and set(above.walks) >= set(below.walks)
    written = ("N-switch" if above.number else "edge") if above.name == "switch" else above.name
    return any(subsumes(following, below) for following in SUBSUMES.get(written, ()))


def _as_switch(given: str | CoverageCriterion) -> CoverageCriterion:
    criterion = parse_criterion(given) if isinstance(given, str) else given
    switches = {"edge": 0, "edge-pair": 1}
    return CoverageCriterion("switch", switches[criterion.name]) if criterion.name in switches else criterion
