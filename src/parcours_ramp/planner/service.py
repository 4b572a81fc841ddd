"""What RAMP's services have in common: they act on requests only, never because time has passed."""

from __future__ import annotations

from collections.abc import Iterator

from parcours_ramp.planner.messages import Step


class Service:
    """A component that keeps nothing between requests and has no timer."""

    def reset(self) -> None:
        """Nothing is kept between requests."""

    def next_wake(self) -> int | None:
        """Time alone demands nothing."""
        return None

    def wake(self, now: int) -> Iterator[Step]:
        """Time alone demands nothing."""
        yield from ()
