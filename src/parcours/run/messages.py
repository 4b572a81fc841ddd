"""Messages of a worker that nobody trusts: bytes of a line into a kind and a value, without running what they name."""

from __future__ import annotations

import io
import os
import pickle
import struct
import sys
from typing import Any

_MARK, _LENGTH, _CHUNK = b"parcours", struct.Struct("<Q"), 1 << 20
_BEGUN = len(_MARK) + _LENGTH.size
_MOST = 1 << 32  # no message of ours is longer [bytes]


def packed(message: tuple[str, object]) -> bytes:
    """Return a message as it goes through the line. Raises what pickle does if it cannot."""
    out = io.BytesIO()
    pickler = pickle.Pickler(out, protocol=4)
    pickler.dispatch_table = {}  # what others have registered for exceptions, as Dask does, the reader would not call
    pickler.dump(message)
    content = out.getvalue()
    return _MARK + _LENGTH.pack(len(content)) + content


class LineMessages:
    """What has come through a line."""

    def __init__(self) -> None:
        self._said = bytearray()

    def read(self, line: int) -> None:
        """Read what has arrived, without waiting for more. Raises EOFError, OSError, UnpicklingError."""
        said = os.read(line, _CHUNK)
        if not said:
            raise EOFError
        self._said += said
        n = len(self._said)
        if not self._said.startswith(_MARK[:n]) or (n >= _BEGUN and self._length() > _MOST):
            raise pickle.UnpicklingError("not a message")

    def has_whole(self) -> bool:
        """Return whether a whole message is there."""
        n = len(self._said)
        return n >= _BEGUN and n - _BEGUN >= self._length()

    def _length(self) -> int:
        """Return how long the content of the first message is [bytes]."""
        return int(_LENGTH.unpack_from(self._said, len(_MARK))[0])

    def take(self) -> tuple[str, Any]:
        """Take the first message. Raises UnpicklingError, or what a foreign value raises."""
        length = self._length()
        whole = bytes(self._said[_BEGUN : _BEGUN + length])
        del self._said[: _BEGUN + length]
        return _plain(whole)


class _Plain(pickle.Unpickler):
    """Reads values of ours, of NumPy's and plain ones, and calls nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        package = module.partition(".")[0]
        if (module, name) in _PLAIN or (package == "numpy" and name in _OF_NUMPY) or package.startswith("parcours"):
            found = super().find_class(module, name) if module in sys.modules else None
            if isinstance(found, type) or name in _FUNCTIONS:
                return found
        raise pickle.UnpicklingError(f"{module}.{name}")


_FUNCTIONS = ("_rebuild", "_reconstruct", "_frombuffer", "scalar")
_PLAIN = {("builtins", name) for name in ("Exception", "set", "frozenset", "complex", "bytearray", "slice")}
_OF_NUMPY = ("_reconstruct", "_frombuffer", "scalar", "ndarray", "dtype")


def _plain(said: bytes) -> tuple[str, Any]:
    """Return the kind and the value of a message."""
    kind, value = _Plain(io.BytesIO(said)).load()
    if kind not in ("done", "raised", "heard") or (kind == "raised" and not isinstance(value, Exception)):
        raise pickle.UnpicklingError(f"{kind!r}")
    return kind, value
