"""A suite file and the checksum that a script remembers of it -> its cases, if it is still the same file."""

from __future__ import annotations

import hashlib
from pathlib import Path

from parcours.errors import BadSuite
from parcours.suite.cases import Case
from parcours.suite.files import read_suite


def checksum(path: Path | str) -> str:
    """Return the SHA-256 of a file in hexadecimal digits.

    Raises:
        BadSuite: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        rule = f"a suite must be a readable file, but: {error.strerror or error}"
        raise BadSuite(str(path), rule, "check the path", slug="unreadable-file") from None


def sealed_cases(path: Path | str, sha256: str) -> list[Case]:
    """Return the cases of a suite file that has not changed since a script was written for it.

    Args:
        path: the suite file.
        sha256: its checksum then, in hexadecimal digits.

    Raises:
        BadSuite: the file cannot be read, is no suite, or is another than that.

    >>> import tempfile
    >>> from parcours.suite import write_suite
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "suite.jsonl")
    ...     n = write_suite(path, [Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)])
    ...     [case.id for case in sealed_cases(path, checksum(path))]
    ['demo/together/0']
    """
    found = checksum(path)
    if found != sha256:
        rule = f"the suite must have the checksum {sha256[:16]}..., but has {found[:16]}..."
        raise BadSuite(str(path), rule, "export the script anew", slug="suite-changed")
    return list(read_suite(path))
