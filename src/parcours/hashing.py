"""Turns keys that are met rarely into random words that depend on nothing else; no compiled code is loaded for it."""

from __future__ import annotations

import hashlib
import struct


def hashed(key: bytes, n: int) -> list[int]:
    """Return n words of 64 bits, at most 8, that depend on nothing but the key (BLAKE2b).

    >>> hashed(b"7 0", 1) == hashed(b"7 0", 1) != hashed(b"7 1", 1)
    True
    """
    return list(struct.unpack(f"<{n}Q", hashlib.blake2b(key, digest_size=8 * n).digest()))
