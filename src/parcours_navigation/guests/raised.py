"""Puts what a planner raised into words, whatever its exception does when it is asked for them."""

from __future__ import annotations

import re
import traceback

from parcours_navigation.guests.deadline import Hung

_TRACEBACK = BaseException.__dict__["__traceback__"]  # a class may have a property of that name
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,}")


def without_addresses(text: str) -> str:
    """Return a text in one line in which no memory address differs from run to run.

    >>> without_addresses("returned <object object at 0x7f3a5c0de010>" + chr(10) + "twice")
    'returned <object object at 0x...> twice'
    """
    return _ADDRESS.sub("0x...", " ".join(text.replace("\0", " ").split()))


def said(error: BaseException) -> str:
    """Return the type of an exception and what it says, in one line of at most 1000 characters.

    >>> said(ValueError("no way")), said(ValueError())
    ('ValueError: no way', 'ValueError')
    """
    name = text = ""
    try:
        name = str(type(error).__name__)
        text = str(error)[:1000]
    except Hung:
        raise
    except BaseException:
        text = ""
    return without_addresses(f"{name}: {text}" if text else name)


def place(error: BaseException, file: str = "") -> tuple[str, str]:
    """Return the function and the file with its line in which it was raised: in `file` if it passed there; else "".

    No source is read for it.
    """
    frames = [(frame.f_code, line) for frame, line in traceback.walk_tb(_TRACEBACK.__get__(error))]
    own = [one for one in frames if file and one[0].co_filename == file] or frames
    if not own:
        return "", ""
    code, line = own[-1]
    return code.co_name, f"{code.co_filename.rpartition('/')[2]}:{line}"
