"""The sums beside a shard: of the whole, and of each column of a large one, so that few can be read without the rest.

shard-000000.parquet.sha256   6f1e…  shard-000000.parquet
                              83a0…  4+406 number            the column's bytes: 406 from byte 4 on
                              91bc…  1487022+5319            the end of the file, which says where columns lie
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from parcours.errors import BadResults
from parcours.run.columns import end_of, places

_LARGE = 1 << 20  # bytes of a shard whose columns have sums: a smaller one is read as fast as a part of it
_FEW = 4  # a part of this of the bytes, or less, is read without the rest
_END = ""  # in place of the name of a column
_COLUMN = re.compile(r"([0-9a-f]{64})  ([0-9]{1,15})\+([0-9]{1,15}) ?(.*)", re.ASCII)


def sum_of(path: Path) -> Path:
    """Return where the sums of a shard lie."""
    return path.with_name(path.name + ".sha256")


def sums(content: bytes, name: str) -> bytes:
    """Return what to write there, for a shard of this content and file name."""
    lines = [f"{_digest(content)}  {name}"]
    if len(content) >= _LARGE:
        lines += [
            f"{_digest(content[first : first + n])}  {first}+{n} {column}".rstrip()
            for column, first, n in (*places(content), (_END, end_of(content), len(content) - end_of(content)))
        ]
    return "".join(f"{line}\n" for line in lines).encode()


def summed(path: Path) -> bytes:
    """Return a file's bytes, once they have sum and name noted beside it. Raises BadResults: they do not."""
    return _whole(path, _noted(path))


def _whole(path: Path, noted: list[str]) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise damaged(path, f"must be readable with its sum, but: {error}") from error
    found, first = _digest(content), noted[0].split() if noted else []
    if len(first) == 2 and first[1] != path.name:
        raise damaged(path, f"must be the file whose SHA-256 stands beside it, but that is {first[1]}'s")
    if not first or first[0] != found:
        given = f"its {len(content)} bytes have {found[:12]}...: it was cut short or changed"
        raise damaged(path, f"must have the SHA-256 noted beside it, but {given}")
    return content


def summed_columns(path: Path, names: Collection[str]) -> bytes | memoryview:
    """Return a shard's bytes of these columns, zeros in place of the others, once they have the sums noted beside it.

    Those of the whole shard if it has no sums of columns, or if the columns are much of it. Raises BadResults: they
    have not.
    """
    noted = _noted(path)
    wanted = {name: place for name, place in _columns(noted) if name in names or name == _END}
    if set(wanted) != {*names, _END} or noted[0].split()[1:] != [path.name]:
        return _whole(path, noted)
    try:
        size = path.stat().st_size
        if _FEW * sum(n for _, _, n in wanted.values()) > size:
            return _whole(path, noted)
        content = np.zeros(size, np.uint8).data  # of which only pages that are written take memory
        with path.open("rb") as file:
            for digest, first, n in wanted.values():
                file.seek(first)
                part = file.read(n) if first + n <= size else b""
                if _digest(part) != digest:
                    given = f"{n} bytes from {first} on have another: it was cut short or changed"
                    raise damaged(path, f"must have the SHA-256 noted beside it, but {given}")
                content[first : first + n] = part
    except OSError as error:
        raise damaged(path, f"must be readable with its sum, but: {error}") from error
    return content


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _noted(path: Path) -> list[str]:
    try:
        return sum_of(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise damaged(path, f"must be readable with its sum, but: {error}") from error


def _columns(noted: list[str]) -> Iterator[tuple[str, tuple[str, int, int]]]:
    for line in noted[1:]:
        if found := _COLUMN.fullmatch(line):
            yield found[4], (found[1], int(found[2]), int(found[3]))


def damaged(path: Path, rule: str) -> BadResults:
    """Return the complaint about a shard."""
    remedy = "give the command that ran the campaign again: it computes what is damaged"
    return BadResults(str(path), rule, remedy, slug="shard-damaged")
