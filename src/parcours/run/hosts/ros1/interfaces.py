"""A model's channels and the flat forms of their messages -> a ROS 1 package: .msg and .srv files, C++ headers.

Two channels of one topic in opposite directions are a service, the one that the model names first its request; any
other channel is a topic. No workspace is needed: `messages.load` makes Python classes of the folder, `write_headers`
C++.
"""

from __future__ import annotations

import json
import keyword
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, NoReturn, Protocol

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm, Channel
from parcours.run.hosts.ros1 import interpreter_with
from parcours.run.port import Link

Role = Literal["topic", "request", "response"]

INDEX = "channels.json"
"""The file of a package's folder that tells which message or service carries which channel."""

TYPES = {"float": "float64", "int": "int64", "bool": "bool", "floats": "float64[]", "ints": "int64[]"}
"""Kinds of field in a flat form, and what they are in a .msg file."""

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", re.IGNORECASE)
_PACKAGE = re.compile(r"[a-z][a-z0-9_]*")
_TYPE = re.compile(r"[A-Za-z0-9]+")
_CPP = frozenset(
    re.findall(
        r"\w+",
        """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class compl
    const const_cast constexpr continue decltype default delete do double dynamic_cast else enum explicit
    export extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast return short signed sizeof
    static static_assert static_cast struct switch template this thread_local throw true try typedef typeid
    typename union unsigned using virtual void volatile wchar_t while xor xor_eq
    """,
    )
)
_TEMPLATES = "/usr/share/gencpp"


class Field(Protocol):
    """A field of a flat form."""

    @property
    def name(self) -> str:
        """A Python identifier."""

    @property
    def kind(self) -> str:
        """One of TYPES."""

    @property
    def doc(self) -> str:
        """What it means, with its unit."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A channel as ROS sees it: `type` names a .msg file, or the .srv file of which it is request or response."""

    channel: str
    topic: str
    role: Role
    type: str
    sender: str
    receiver: str


def interfaces(cefsm: Cefsm, also: Sequence[Link] = ()) -> tuple[Interface, ...]:
    """Return the model's channels as topics and halves of services, in the model's order, then the other links.

    A channel without a topic gets one of its own name.

    Args:
        cefsm: a checked model.
        also: links of which some are not in the model: each of these becomes a topic, with a type of its own name.

    Raises:
        HostFailure: a topic that goes both ways does not belong to exactly two channels.

    >>> model = Cefsm("m", (), (
    ...     Channel("ask", "A", "B", "Question", "/path_modification"),
    ...     Channel("reply", "B", "A", "Answer", "/path_modification"), Channel("news", "A", "B", "obstacle_list")))
    >>> for one in interfaces(model):
    ...     print(one.channel, one.topic, one.role, one.type)
    ask /path_modification request PathModification
    reply /path_modification response PathModification
    news /news topic ObstacleList
    """
    found = []
    for channel in cefsm.channels:
        topic = channel.topic or f"/{channel.name}"
        role = _role(channel, [other for other in cefsm.channels if channel.topic and other.topic == channel.topic])
        kind = camel_case(channel.message if role == "topic" else topic)
        found.append(Interface(channel.name, topic, role, kind, channel.sender, channel.receiver))
    known = {channel.name for channel in cefsm.channels}
    found += [
        Interface(link.channel, f"/{link.channel}", "topic", camel_case(link.channel), link.sender, link.receiver)
        for link in also
        if link.channel not in known
    ]
    return tuple(found)


def _role(channel: Channel, sharing: Sequence[Channel]) -> Role:
    if all((other.sender, other.receiver) != (channel.receiver, channel.sender) for other in sharing):
        return "topic"
    if len(sharing) != 2:
        rule = "a service has one request and one response, but shared by " + ", ".join(other.name for other in sharing)
        _refuse(f"topic {channel.topic!r}", rule, "give other channels other topics")
    return "request" if channel is sharing[0] else "response"


def camel_case(name: str) -> str:
    """Return the name as ROS writes types.

    >>> camel_case("/trajectory_generation"), camel_case("RampTrajectory")
    ('TrajectoryGeneration', 'RampTrajectory')
    """
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", name))


def ros_name(field: str) -> str:
    """Return what the field is called in a .msg file: a word of Python or C++ gets an underscore.

    >>> ros_name("stamp"), ros_name("operator")
    ('stamp', 'operator_')
    """
    return f"{field}_" if keyword.iskeyword(field) or field in _CPP else field


