"""Names that came from a file or a user become single file names, none of which leaves its folder.

Letters, digits and most signs stay as they are. What would not is written so that two names never share a file:

    /        -> ~            a case id reads demo~A~0
    others   -> %XX          the bytes in UTF-8, as in a URL; also ~ and %, and a dot in front
    too long -> start%-hash  a % is otherwise always followed by two hexadecimal digits
"""

from __future__ import annotations

import hashlib

LONGEST = 150
"""Most bytes of a file name made here: it leaves room for a suffix and for the tag of a file that is half written."""

_STAY = frozenset(" _-.,+=@#()[]'!&^")
_DIGEST = 32  # hexadecimal digits


def file_name(name: str) -> str:
    r"""Return a file name for any name: different names get different ones, and no part of it leads to another folder.

    >>> file_name("Door-main loop"), file_name("lift/ITP1-tp1.0/3")
    ('Door-main loop', 'lift~ITP1-tp1.0~3')
    >>> file_name("../../etc"), file_name("a~b"), file_name("two\nlines"), file_name("")
    ('%2E.~..~etc', 'a%7Eb', 'two%0Alines', '%')
    """
    written = "".join(_written(sign, place) for place, sign in enumerate(name)) or "%"
    if len(written.encode()) <= LONGEST:
        return written
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:_DIGEST]
    start = written.encode()[: LONGEST - _DIGEST - 2].decode("utf-8", "ignore")
    return f"{start}%-{digest}"


def _written(sign: str, place: int) -> str:
    if sign == "/":
        return "~"
    if (sign.isalnum() or sign in _STAY) and not (sign == "." and place == 0):
        return sign
    return "".join(f"%{byte:02X}" for byte in sign.encode("utf-8", "surrogatepass"))
