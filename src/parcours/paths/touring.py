"""Arcs and how often each is taken -> one closed tour that takes them so (Hierholzer's walk, 1873)."""

from __future__ import annotations

from collections.abc import Sequence


def euler_tour(sources: Sequence[int], targets: Sequence[int], taken: Sequence[int], root: int) -> list[int]:
    """Return the arcs of a closed tour from `root` that takes each arc as often as said.

    It is deterministic: at a node, an arc not taken yet goes before a repeated one, and earlier arcs go before
    later ones.

    Args:
        sources, targets: the nodes each arc joins, shape (n_arcs,).
        taken: how often to take each arc, shape (n_arcs,); every node is left as often as it is entered, and what
            is taken hangs together with the root.
        root: the node where the tour begins and ends.

    Example: the inner circle is walked twice because two arcs lead into it and one leads out.

    >>> euler_tour([0, 0, 1], [1, 1, 0], [1, 1, 2], root=0)
    [0, 2, 1, 2]
    """
    waiting: dict[int, list[int]] = {}
    for arc, count in enumerate(taken):
        if count:
            waiting.setdefault(sources[arc], []).append(arc)
    for arc, count in enumerate(taken):
        if count > 1:
            waiting[sources[arc]].extend([arc] * (count - 1))
    for queue in waiting.values():
        queue.reverse()  # so that pop() takes the first
    tour: list[int] = []
    trail: list[tuple[int, int]] = [(root, -1)]
    while trail:
        node, taken_last = trail[-1]
        queue = waiting.get(node, [])
        if queue:
            arc = queue.pop()
            trail.append((targets[arc], arc))
        else:
            trail.pop()
            tour.append(taken_last)
    tour.reverse()
    return tour[1:]
