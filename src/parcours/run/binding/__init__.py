"""Bindings: which processes, topics and services of a foreign system stand for the parts of a model."""

from parcours.run.binding.binding_file import check_binding, parse_binding, read_binding
from parcours.run.binding.compiling import Compiled, compile_binding
from parcours.run.binding.graph import RegisteredGraph, graph_findings
from parcours.run.binding.message_types import MessageTypes
from parcours.run.binding.routes import BindingRoute, arguments, remappings, routes
from parcours.run.binding.structure import Binding, BoundChannel, NodeProcess

__all__ = [
    "Binding",
    "BindingRoute",
    "BoundChannel",
    "Compiled",
    "MessageTypes",
    "NodeProcess",
    "RegisteredGraph",
    "arguments",
    "check_binding",
    "compile_binding",
    "graph_findings",
    "parse_binding",
    "read_binding",
    "remappings",
    "routes",
]
