"""More and shorter paths that visit the same within a limit on their length."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from parcours.errors import BadRequest
from parcours.paths.automaton import SILENT, Trie
from parcours.paths.graph import Graph, Walk


def within(
    graph: Graph, paths: Sequence[Walk], wanted: Sequence[Walk], ends: set[int], max_length: int
) -> tuple[Walk, ...]:
    """Return paths of at most `max_length` edges that visit what is wanted in the order in which `paths` do.

    Args:
        graph: the graph.
        paths: walks from the start that contain all that is wanted.
        wanted: walks of the graph, none inside another.
        ends: states where a path may end; each state leads to one.
        max_length: most edges of a path.

    Raises:
        BadRequest: one of the wanted walks does not fit into a path so short.
    """
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    outward = _nearest([0], sources, targets)
    homeward = _nearest(sorted(ends), targets, sources)
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
            home = len(_way(homeward, targets[edge], targets))
            if done < 0 or len(shorter[-1]) + place - done + home > max_length:
                first = place + 1 - length[begun]
                out = _way(outward, sources[path[first]], sources)
                shorter.append([*reversed(out), *path[first : place + 1]])
                if len(shorter[-1]) + home > max_length:
                    what = " ".join(graph.edges[each] for each in path[first : place + 1])
                    rule = (
                        f"a path of at most {max_length} edges must visit {what}, but needs {len(shorter[-1]) + home}"
                    )
                    raise BadRequest(f"graph of {graph.name!r}", rule, "allow longer paths", slug="length-limit")
            else:
                shorter[-1] += path[done + 1 : place + 1]
            done = place
    return tuple((*path, *_way(homeward, targets[path[-1]], targets)) for path in shorter)


def shortest_path(graph: Graph, ends: Sequence[int]) -> Walk:
    """Return a path with the fewest edges, but one at least, from the start to one of the ends.

    >>> from parcours.model.structure import Machine, Transition
    >>> from parcours.paths.graph import graph_of
    >>> steps = (Transition("go", "a", "b"), Transition("back", "b", "a"))
    >>> shortest_path(graph_of(Machine("m", "a", ("a", "b"), steps)), [0])
    (0, 1)
    """
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    homeward = _nearest(ends, targets, sources)
    ways = [(edge, *_way(homeward, targets[edge], targets)) for edge, source in enumerate(sources) if not source]
    return min(ways, key=len)


def _nearest(begin: Iterable[int], sources: Sequence[int], targets: Sequence[int]) -> dict[int, int]:
    """Return for each state the last edge of a shortest way from `begin`, SILENT there."""
    leaving: dict[int, list[int]] = {}
    for edge, source in enumerate(sources):
        leaving.setdefault(source, []).append(edge)
    came = dict.fromkeys(begin, SILENT)
    queue = deque(came)
    while queue:
        for edge in leaving.get(queue.popleft(), ()):
            if targets[edge] not in came:
                came[targets[edge]] = edge
                queue.append(targets[edge])
    return came


def _way(came: dict[int, int], state: int, before: Sequence[int]) -> list[int]:
    """Return the edges from a state back to where the search began; `before` is the end nearer to it."""
    way = []
    while (edge := came[state]) != SILENT:
        way.append(edge)
        state = before[edge]
    return way
