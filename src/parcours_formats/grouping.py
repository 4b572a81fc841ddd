"""Groups items that have something in common."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def grouped(keys: Sequence[Iterable[str]]) -> list[list[int]]:
    """Return the indices of items in groups: those with a key in common, directly or through others, are in one.

    >>> grouped(["a", "b", "", "bc", "ac"])
    [[0, 1, 3, 4], [2]]
    """
    # Union-find: each item points towards the leader of its group, which is the item that comes first.
    leader, first = list(range(len(keys))), dict[str, int]()

    def lead(at: int) -> int:
        while leader[at] != at:
            leader[at] = leader[leader[at]]  # halves the way for the next search
            at = leader[at]
        return at

    for at, own in enumerate(keys):
        for key in own:
            one, other = sorted((lead(first.setdefault(key, at)), lead(at)))
            leader[other] = one
    groups: dict[int, list[int]] = {}
    for at in range(len(keys)):
        groups.setdefault(lead(at), []).append(at)
    return list(groups.values())
