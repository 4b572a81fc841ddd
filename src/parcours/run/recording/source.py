"""A file of foreign origin as its reader sees it: no length in it is believed, and no more than allowed is read."""

from __future__ import annotations

import bz2
import os
from importlib import import_module
from typing import BinaryIO

from parcours.errors import BadResults

LONGEST = 1 << 28
"""No record of a recording is longer [bytes]; whatever a file says about its lengths, no more is read at once."""


class CutOff(Exception):
    """The file ends in the middle of a record."""


class ByteSource:
    """Yields the bytes of a file in order.

    Args:
        file: at its start, seekable.
        where: its name, for complaints.
        most: no more than this is read, expanded [bytes].
    """

    def __init__(self, file: BinaryIO, where: str, most: int) -> None:
        self._file, self.where = file, where
        self._most = self._budget = most
        self.left = file.seek(0, os.SEEK_END)
        file.seek(0)

    def read(self, n: int) -> bytes:
        """Return the next n bytes.

        Raises:
            CutOff: the file ends before.
            BadResults: n is more than may be read at once, or in all.
        """
        if n > LONGEST:
            raise too_large(self.where, n, LONGEST)
        if n > self.left:
            raise CutOff("its end is missing")
        self._spend(n)
        self.left -= n
        content = self._file.read(n)
        if len(content) != n:
            raise damaged(self.where, "it became shorter while it was read")
        return content

    def expand(self, compression: str, content: bytes, size: int) -> bytes:
        """Return the `size` bytes of a compressed chunk.

        Raises:
            BadResults: the compression is unknown, or other than `size` bytes come out, or more than may be read.
        """
        # The decompressors of `mcap` and `rosbags` have no bound: a small chunk could fill the memory.
        if size > LONGEST:
            raise too_large(self.where, size, LONGEST)
        self._spend(max(size - len(content), 0))
        try:
            expanded = _expanded(compression, content, size + 1)
        except Exception as error:  # each library raises what it likes
            what = f"a chunk compressed by {compression} cannot be expanded: {error}"
            raise damaged(self.where, what) from error
        if expanded is None:
            rule = f"chunks are not compressed, or by bz2, lz4 or zstd, but {compression[:20]!r} was used"
            remedy = "expand the file with `mcap decompress` or `rosbag decompress`"
            raise BadResults(self.where, rule, remedy, slug="recording-compression")
        if len(expanded) != size:
            raise damaged(self.where, f"a chunk of {size} bytes has another size")
        return expanded

    def _spend(self, n: int) -> None:
        self._budget -= n
        if self._budget < 0:
            raise too_large(self.where, self._most - self._budget, self._most)


def _expanded(compression: str, content: bytes, most: int) -> bytes | None:
    match compression:
        case "" | "none":
            return content
        case "bz2":
            return bz2.BZ2Decompressor().decompress(content, most)
        case "lz4":
            found: bytes = import_module("lz4.frame").LZ4FrameDecompressor().decompress(content, most)
            return found
        case "zstd":
            from zstandard import ZstdDecompressor

            reader = ZstdDecompressor(max_window_size=1 << 27).stream_reader(content)
            parts, left = [], most
            while left and (part := reader.read(left)):
                parts.append(part)
                left -= len(part)
            return b"".join(parts)
    return None


def damaged(where: str, what: str) -> BadResults:
    """Return the complaint that a recording contradicts itself."""
    rule = f"a recording's records agree with each other, but {what}"
    remedy = "the file is damaged: copy it again, or run the case again"
    return BadResults(where, rule, remedy, slug="recording-damaged")


def too_large(where: str, given: int, most: int) -> BadResults:
    """Return the complaint that more is to be read than allowed [bytes]."""
    remedy = "give a greater limit if the file is sound, or cut it into pieces with its own tools"
    rule = f"at most {most} bytes are read, but there are {given}"
    return BadResults(where, rule, remedy, slug="recording-too-large")
