"""Reads a binding file (docs/bindings.md), with the model and the test inputs that it names, and checks it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from parcours.data import read_input_model
from parcours.errors import BadDomain, BadRequest
from parcours.model.documents import MAX_BYTES, Node, Scalar, read_document
from parcours.model.finding import Finding, complaint, errors_among
from parcours.model.model_file import check_file
from parcours.model.nodes import brief
from parcours.model.structure import Cefsm
from parcours.run.binding.checking import findings as findings_of
from parcours.run.binding.formulas import Formula
from parcours.run.binding.quantities import plain
from parcours.run.binding.schema import FORMAT, NOTHING, PartReader
from parcours.run.binding.structure import Action, Binding, BoundChannel, Command, Role, System

_QUANTITIES = ("radius", "v_max", "w_max", "a_max", "alpha_max")
"""What `robot` may say of the simulated robot [m, m/s, rad/s, m/s2, rad/s2]."""

_REQUIRED = ("parcours", "name", "model", "transport", "nodes", "channels")
_OPTIONAL = (
    "doc", "master", "interfaces", "python_paths", "parameters", "constants", "data", "between", "observe", "provide",
    "quiescence", "timing", "warm_up", "system", "before_case", "after_case",
)  # fmt: skip


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
    document, unread = read_document(text, origin)
    found = [replace(one, message=one.message.replace("a model", "a binding", 1)) for one in unread]
    binding = None
    if document is not None:
        reader = _BindingReader(origin, Path(origin).parent)
        binding = reader.binding(document, model)
        found += reader.findings
        if binding is not None and not found:
            found += findings_of(binding)
    ordered = tuple(sorted(found, key=lambda finding: (finding.file, finding.line, finding.rule, finding.message)))
    return None if errors_among(ordered) else binding, ordered


def refusal(found: tuple[Finding, ...]) -> BadRequest:
    """Return one error that says all errors among the findings, one a line."""
    error = complaint(errors_among(found))
    rule = error.rule.replace("a model must have no errors", "a binding must have no errors", 1)
    return BadRequest(error.where, rule, error.remedy, slug=error.slug.replace("model-errors", "binding-errors"))


class _BindingReader(PartReader):
    """Reads one document as a binding; `findings` has everything that is wrong with its form."""

    def binding(self, node: Node, model: Cefsm | None = None) -> Binding | None:
        """Return the binding, or None if its model, which may be given, cannot be read."""
        items = self.record(node, "a binding", _REQUIRED, _OPTIONAL)
        version = self.text(items.get("parcours"), "'parcours'", FORMAT)
        if version != FORMAT:
            rule = f"'parcours' must be {FORMAT!r}, but is {version[:40]!r}"
            self.add(items["parcours"], "format", rule, f"this version reads {FORMAT} only")
        if model is None and "model" in items:
            model = self.model(items["model"])
        nodes = tuple(self.process(*entry) for entry in self.entries(items.get("nodes"), "nodes"))
        channels = self.channels(items)
        timing = self.entries(items.get("timing"), "timing", self.label)
        warm_up = self.integer(items["warm_up"], "'warm_up'", 0, 1_000_000) if "warm_up" in items else 10
        constants = self.entries(items.get("constants"), "constants")
        parameters = self.entries(items.get("parameters"), "parameters", self.address)
        made = Binding(
            self.label(items.get("name"), "the name of the binding"),
            model or Cefsm("absent", ()),
            self.transport(items.get("transport")),
            nodes,
            channels,
            tuple(self.bound(*entry) for entry in timing),
            warm_up,
            self.system(items["system"]) if "system" in items else None,
            tuple((name, self.constant_of(value, f"constant {name!r}")) for name, value, _ in constants),
            self.data(items["data"]) if "data" in items else (),
            str(self.path(items["data"], "'data'")) if "data" in items else "",
            tuple((name, plain(value)) for name, value, _ in parameters),
            self.actions(items, "before_case"),
            self.actions(items, "after_case"),
            self.folders(items, "interfaces"),
            self.folders(items, "python_paths"),
            self.text(items.get("master"), "'master'"),
            self.origin,
            self.text(items.get("doc"), "'doc'"),
        )
        return made if model is not None else None

    def channels(self, items: dict[str, Node]) -> tuple[BoundChannel, ...]:
        """Return the entries of `channels`, then of `between`, of `observe` and of `provide`."""
        silence = self.duration(items.get("quiescence"), "'quiescence'", 0.5)
        found = [
            self.channel(name, value, line, "model", silence)
            for name, value, line in self.entries(items.get("channels"), "channels")
        ]
        roles: tuple[Role, ...] = ("between", "observe", "provide")
        for role in roles:
            for name, value, line in self.entries(items.get(role), f"topics under {role!r}"):
                found.append(self.channel(name, value, line, role, silence))
        return tuple(found)

    def model(self, node: Node) -> Cefsm | None:
        """Return the model of the file that the node names; its errors become findings here."""
        checked = check_file(self.path(node, "'model'"))
        for finding in errors_among(checked.findings):
            self.findings.append(finding)
        return checked.model

    def data(self, node: Node) -> tuple[str, ...]:
        """Return the names of the inputs of the file that the node names."""
        path = self.path(node, "'data'")
        try:
            return read_input_model(path).names
        except BadDomain as error:
            self.add(node, error.slug, f"'data' must name a file of test inputs: {error.rule}", error.remedy)
            return ()

    def actions(self, items: dict[str, Node], key: str) -> tuple[Action, ...]:
        """Return the steps that stand under a key."""
        return tuple(self.action(item, key) for item in self.listed(items.get(key), f"{key!r}"))

    def folders(self, items: dict[str, Node], key: str) -> tuple[Path, ...]:
        """Return the folders that stand under a key; each must exist."""
        found = []
        for node in self.listed(items.get(key), f"{key!r}"):
            path = self.path(node, f"an item of {key!r}")
            if not path.is_dir():
                rule = f"an item of {key!r} must be a folder, but {brief(str(path))} is none"
                self.add(node, "binding-folder", rule, "paths count from the folder of the binding")
            found.append(path)
        return tuple(found)

    def system(self, node: Node) -> System:
        """Return the section of system tests."""
        optional = ("once", "each", "imminent_collision", "robot", "tolerance", "duration")
        items = self.record(node, "'system'", ("sense", "command"), optional)
        sense = self.entries(items.get("sense"), "channels to sense")
        alarm = None
        if "imminent_collision" in items:
            formula = self.formula(items["imminent_collision"], "'imminent_collision'")
            alarm = (self.spoken_of(items["imminent_collision"], "'imminent_collision'", formula), formula)
        robot = self.record(items.get("robot"), "'robot'", (), _QUANTITIES) if "robot" in items else {}
        return System(
            tuple((name, self.duration(value, f"the period of {name!r}", 0.05)) for name, value, _ in sense),
            self.command(items.get("command")),
            tuple(self.identifier(item, "a channel of 'once'") for item in self.listed(items.get("once"), "'once'")),
            tuple(self.identifier(item, "a channel of 'each'") for item in self.listed(items.get("each"), "'each'")),
            alarm,
            tuple((name, self.number(value, f"{name!r} of the robot")) for name, value in robot.items()),
            self.amount(items.get("tolerance"), "'tolerance'", 0.2),
            self.duration(items.get("duration"), "'duration'", 20.0),
            node.line,
        )

    def command(self, node: Node | None) -> Command:
        """Return what drives the robot."""
        items = self.record(node, "'command'", ("linear", "angular"), ("hold",))
        linear, angular = (self.formula(items.get(key), f"{key!r} of 'command'") for key in ("linear", "angular"))
        hold = items.get("hold")
        is_endless = hold is None or (isinstance(hold, Scalar) and hold.text == "inf")
        time = float("inf") if is_endless else self.duration(hold, "'hold' of 'command'", 1.0)
        on = self.spoken_of(node, "'command'", linear, angular) if node is not None else ""
        return Command(on, linear, angular, time, node.line if node is not None else 0)

    def spoken_of(self, node: Node, what: str, *formulas: Formula) -> str:
        """Return the one channel of which formulas speak."""
        channels = sorted({str(place.steps[0]) for formula in formulas for place in formula.places})
        if len(channels) != 1 and all(formula != NOTHING for formula in formulas):
            rule = f"{what} must speak of one channel, but speaks of {', '.join(channels) or 'none'}"
            self.add(node, "binding-channel", rule, "write e.g. cmd_vel.linear.x")
        return channels[0] if channels else ""
