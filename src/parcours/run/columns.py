"""The rows of a shard as Parquet, a column for each number of a case; and back, all fields or some.

    dtype    number │ inner: x, y │ counts (3,)
    columns  number │ inner.x │ inner.y │ counts    an array is a list of as many numbers, a text its bytes

Nothing in it says who wrote it or when: the same rows are the same bytes, by one version of pyarrow.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow

_LEVEL = 3  # of zstd


def pack(rows: NDArray[np.void]) -> bytes:
    """Return rows without padding, shape (n,), as a Parquet file of one row group."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    leaves = dict(_leaves(rows))
    arrays = {name: _packed(values) for name, values in leaves.items()}
    fields = [pa.field(name, array.type, nullable=False) for name, array in arrays.items()]
    # Alike bytes of numbers lie together (BYTE_STREAM_SPLIT), which halves them; a list is one column of its own name.
    split = [_path(name, array) for name, array in arrays.items() if leaves[name].dtype.kind in "iuf"]
    split = [path for path in split if leaves[path.removesuffix(".list.element")].dtype.itemsize > 2]
    sink = pa.BufferOutputStream()
    pq.write_table(
        pa.Table.from_arrays(list(arrays.values()), schema=pa.schema(fields)), sink,
        row_group_size=max(1, len(rows)), compression="zstd", compression_level=_LEVEL, use_dictionary=False,
        use_byte_stream_split=split, write_statistics=False, store_schema=False, version="2.6", data_page_version="1.0",
    )  # fmt: skip
    return bytes(sink.getvalue())


def unpack(content: bytes | memoryview, dtype: np.dtype[np.void], rows: NDArray[np.void]) -> None:
    """Fill rows with what was packed.

    Args:
        content: what `pack` returned.
        dtype: of what was packed, without padding.
        rows: as many as were packed, with all its fields or with some.

    Raises ValueError: the bytes are not those of as many rows.

    >>> rows, some = np.array([(1, 0.5), (2, 0.25)], [("n", "i8"), ("x", "f8")]), np.empty(2, [("x", "f8")])
    >>> unpack(pack(rows), rows.dtype, some)
    >>> some["x"].tolist()
    [0.5, 0.25]
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        if file.metadata.num_rows != len(rows) or file.schema_arrow.names != leaf_names(dtype):
            raise ValueError(f"{len(rows)} rows of {dtype.itemsize} bytes are expected, but it holds others")
        leaves = dict(_leaves(rows))
        table = file.read(list(leaves), use_threads=False)
        for name, places in leaves.items():
            column = table.column(name)
            places[...] = _unpacked(column.chunk(0) if column.num_chunks == 1 else column.combine_chunks(), places)
    except (pa.ArrowException, OSError, KeyError) as error:
        raise ValueError(str(error)) from error


@functools.lru_cache(maxsize=8)
def leaf_names(dtype: np.dtype[np.void]) -> list[str]:
    """Return the names of the columns of a record."""
    return [name for name, _ in _leaves(np.empty(0, dtype))]


def places(content: bytes) -> Iterator[tuple[str, int, int]]:
    """Yield where each column lies in what was packed: name, first byte, bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    about = pq.ParquetFile(pa.BufferReader(content)).metadata
    for k in range(about.num_columns):
        column = about.row_group(0).column(k)
        yield column.path_in_schema.removesuffix(".list.element"), column.data_page_offset, column.total_compressed_size


def end_of(content: bytes) -> int:
    """Return where the end of what was packed begins, which says where the columns lie; its size stands before PAR1."""
    return len(content) - int.from_bytes(content[-8:-4], "little") - 8


def _leaves(rows: NDArray[Any], name: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the columns: views of shape (n, ...), of numbers, truth values or texts."""
    if rows.dtype.names is None:
        yield name, rows
    for inner in rows.dtype.names or ():
        yield from _leaves(rows[inner], f"{name}.{inner}" if name else inner)


def _path(name: str, array: pyarrow.Array) -> str:
    import pyarrow as pa

    return f"{name}.list.element" if pa.types.is_fixed_size_list(array.type) else name


def _packed(values: NDArray[Any]) -> pyarrow.Array:
    import pyarrow as pa

    flat = np.ascontiguousarray(values).reshape(-1)
    if flat.dtype.kind in "biuf" and flat.dtype.itemsize <= 8:
        # Of its memory: pa.array(flat) would load pandas wherever it is installed, a second for nothing.
        bits = np.packbits(flat, bitorder="little") if flat.dtype.kind == "b" else flat
        array = pa.Array.from_buffers(pa.from_numpy_dtype(flat.dtype), len(flat), [None, pa.py_buffer(bits)])
    elif flat.dtype.kind == "S":
        array = pa.array(flat.tolist(), pa.binary())
    else:  # as it lies in memory
        array = pa.Array.from_buffers(pa.binary(flat.dtype.itemsize), len(flat), [None, pa.py_buffer(flat.tobytes())])
    return array if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(array, math.prod(values.shape[1:]))


def _unpacked(array: pyarrow.Array, like: NDArray[Any]) -> NDArray[Any]:
    """Return the values of a column in the shape and of the dtype of `like`. Raises ValueError: they are others."""
    import pyarrow as pa

    flat = array
    if like.ndim > 1:  # flatten() would load all that pyarrow can compute
        first, end = (array.offsets[0].as_py(), array.offsets[-1].as_py()) if len(array) else (0, 0)
        flat = array.values.slice(first, end - first)
    if array.null_count or flat.null_count or len(flat) != like.size:
        raise ValueError(f"{like.size} values are expected, but it holds {len(flat)}")
    if like.dtype.kind in "biuf" and like.dtype.itemsize <= 8:
        if flat.type != pa.from_numpy_dtype(like.dtype):
            raise ValueError(f"values of {like.dtype} are expected, but it holds {flat.type}")
        memory, first, end = flat.buffers()[1] or b"", flat.offset, flat.offset + len(flat)
        if like.dtype.kind == "b":
            found = np.unpackbits(np.frombuffer(memory, np.uint8), bitorder="little")[first:end].view(bool)
        else:
            found = np.frombuffer(memory, like.dtype, end)[first:] if end else np.empty(0, like.dtype)
    elif like.dtype.kind == "S":
        found = np.array(flat.to_pylist() if flat.total_values_length else np.zeros(len(flat), "S1"), like.dtype)
    else:
        found = np.frombuffer(b"".join(flat.to_pylist()), like.dtype)
    shaped: NDArray[Any] = found.reshape(like.shape)
    return shaped
