"""More and shorter paths that visit the same within a limit on their length."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from parcours.errors import BadRequest
from parcours.paths.automaton import Trie
from parcours.paths.graph import Came, Graph, Walk, breadth_first, way_to


def within(
    graph: Graph, paths: Sequence[Walk], wanted: Sequence[Walk], ends: set[int], max_length: int
) -> tuple[Walk, ...]:
    """Return paths of at most `max_length` edges that visit what is wanted in the order in which `paths` do."""
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    outward = _reached([0], sources, targets)
    homeward = _reached(sorted(ends), targets, sources)
    trie = Trie(len(graph.edges), wanted)
    length = dict(zip(trie.ends, map(len, wanted), strict=True))
    due = set(length)
    shorter: list[list[int]] = []
    for path in paths:
        begun, done = 0, -1  # how far the trie and the last short path have come along this path
        for place, edge in enumerate(path):
            begun = trie.after(begun, edge)
            if begun not in due:
                continue
            due.discard(begun)
            home = len(_home(targets[edge], homeward))
            if done < 0 or len(shorter[-1]) + place - done + home > max_length:
                first = place + 1 - length[begun]
                shorter.append([*way_to(sources[path[first]], outward), *path[first : place + 1]])
                if len(shorter[-1]) + home > max_length:
                    what = " ".join(graph.edges[each] for each in path[first : place + 1])
                    rule = (
                        f"a path of at most {max_length} edges must visit {what}, but needs {len(shorter[-1]) + home}"
                    )
                    raise BadRequest(f"graph of {graph.name!r}", rule, "allow longer paths", slug="length-limit")
            else:
                shorter[-1] += path[done + 1 : place + 1]
            done = place
    return tuple((*path, *_home(targets[path[-1]], homeward)) for path in shorter)


def shortest_path(graph: Graph, ends: Sequence[int]) -> Walk:
    """Return a path with the fewest edges, but one at least, from the start to one of the ends."""
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    homeward = _reached(ends, targets, sources)
    ways = [(edge, *_home(targets[edge], homeward)) for edge, source in enumerate(sources) if not source]
    return min(ways, key=len)


def _reached(begin: Iterable[int], sources: Sequence[int], targets: Sequence[int]) -> Came[int, int]:
    """Return how each state is reached from `begin` by the fewest edges, taken from their source to their target."""
    leaving: dict[int, list[tuple[int, int]]] = {}
    for edge, (source, target) in enumerate(zip(sources, targets, strict=True)):
        leaving.setdefault(source, []).append((edge, target))
    came: Came[int, int] = {}
    for _ in breadth_first(begin, lambda state: leaving.get(state, ()), came):
        pass
    return came


def _home(state: int, homeward: Came[int, int]) -> list[int]:
    # The search went backwards from the ends.
    return way_to(state, homeward)[::-1]
