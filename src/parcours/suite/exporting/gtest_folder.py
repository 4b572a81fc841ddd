"""A Google Test program's tables -> the files of a folder that builds and runs it."""

from __future__ import annotations

import re
from importlib.resources import files

PROGRAM = "test_cases.cpp"
"""The file with the tables and the tests."""


def folder_texts(program: str, words: dict[str, str]) -> dict[str, str]:
    """Return the program, the headers it includes, and how it is built: name of the file -> its text.

    Args:
        program: what `tables` returned.
        words: what stands for @NAME@ in the README; letters, digits and _ . , - are left of it.

    >>> sorted(folder_texts("", dict.fromkeys(("FUNCTIONAL", "TIMING", "SUITE", "SHA256"), "?")))[:3]
    ['CMakeLists.txt', 'README.md', 'cases.test']
    """
    texts = {PROGRAM: program}
    for source in (files(__package__) / "cpp").iterdir():
        text = source.read_text(encoding="utf-8")
        if source.name == "README.md":
            text = re.sub("@([A-Z0-9]+)@", lambda match: _plain(words[match[1]]), text)
        texts[source.name] = text
    return texts


def _plain(word: str) -> str:
    return re.sub(r"[^\w.,-]", "_", word)
