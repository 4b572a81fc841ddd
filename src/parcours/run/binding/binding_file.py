"""Reads a binding file (docs/bindings.md), with the model and the test inputs that it names, and checks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from parcours.errors import BadDomain, BadRequest, ParcoursError
from parcours.model.documents import MAX_BYTES, Mapping, Node, read_document
from parcours.model.finding import Finding, complaint, errors_among
from parcours.model.model_file import check_file
from parcours.model.nodes import brief
from parcours.model.structure import Cefsm, Component
from parcours.run.binding.checking import findings as findings_of
from parcours.run.binding.quantities import Table, plain
from parcours.run.binding.schema import PartReader
from parcours.run.binding.structure import Binding, NodeProcess, Role

T = TypeVar("T")

FORMAT = "binding/1"
"""The number of the format that this version reads."""

_REQUIRED = ("parcours", "name", "model", "transport", "nodes", "channels")
_REQUIRED_OF_STACK = ("parcours", "name", "transport", "nodes", "stack")
"""What a navigation stack needs: its model is its standard interface."""

_ROLES: dict[str, Role] = {"channels": "model", "between": "between", "observe": "observe", "provide": "provide"}


def read_binding(path: Path | str) -> Binding:
    """Return the binding that a file holds, with its model.

    Args:
        path: a YAML file of format binding/1, UTF-8, at most 1 MB; files that it names count from its folder.

    Raises:
        BadRequest: the file cannot be read, or is no binding of its model; the message lists all findings with their
            lines.
    """
    try:
        with Path(path).open("rb") as file:
            text = file.read(MAX_BYTES + 1).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        said = error.strerror if isinstance(error, OSError) else "its bytes are no UTF-8 text"
        rule = f"a binding must be a readable file, but: {said}"
        raise BadRequest(str(path), rule, "check the path", slug="unreadable-file") from None
    return parse_binding(text, str(path))


def parse_binding(text: str, origin: str = "<text>", model: Cefsm | None = None) -> Binding:
    """Return the binding that a text holds.

    Args:
        text: YAML of format binding/1.
        origin: the file's name, for messages; files that the text names count from its folder.
        model: the model to bind; None reads the file that the text names.

    Raises:
        BadRequest: the text is no binding of its model; the message lists all findings with their lines.
    """
    binding, found = check_binding(text, origin, model)
    if binding is None:
        raise refusal(found)
    return binding


def check_binding(
    text: str, origin: str = "<text>", model: Cefsm | None = None
) -> tuple[Binding | None, tuple[Finding, ...]]:
    """Return the binding of a text, None if it has errors, and every finding in the order of the lines."""
    document, found = read_document(text, origin, "a binding")
    binding = None
    if document is not None:
        reader = _BindingReader(origin, Path(origin).parent)
        binding = reader.binding(document, model)
        found += reader.findings
        if binding is not None and not found:
            found += findings_of(binding)
    ordered = tuple(sorted(found, key=lambda finding: (finding.file, finding.line, finding.rule, finding.message)))
    return None if errors_among(ordered) else binding, ordered


def refusal(found: tuple[Finding, ...]) -> ParcoursError:
    """Return one error that says all errors among the findings, one per line."""
    return complaint(errors_among(found), "a binding", BadRequest, "binding-errors")


class _BindingReader(PartReader):
    """Reads one document as a binding; `findings` has everything that is wrong with its form."""

    def binding(self, node: Node, model: Cefsm | None = None) -> Binding | None:
        """Return the binding, or None if its model, which may be given, cannot be read."""
        table: Table = {
            "parcours": (self.version, None), "name": (self.label, ""), "doc": (self.text, ""),
            "model": (lambda node, what: model or self.model(node, what), model),
            "transport": (self.choice("ros1", "ros2"), "ros1"), "master": (self.text, ""),
            "nodes": (self.every(self.process), ()), "timing": (self.every(self.bound, self.label), ()),
            **{key: (self.every(partial(self.channel, role)), ()) for key, role in _ROLES.items()},
            "quiescence": (self.duration, 0.5), "system": (self.system, None), "data": (self.data, ((), "")),
            "stack": (self.stack, None), "clock": (self.duration, 0.0),
            "warm_up": (lambda node, what: self.integer(node, what, 0, 1_000_000), 10),
            "constants": (self.pairs(self.constant_of), ()),
            "parameters": (self.pairs(lambda node, what: plain(node), self.address), ()),
            "before_case": (self.actions, ()), "after_case": (self.actions, ()),
            "interfaces": (self.folders, ()), "python_paths": (self.folders, ()),
        }  # fmt: skip
        is_stack = isinstance(node, Mapping) and any(key.text == "stack" for key, _ in node.items)
        said = self.section(node, "a binding", table, _REQUIRED_OF_STACK if is_stack else _REQUIRED, is_top=True)
        del said["parcours"]
        silence = said.pop("quiescence")
        channels = [one for key in _ROLES for one in said.pop(key)]
        if said["stack"] is not None:
            said["stack"], standard = said["stack"]
            channels += standard
            self.unmodelled(said)
        if said["clock"] or (said["stack"] is not None and said["stack"].simulated):
            self.led_by_clock(said)
        # A channel is silent after the binding's own time, unless it says another.
        said["channels"] = tuple(replace(one, quiescence=one.quiescence or silence) for one in channels)
        said["data"], said["data_file"] = said["data"]
        return None if said["model"] is None else Binding(source=self.origin, **said)

    def unmodelled(self, said: dict[str, Any]) -> None:
        """Let the nodes of a navigation stack stand for components of their own names."""
        nodes: tuple[NodeProcess, ...] = said["nodes"]
        if said["model"] is None:
            said["nodes"] = nodes = tuple(replace(one, components=(one.name,)) for one in nodes)
            said["model"] = Cefsm(said["name"], tuple(Component(one.name, ()) for one in nodes))

    def led_by_clock(self, said: dict[str, Any]) -> None:
        """Let all nodes take their time from /clock."""
        given = dict(said["parameters"])
        for one in said["nodes"]:
            if one.ros_node:
                given.setdefault(f"{one.ros_node}/use_sim_time", True)
            elif one.components:
                rule = f"node {one.name!r} is led by /clock, so 'ros_node' must say how to ask it, but it is missing"
                self.findings.append(
                    Finding(self.origin, one.line, "error", "missing-key", rule, "add e.g. ros_node: /planner")
                )
        said["parameters"] = tuple(given.items())

    def version(self, node: Node, what: str) -> None:
        """See that this version reads the format."""
        version = self.text(node, what, FORMAT)
        if version != FORMAT:
            rule = f"{what} must be {FORMAT!r}, but is {version[:40]!r}"
            self.add(node, "format", rule, f"this version reads {FORMAT} only")

    def every(
        self, read: Callable[[str, Node, int], T], name: Callable[[Node, str], str] | None = None
    ) -> Callable[[Node, str], tuple[T, ...]]:
        """Return what reads all entries of a mapping, each from its name, value and line."""
        return lambda node, what: tuple(read(*entry) for entry in self.entries(node, what, name))

    def model(self, node: Node, what: str) -> Cefsm | None:
        """Return the model of the file that the node names; its errors become findings here."""
        checked = check_file(self.path(node, what))
        self.findings += errors_among(checked.findings)
        return checked.model

    def data(self, node: Node, what: str) -> tuple[tuple[str, ...], str]:
        """Return the names of the inputs of the file that the node names, and the file."""
        from parcours.data import read_input_model  # which loads what compiles

        path = self.path(node, what)
        try:
            return read_input_model(path).names, str(path)
        except BadDomain as error:
            self.add(node, error.slug, f"{what} must name a file of test inputs: {error.rule}", error.remedy)
            return (), str(path)

    def folders(self, node: Node, what: str) -> tuple[Path, ...]:
        """Return the folders of a list; each must exist."""
        found = []
        for item in self.listed(node, what):
            path = self.path(item, f"an item of {what}")
            if not path.is_dir():
                rule = f"an item of {what} must be a folder, but {brief(str(path))} is not"
                self.add(item, "binding-folder", rule, "paths count from the folder of the binding")
            found.append(path)
        return tuple(found)
