"""An internal path -> its serialization points: where it may stand when the next path starts (RSA policies).

A point is a number of transitions already taken. The paper cites the algorithm (RSA) but does not print it;
which points count is therefore a named policy. The default reproduces the paper's numbers of abstract test
cases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from parcours.errors import require_known
from parcours.paths.internal import InternalPath


@dataclass(frozen=True, slots=True)
class Policy:
    """Which points of a path count.

    `marks` gives the points, as numbers of transitions taken, of a path that does or does not meet others.
    With `hub_at_request`, the hub's paths have a single point instead: their request to the next component.
    """

    doc: str
    marks: Callable[[InternalPath, bool], tuple[int, ...]]
    hub_at_request: bool = False


def _all_states(path: InternalPath, meets: bool) -> tuple[int, ...]:
    return (0, *(place + 1 for place in path.changes))


def _before_return(path: InternalPath, meets: bool) -> tuple[int, ...]:
    marks = _all_states(path, meets)
    return marks[:-1] if path.is_closed and path.changes else marks


def _distinct_states(path: InternalPath, meets: bool) -> tuple[int, ...]:
    return tuple(path.states.index(state) for state in dict.fromkeys(path.states))


def _every_transition(path: InternalPath, meets: bool) -> tuple[int, ...]:
    return tuple(range(len(path.transitions) + 1))


def _by_rendezvous(path: InternalPath, meets: bool) -> tuple[int, ...]:
    return _before_return(path, meets) if meets else _all_states(path, meets)


DEFAULT = "hub"
"""The policy that yields the paper's 19 + 48 = 67 component cases and 9 obstacle start vectors."""

POLICIES: dict[str, Policy] = {
    "hub": Policy(
        "a hub's request; every state of a path that meets nobody; of others, all states but the return",
        _by_rendezvous,
        hub_at_request=True,
    ),
    "all-states": Policy("every state the path comes to, the final one included", _all_states),
    "before-return": Policy("every state the path comes to before it returns to where it began", _before_return),
    "distinct-states": Policy("each state once, where the path first comes to it", _distinct_states),
    "every-transition": Policy("before and after every transition, loops included", _every_transition),
}
"""Point policies by name."""


def policy(name: str = DEFAULT) -> Policy:
    """Return the policy called `name`.

    Args:
        name: a name in `POLICIES`.

    Raises:
        BadRequest: no policy has that name.

    Example: a moving obstacle is caught standing, moving, or standing again.

    >>> from parcours.model.structure import Transition
    >>> path = InternalPath("tp11", "Obstacle1", "motion", (
    ...     Transition("p11", "stopped", "moving"), Transition("p12", "moving", "stopped")))
    >>> policy().marks(path, False), policy("before-return").marks(path, False)
    ((0, 1, 2), (0, 1))
    """
    require_known(name, list(POLICIES), "serialization policy", slug="unknown-policy")
    return POLICIES[name]
