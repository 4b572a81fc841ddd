"""Reads pictures of maps, which may be hostile, as grey levels: PGM by a parser of our own, PNG by Pillow."""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.ground.cells import MOST_CELLS, require_cells
from parcours_navigation.ground.outlines import BadGround

Grey = NDArray[np.uint8]

MOST_BYTES = 8 * MOST_CELLS
"""Largest file of a picture [bytes]."""

_WORD = re.compile(rb"(?:\s|#[^\n\r]*)*([^\s#]+)")
_PNG_END = b"IEND\xaeB`\x82"
_PNG = b"\x89PNG\r\n\x1a\n"


def read_picture(path: Path) -> tuple[Grey, Grey]:
    """Return a picture's grey levels, 0 black to 255 white, and opacity, 255 opaque, both of shape (rows, columns).

    Rows run from the top downwards. Colours count as the mean of red, green and blue, as in ROS.

    Args:
        path: of a file in PGM, plain (P2) or raw (P5), or PNG.

    Raises:
        BadGround: there is no such file, it is too large, of another format, or cut short.
    """
    content = read_bytes(path, "map-image", MOST_BYTES)
    if content[:2] in (b"P2", b"P5"):
        grey = read_pgm(content, str(path))
        return grey, np.full_like(grey, 255)
    if content.startswith(_PNG):
        return read_png(content, str(path))
    rule = f"a picture must be PGM (P2 or P5) or PNG, but this starts with {content[:8]!r}"
    raise BadGround(str(path), rule, "convert it", slug="map-image")


def read_bytes(path: Path, slug: str, most: int) -> bytes:
    """Return what a file holds.

    Raises:
        BadGround: it is not an ordinary file, cannot be read, or has too many bytes.
    """
    try:
        if not path.is_file():  # nor a pipe, which might never end
            raise FileNotFoundError(0, "there is no such file")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError) as error:
        rule = f"it must be a file that can be read, but: {getattr(error, 'strerror', None) or error}"
        raise BadGround(str(path), rule, "correct the name", slug=slug) from None
    if len(content) > most:
        raise BadGround(str(path), f"it must have at most {most} bytes, but has more", slug="map-size")
    return content


def _refuse(where: str, rule: str) -> NoReturn:
    raise BadGround(where, rule, "write the picture again", slug="map-image")


def _end_of_head(content: bytes, at: int, n_bytes: int) -> int:
    """Return where the levels begin: after one white space; as netpbm has it, a comment counts as its line's end.

    A head that was written with CR and LF has two, which shows in the size of the file.
    """
    if content[at : at + 1] == b"#":
        at = max(content.find(b"\n", at), at)
    return at + 2 if content[at : at + 2] == b"\r\n" and len(content) == at + 2 + n_bytes else at + 1


def read_pgm(content: bytes, where: str) -> Grey:
    """Return the grey levels of a PGM picture, 0 to 255, shape (rows, columns), from the top downwards.

    Raises:
        BadGround: it is not PGM, has too many cells, or another number of levels than its head says.

    >>> read_pgm(b"P2 # a comment\\n2 1 15\\n0 15\\n", "a.pgm").tolist()
    [[0, 255]]
    """
    at = 2
    numbers: list[int] = []
    while len(numbers) < 3:
        found = _WORD.match(content, at)
        if found is None or not (found[1].isdigit() and len(found[1]) < 10):
            _refuse(where, "a PGM's head is its kind, columns, rows and the greatest level, but one is missing")
        numbers.append(int(found[1]))
        at = found.end()
    columns, rows, top = numbers
    if columns == 0 or rows == 0 or not 0 < top < 65536:
        _refuse(where, f"a PGM has cells and levels up to 1 .. 65535, but this {columns} x {rows} and {top}")
    require_cells(columns, rows, where)
    if content[:2] == b"P5":
        wide = np.dtype(">u2" if top > 255 else "u1")
        n_bytes = columns * rows * wide.itemsize
        at = _end_of_head(content, at, n_bytes)
        data = content[at : at + n_bytes]
        if len(data) < n_bytes:
            _refuse(where, f"{columns} x {rows} levels must follow the head, but the file ends before")
        levels = np.frombuffer(data, wide).astype(np.int64)
    else:
        words = re.sub(rb"#[^\n\r]*", b"", content[at:]).split()
        if len(words) < columns * rows or not all(word.isdigit() and len(word) < 10 for word in words):
            _refuse(where, f"{columns} x {rows} whole numbers must follow the head, but there are {len(words)} words")
        levels = np.array(words[: columns * rows], dtype=np.int64)
    if int(levels.max()) > top:
        _refuse(where, f"levels are at most {top} by the head, but one is {int(levels.max())}")
    return (levels * 255 // top).astype(np.uint8).reshape(rows, columns)


def read_png(content: bytes, where: str) -> tuple[Grey, Grey]:
    """Return the grey levels and opacity of a PNG picture, 0 to 255, shape (rows, columns), from the top downwards.

    Raises:
        BadGround: it cannot be read, or has too many cells.
    """
    from PIL import Image

    if _PNG_END not in content:  # else what is missing might be read as black
        _refuse(where, "a PNG must end with its chunk IEND, but this was cut short")
    columns, rows = struct.unpack(">II", content[16:24])
    require_cells(columns, rows, where)  # by its head: nothing is unpacked yet
    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
            picture.verify()
        with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:
            if picture.mode.startswith("I"):  # 16 bits a level
                levels = np.clip(np.asarray(picture.convert("I")) // 257, 0, 255).astype(np.uint8)
                return levels, np.full_like(levels, 255)
            colours = np.asarray(picture.convert("RGBA"))
    except Exception as error:  # whatever a broken file leads Pillow to
        _refuse(where, f"a picture must be readable as PNG, but: {str(error)[:100]}")
    return colours[:, :, :3].mean(axis=2).astype(np.uint8), np.ascontiguousarray(colours[:, :, 3])
