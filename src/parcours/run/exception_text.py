"""Puts what a guest raised into words, whatever its exception does when it is asked for them."""

from __future__ import annotations

import re
import signal
import traceback
from types import CodeType

from parcours.errors import ParcoursError

REASON_LENGTH = 160
"""Bytes kept of the reason why a case ended in an error."""

_TRACEBACK = BaseException.__dict__["__traceback__"]  # a class may have a property of that name
_NAME = type.__dict__["__name__"]  # and so may a metaclass
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,}")


class Overdue(BaseException):
    """Raised in a guest that takes too long; not an Exception, so that it is not caught by mistake."""


def is_ctrl_c(error: BaseException) -> bool:
    """Return whether it means that the user wants to stop: not where Ctrl-C is ignored, as it is in workers."""
    return isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


def without_addresses(text: str) -> str:
    """Return a text in one line in which no memory address differs from run to run.

    >>> without_addresses("returned <object object at 0x7f3a5c0de010>" + chr(10) + "twice")
    'returned <object object at 0x...> twice'
    """
    return _ADDRESS.sub("0x...", " ".join(text.replace("\0", " ").split()))


def cut(text: str, room: int) -> str:
    """Return a text of at most `room` bytes of UTF-8, at least 3; what is cut off is replaced by dots.

    >>> cut("no way", 6), cut("no way at all", 9), cut("50 \N{EURO SIGN}\N{EURO SIGN}", 8)
    ('no way', 'no way...', '50 ...')
    """
    encoded = text.encode("utf-8", "replace")
    return text if len(encoded) <= room else encoded[: room - 3].decode("utf-8", "ignore") + "..."


def reason_bytes(reason: str) -> bytes:
    """Return a reason as it is kept: one line, without memory addresses, cut to REASON_LENGTH bytes of UTF-8.

    >>> reason_bytes("returned <object object at 0x7f3a5c0de010>" + chr(10) + "twice")
    b'returned <object object at 0x...> twice'
    """
    return cut(without_addresses(reason), REASON_LENGTH).encode("utf-8", "replace")


def said(error: BaseException) -> str:
    """Return the type of an exception and what it says, in one line of at most 1000 characters.

    >>> said(ValueError("no way")), said(ValueError())
    ('ValueError: no way', 'ValueError')
    """
    name = text = ""
    try:
        name = _NAME.__get__(type(error))
        text = str.__getitem__(str(error), slice(1000))  # of a class of its own, it does as that class likes
    except Overdue:
        raise
    except BaseException:
        text = ""
    return without_addresses(f"{name}: {text}" if text else name)


def frames_of(error: BaseException) -> list[tuple[CodeType, int]]:
    """Return the code and the line of every frame that an exception has passed, the outermost first."""
    return [(frame.f_code, line) for frame, line in traceback.walk_tb(_TRACEBACK.__get__(error))]


def place(error: BaseException, file: str = "") -> tuple[str, str]:
    """Return the function and the file with its line in which it was raised: in `file` if it passed there; else "".

    No source is read for it.
    """
    frames = frames_of(error)
    own = [one for one in frames if file and one[0].co_filename == file] or frames
    if not own:
        return "", ""
    code, line = own[-1]
    return code.co_name, f"{code.co_filename.rpartition('/')[2]}:{line}"


def words_of(error: BaseException, file: str) -> str:
    """Return what was raised and where: in the user's own file if it passed there. The place is never cut."""
    _, line = place(error, file)
    where = f" ({line})" if line else ""
    return cut(said(error), max(REASON_LENGTH - len("raised: ") - len(where.encode()), 20)) + where


def described(error: BaseException) -> Exception:
    """Return an error of ours as it is, and of any other its type, its text and the place that raised it."""
    if isinstance(error, ParcoursError) and type(error).__module__.partition(".")[0].startswith("parcours"):
        return error
    function, line = place(error)
    return Exception(f"{said(error)} (in {function}, {line})")
