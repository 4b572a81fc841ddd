"""Names on several domains of ROS 2: `/plan@5` is /plan on the domain 5, `/plan` on that of the environment.

A graph of ROS 2 is one domain. A system may have several, joined by bridges, or by nothing but the tester, who relays
between them as it does within one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from parcours.run.binding.structure import Action, Binding, BoundChannel, NodeProcess

Placed = TypeVar("Placed", NodeProcess, BoundChannel, Action)

LAST_DOMAIN = 232
"""The highest number: that of a port follows from it."""


def within(name: str, domain: int | None) -> str:
    """Return a name on a domain.

    >>> within("/plan", 5), within("/plan", None), within("", 5)
    ('/plan@5', '/plan', '')
    """
    return name if domain is None or not name else f"{name}@{domain}"


def parted(name: str) -> tuple[str, int | None]:
    """Return a name, and the domain that it is on.

    >>> parted("/plan@5"), parted("/plan")
    (('/plan', 5), ('/plan', None))
    """
    plain, _, domain = name.partition("@")
    return plain, int(domain) if domain else None


def domain_of(channel: BoundChannel, node: NodeProcess | None) -> int | None:
    """Return where a node's end of a channel is: where the channel says, else where the node runs."""
    return channel.domain if channel.domain is not None or node is None else node.domain


def parts_on_domains(binding: Binding) -> tuple[NodeProcess | BoundChannel | Action, ...]:
    """Return all parts of a binding that may name a domain."""
    return (*binding.nodes, *binding.channels, *binding.before_case, *binding.after_case)


def domains(binding: Binding) -> set[int]:
    """Return the domains that a binding names."""
    return {one.domain for one in parts_on_domains(binding) if one.domain is not None}


def at_home(binding: Binding, own: int) -> Binding:
    """Return a binding in which nothing names the domain of the environment: there is one name for one thing."""

    def unnamed(parts: tuple[Placed, ...]) -> tuple[Placed, ...]:
        return tuple(replace(one, domain=None) if one.domain == own else one for one in parts)

    return replace(
        binding, nodes=unnamed(binding.nodes), channels=unnamed(binding.channels),
        before_case=unnamed(binding.before_case), after_case=unnamed(binding.after_case),
    )  # fmt: skip
