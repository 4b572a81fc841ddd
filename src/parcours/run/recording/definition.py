"""The text of a ROS 1 message definition into the md5 sum by which ROS knows it, and into its bare fields."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping

_PLAIN = {"bool", "string", "time", "duration", "byte", "char", "float32", "float64"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_SEPARATOR = re.compile(r"^=+\r?\nMSG: *(\S+)\r?\n", re.MULTILINE)
_CONSTANT = re.compile(r"\s*(\w+)\s+(\w+)\s*=(.*)")


def same_definition(one: str, other: str) -> bool:
    """Return whether two definitions name the same fields in the same order; comments do not count.

    >>> same_definition("float64 x  # [m]", "# where it is\\nfloat64   x\\n")
    True
    """
    return _bare(one) == _bare(other)


def md5_of(definition: str, name: str = "") -> str:
    """Return the md5 sum of a definition with the definitions of the types it uses, as ROS 1 computes it.

    Args:
        definition: the whole text; definitions of further types follow lines of = and MSG: their name.
        name: of the type itself: in its package further types are looked for first.

    >>> md5_of("string data")
    '992ce8a1687cec8c8bd883ec73ca41d1'
    >>> vector = "===\\nMSG: geometry_msgs/Vector3\\nfloat64 x\\nfloat64 y\\nfloat64 z"
    >>> md5_of("Vector3 linear\\nVector3 angular\\n" + vector)
    '9f195f881246fdfa2798d1d3eebca84a'
    """
    texts = _SEPARATOR.split(definition)
    parts = dict(zip(texts[1::2], texts[2::2], strict=True))
    return _md5(name, texts[0], parts, {})


def _md5(name: str, text: str, parts: Mapping[str, str], known: dict[str, str]) -> str:
    constants, fields = [], []
    for line in text.splitlines():
        kind, _, _ = line.split("#", 1)[0].strip().partition(" ")
        constant = _CONSTANT.match(line) if "=" in line.split("#", 1)[0] else None
        if constant:
            value = constant[3] if kind == "string" else constant[3].split("#", 1)[0]
            constants.append(f"{kind} {constant[2]}={value.strip()}")
        elif kind:
            field = line.split("#", 1)[0].split()[-1]
            plain = kind.split("[", 1)[0]
            fields.append(f"{kind if plain in _PLAIN else _nested(plain, name, parts, known)} {field}")
    return hashlib.md5("\n".join(constants + fields).encode(), usedforsecurity=False).hexdigest()


def _nested(kind: str, name: str, parts: Mapping[str, str], known: dict[str, str]) -> str:
    package = name.rpartition("/")[0]
    wanted = "std_msgs/Header" if kind == "Header" else kind
    full = next((one for one in (wanted, f"{package}/{wanted}") if one in parts), "")
    full = full or next((one for one in parts if one.endswith(f"/{wanted}")), wanted)
    if full not in known:
        known[full] = ""  # a type that contains itself makes no sense, and ends here
        known[full] = _md5(full, parts.get(full, ""), parts, known)
    return known[full]


def _bare(definition: str) -> list[str]:
    lines = (" ".join(line.split("#", 1)[0].split()) for line in definition.splitlines())
    return [line for line in lines if line]
