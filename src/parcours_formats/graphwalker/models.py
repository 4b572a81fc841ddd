"""What GraphWalker's files say, in JSON as in labels of graphs: vertices and edges, with texts still in JavaScript."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Vertex:
    """A vertex; those that share a state in several models are places where the walk may change the model."""

    id: str
    name: str
    shared: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    blocked: bool = False
    line: int = 0


@dataclass(slots=True)
class Edge:
    """An edge; one without source is where a walk starts. `weight` is its share of probability, 0 if not said."""

    id: str
    name: str
    source: str
    target: str
    guard: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    weight: float = 0.0
    dependency: int = 0
    blocked: bool = False
    line: int = 0


@dataclass(slots=True)
class Model:
    """One graph: `start` is the id of the vertex or edge where a walk starts, if it is said."""

    name: str
    vertices: list[Vertex]
    edges: list[Edge]
    start: str = ""
    actions: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    generator: str = ""
    predefined: tuple[str, ...] = ()
    line: int = 0
