"""Writes the flat forms of a model's messages as a ROS 1 package, .msg and .srv files, without a workspace."""

from __future__ import annotations

import json
import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import NoReturn, Protocol

from parcours.errors import HostFailure
from parcours.run.hosts.interfaces import ChannelRoute, Interface, routes
from parcours.run.hosts.ros1 import no_ros
from parcours.run.hosts.ros1.endpoints import Kind

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


class FieldOfForm(Protocol):
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


def ros_name(field: str) -> str:
    """Return what the field is called in a .msg file: a word of Python or C++ gets an underscore.

    >>> ros_name("stamp"), ros_name("operator")
    ('stamp', 'operator_')
    """
    return f"{field}_" if keyword.iskeyword(field) or field in _CPP else field


def write_package(
    folder: Path, package: str, channels: Sequence[Interface], forms: Mapping[str, Sequence[FieldOfForm]]
) -> None:
    """Write the .msg and .srv files of the channels, with what their fields mean, and an index.

    Raises HostFailure if a channel has no form, a form is not well formed, or two different forms would get one name.
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


def _body(one: Interface, form: Sequence[FieldOfForm]) -> str:
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
    """Return the package's name and its channels. Raises HostFailure if the folder holds no such package."""
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


def write_python(folder: Path) -> Path:
    """Generate the package's Python classes with genpy, for ROS's tools; return the folder for PYTHONPATH.

    Raises HostFailure if there is no genpy, or it refuses a file.
    """
    try:
        from genmsg import MsgContext, MsgGenerationException
        from genpy.generate_initpy import write_modules
        from genpy.generator import MsgGenerator, SrvGenerator
    except ImportError:
        raise no_ros("genpy") from None
    package, _ = read_index(folder)
    target = folder / "python" / package
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        (target / kind).mkdir(parents=True, exist_ok=True)
        context = MsgContext.create_default()
        for source in sorted((folder / kind).glob(f"*.{kind}")):
            try:
                generator.generate(context, f"{package}/{source.stem}", str(source), str(target / kind), {})
            except MsgGenerationException as error:
                raise HostFailure(str(source), f"genpy refuses it: {error}", slug="ros1-interface") from error
        write_modules(str(target / kind))
    (target / "__init__.py").touch()
    return target.parent


def package_routes(folder: Path) -> tuple[ChannelRoute, ...]:
    """Return the routes of a package's channels, with the types that go into connection headers.

    Raises HostFailure if there is no such package, or no ROS 1, or two channels share a topic.
    """
    try:
        from genmsg import MsgContext
        from genmsg.gentools import compute_full_text, compute_md5
        from genmsg.msg_loader import load_msg_from_file, load_srv_from_file
    except ImportError:
        raise no_ros("genmsg") from None
    package, channels = read_index(folder)
    context = MsgContext.create_default()
    kinds = {}
    for one in channels:
        name = f"{package}/{one.type}"
        if one.role == "topic":
            spec = load_msg_from_file(context, str(folder / f"msg/{one.type}.msg"), name)
            context.set_depends(name, [])  # fields of a flat form are of no other message's type
            kinds[one.channel] = Kind(name, compute_md5(context, spec), compute_full_text(context, spec))
        else:
            service = load_srv_from_file(context, str(folder / f"srv/{one.type}.srv"), name)
            kinds[one.channel] = Kind(name, compute_md5(context, service))
    return routes(channels, kinds)


def _refuse(where: str, rule: str, remedy: str) -> NoReturn:
    raise HostFailure(where, rule, remedy, slug="ros1-interface")
