"""`parcours` called in this process: exit code, standard output and standard error, as its own process would give."""

from __future__ import annotations

import contextlib
import io
import sys
from unittest.mock import patch

from parcours.cli import main


def parcours_here(*arguments: object) -> tuple[int, str, str]:
    """Return exit code, output and complaints; a start of the interpreter with numba takes a second, this does not."""
    with (
        patch.object(sys, "argv", ["parcours", *map(str, arguments)]),
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as complaints,
    ):
        try:
            main()
        except SystemExit as ended:
            return int(ended.code or 0), out.getvalue(), complaints.getvalue()
    raise AssertionError("the command must end by an exit code")
