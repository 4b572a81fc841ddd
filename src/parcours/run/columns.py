"""The rows of a shard as bytes, column after column, deflated; and back, all fields or some.

    rows   n0 x0 y0 │ n1 x1 y1 │ n2 x2 y2        a record per case
    bytes  n0 n1 n2 │ x0 x1 x2 │ y0 y1 y2        what is alike lies together: a third of the size

A flat array has a column for each of its numbers, and so has a record within a record.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

_LEVEL = 6


def pack(rows: NDArray[np.void]) -> bytes:
    """Return rows without padding, shape (n,), as bytes."""
    rows = np.ascontiguousarray(rows)
    return zlib.compress(b"".join(run.T.tobytes() for field in _fields(rows) for run in field), _LEVEL)


def unpack(content: bytes, dtype: np.dtype[np.void], rows: NDArray[np.void]) -> None:
    """Fill rows with what was packed.

    Args:
        content: what `pack` returned.
        dtype: of what was packed, without padding.
        rows: as many as were packed, contiguous, with all its fields or with some.

    Raises ValueError: the bytes are not those of as many rows.

    >>> rows, some = np.array([(1, 0.5), (2, 0.25)], [("n", "i8"), ("x", "f8")]), np.empty(2, [("x", "f8")])
    >>> unpack(pack(rows), rows.dtype, some)
    >>> some["x"].tolist()
    [0.5, 0.25]
    """
    n, inflating = len(rows), zlib.decompressobj()
    try:
        plain = inflating.decompress(content, n * dtype.itemsize + 1)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if len(plain) != n * dtype.itemsize or not inflating.eof or inflating.unused_data:
        raise ValueError(f"{n} rows of {dtype.itemsize} bytes are expected, but it holds others")
    places, at = dict(zip(rows.dtype.names or (), _fields(rows), strict=True)), 0
    for name in dtype.names or ():
        for run in places.get(name, ()):
            run.T[...] = np.frombuffer(plain, run.dtype, run.size, at).reshape(run.shape[::-1])
            at += run.nbytes
        at += 0 if name in places else n * dtype[name].itemsize


def _fields(rows: NDArray[np.void]) -> list[list[NDArray[np.void]]]:
    """Return for each field its numbers, as views of shape (n, k) with the k numbers of one size that lie together."""
    found = []
    for name in rows.dtype.names or ():
        dtype, start = rows.dtype.fields[name][:2]  # type: ignore[index]
        runs: list[tuple[int, int, int]] = []  # offset, size of a number, how many
        for size in _sizes(dtype):
            at, last, many = runs[-1] if runs else (start, 0, 0)
            if size == last:
                runs[-1] = at, size, many + 1
            else:
                runs.append((at + last * many, size, 1))
        found.append([
            np.ndarray((len(rows), many), f"V{size}", rows.data, at, (rows.itemsize, size)) for at, size, many in runs
        ])  # fmt: skip
    return found


def _sizes(dtype: np.dtype[np.generic]) -> list[int]:
    """Return the sizes of the numbers that a field holds, in their order [bytes]."""
    if dtype.subdtype is not None:
        inner, shape = dtype.subdtype
        return _sizes(inner) * int(np.prod(shape))
    if dtype.names is not None:
        return [size for name in dtype.names for size in _sizes(dtype.fields[name][0])]  # type: ignore[index]
    return [dtype.itemsize]
