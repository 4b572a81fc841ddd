"""How much a criterion may ask for: most requirements, steps in all of them, and steps of the search for them."""

from __future__ import annotations

from dataclasses import dataclass

from parcours.errors import BadRequest


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on the requirements of one criterion on one graph.

    Attributes:
        count: most requirements.
        steps: most steps in all of them together; each takes 8 bytes.
        work: most steps of the search for them; some two million take a second.
    """

    count: int = 1_000_000
    steps: int = 20_000_000
    work: int = 16_000_000


class Tally:
    """Counts requirements as they are found, against limits.

    >>> tally = Tally(Limits(count=1), "prime paths of 'door'")
    >>> tally.add(3)
    >>> tally.add(3)
    Traceback (most recent call last):
    parcours.errors.BadRequest: prime paths of 'door': there must be at most 1, but the search was stopped at 2 of \
6 steps in all, with more to come; take a weaker criterion, cover parts of the model, or raise the limit \
[too-many-requirements]
    """

    def __init__(self, limits: Limits, what: str) -> None:
        self.limits, self.what = limits, what
        self.count = self.steps = self.work = 0

    def add(self, steps: int) -> None:
        """Count one requirement with this number of steps. Raises BadRequest: it is one too many, or its steps are."""
        self.count += 1
        self.steps += steps
        if self.count > self.limits.count:
            raise self._refusal(f"at most {self.limits.count}")
        if self.steps > self.limits.steps:
            raise self._refusal(f"at most {self.limits.steps} steps in all of them")
        self.tick()

    def tick(self) -> None:
        """Count one step of the search. Raises BadRequest if it is one too many."""
        self.work += 1
        if self.work > self.limits.work:
            raise self._refusal(f"so few that {self.limits.work} steps of the search find them")

    def _refusal(self, rule: str) -> BadRequest:
        return BadRequest(
            self.what,
            f"there must be {rule}, but the search was stopped at {self.count} of {self.steps} steps in all, "
            "with more to come",
            "take a weaker criterion, cover parts of the model, or raise the limit",
            slug="too-many-requirements",
        )
