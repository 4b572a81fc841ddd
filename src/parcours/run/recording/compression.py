"""A compressed chunk into its bytes, never more of them than it says and than is allowed."""

from __future__ import annotations

import bz2
from importlib import import_module

from parcours.errors import BadResults
from parcours.run.recording.topic import LONGEST, damaged, too_large


def expand(compression: str, content: bytes, size: int, where: str) -> bytes:
    """Return the chunk's bytes.

    Args:
        compression: none (or empty), bz2, lz4 or zstd; the last two need the packages lz4 and zstandard.
        content: as it lies in the file.
        size: how many bytes the file says come out.
        where: the file, for complaints.

    Raises:
        BadResults: the compression is unknown or its package not there; other than `size` bytes come out, or more than
            are ever read.

    >>> expand("bz2", bz2.compress(b"abc"), 3, "a.bag")
    b'abc'
    """
    if size > LONGEST:
        raise too_large(where, size, LONGEST)
    try:
        expanded = _expand(compression, content, size + 1)
    except BadResults:
        raise
    except ImportError as error:
        raise _unknown(where, compression) from error
    except Exception as error:  # each library raises what it likes
        raise damaged(where, f"a chunk compressed by {compression} cannot be expanded: {error}") from error
    if expanded is None:
        raise _unknown(where, compression)
    if len(expanded) != size:
        raise damaged(where, f"a chunk of {size} bytes has another size")
    return expanded


def _expand(compression: str, content: bytes, most: int) -> bytes | None:
    match compression:
        case "" | "none":
            return content
        case "bz2":
            return bz2.BZ2Decompressor().decompress(content, most)
        case "lz4":
            found: bytes = import_module("lz4.frame").LZ4FrameDecompressor().decompress(content, most)
            return found
        case "zstd":
            reader = import_module("zstandard").ZstdDecompressor(max_window_size=1 << 27).stream_reader(content)
            parts, left = [], most
            while left and (part := reader.read(left)):
                parts.append(part)
                left -= len(part)
            return b"".join(parts)
    return None


def _unknown(where: str, compression: str) -> BadResults:
    return BadResults(
        where,
        f"chunks are not compressed, or by bz2, or by lz4 or zstd if their packages are there, but {compression[:20]!r}"
        " was used",
        "pip install lz4 zstandard, or expand the file with `mcap decompress` or `rosbag decompress`",
        slug="recording-compression",
    )