def write_package(
    folder: Path, package: str, channels: Sequence[Interface], forms: Mapping[str, Sequence[Field]]
) -> None:
    """Write the .msg and .srv files of the channels, with what their fields mean, and an index.

    Args:
        folder: made if it does not exist.
        package: what ROS calls it, such as parcours_ramp.
        channels: what `interfaces` returned.
        forms: channel -> fields of its flat form, in order.

    Raises:
        HostFailure: a channel has no form, a form is not well formed, or two different forms would get one name.
    """
    if not _PACKAGE.fullmatch(package):
        _refuse(f"ROS package {package!r}", "must be named in lower case, digits and underscores", "")
    texts: dict[str, str] = {}
    named: dict[str, str] = {}
    for one in channels:
        if one.channel not in forms:
            _refuse(f"channel {one.channel!r}", "must have a flat form, but has none", f"known: {', '.join(forms)}")
        body = _body(one, forms[one.channel])
        if one.role == "response":
            continue
        if one.role == "request":
            answer = next(other for other in channels if other.type == one.type and other.role == "response")
            path, text = f"srv/{one.type}.srv", f"{body}---\n{_body(answer, forms.get(answer.channel, ()))}"
            names = [one.type, f"{one.type}Request", f"{one.type}Response"]
        else:
            path, text, names = f"msg/{one.type}.msg", body, [one.type]
        for name in names:
            if named.setdefault(name, path) != path:
                _refuse(path, f"must have a name of its own, but {named[name]} also makes a {name}", "rename a topic")
        if path in texts and _fields(texts[path]) != _fields(text):
            rule = f"must be one form, but that of {one.channel!r} differs from a channel's before it"
            _refuse(path, rule, "rename its message")
        texts.setdefault(path, text)
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    index = {"package": package, "channels": [asdict(one) for one in channels]}
    (folder / INDEX).write_text(json.dumps(index, indent=1), encoding="utf-8")


def _body(one: Interface, form: Sequence[Field]) -> str:
    lines = [f"# {one.channel}: {one.sender} -> {one.receiver}, on {one.topic}"]
    taken: set[str] = set()
    for field in form:
        if not _NAME.fullmatch(field.name) or field.name in taken:
            rule = f"fields are named once, in letters, digits and single underscores, but {field.name!r} was given"
            _refuse(f"form of channel {one.channel!r}", rule, "rename it")
        if field.kind not in TYPES:
            rule = f"a field's kind is one of {', '.join(TYPES)}, but {field.name} is {field.kind!r}"
            _refuse(f"form of channel {one.channel!r}", rule, "")
        taken.add(field.name)
        lines += ["", *(f"# {line}" for line in field.doc.splitlines()), f"{TYPES[field.kind]} {ros_name(field.name)}"]
    return "\n".join(lines) + "\n"


def _fields(text: str) -> list[str]:
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def read_index(folder: Path) -> tuple[str, tuple[Interface, ...]]:
    """Return the package's name and its channels.

    Raises:
        HostFailure: the folder holds no such package.
    """
    try:
        index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        package, channels = str(index["package"]), tuple(Interface(**one) for one in index["channels"])
        for name, form in ((package, _PACKAGE), *((one.type, _TYPE) for one in channels)):
            if not form.fullmatch(name):  # they become folders and files
                raise ValueError(f"{name[:60]!r} names no package or type")
        return package, channels
    except (OSError, ValueError, KeyError, TypeError) as error:
        rule = f"must be a package written by Parcours, but {INDEX} cannot be read ({error})"
        _refuse(str(folder), rule, "write it with write_package")


def write_headers(folder: Path, include: Path) -> tuple[Path, ...]:
    """Write C++ headers of the package's messages and services, as <package/Type.h>, and return their paths.

    Args:
        folder: a package's folder, as `write_package` left it.
        include: where the folder <package> with the headers is made; give it to the compiler with -I.

    Raises:
        HostFailure: gencpp is not installed, or refuses a file.
    """
    package, _ = read_index(folder)
    target = include / package
    target.mkdir(parents=True, exist_ok=True)
    sources = sorted(folder.glob("msg/*.msg")) + sorted(folder.glob("srv/*.srv"))
    # One process for all, not one each: most of the time goes into starting.
    script = (
        "import sys, genmsg.template_tools as t\n"
        "package, target, templates, *sources = sys.argv[1:]\n"
        "for source in sources:\n"
        "    t.generate_from_file(source, package, target, templates, [],\n"
        "                         {'msg.h.template': '@NAME@.h'}, {'srv.h.template': '@NAME@.h'})\n"
    )
    command = [interpreter_with("gencpp"), "-c", script, package, str(target), _TEMPLATES, *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        told = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        _refuse(f"C++ headers of {package}", f"must be made by gencpp, but it says: {told}", "install ros-core-dev")
    return tuple(sorted(target.glob("*.h")))


def _refuse(where: str, rule: str, remedy: str) -> NoReturn:
    raise HostFailure(where, rule, remedy, slug="ros1-interface")
