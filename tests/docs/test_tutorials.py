"""The tutorials are run as a reader would run them: files are written, commands give the output on the page.

A page is a script, from top to bottom, in an empty folder:

- A fenced block whose info string names a file, as in "```python coffee.py", is the content of that file.
- A block "```diff coffee.py" edits it: the lines that begin with a space or `-` must stand there once, and become the
  lines that begin with a space or `+`.
- In a block "```console" each line `$ command` is run by bash. The lines below it are what it prints: standard output,
  then standard error without the lines of progress, for which a terminal shows a bar. As in a doctest, `...` stands for
  any text, and any white space for any other. A last line `[1]` is the exit code; without it the exit code must be 0.

All other blocks are for reading only.
"""

from __future__ import annotations

import contextlib
import doctest
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PROGRESS = re.compile(r".+: \d+ of \d+(, .*)?|compiling kernels .*")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def run_page(page: str, folder: Path) -> int:
    """Write the files of a page into a folder and run its commands there; return how many commands were run."""
    n_commands = 0
    for language, name, content in BLOCK.findall(page):
        if language == "console":
            for command, expected, code in commands_of(content):
                require_output(command, expected, code, folder)
                n_commands += 1
        elif language == "diff" and name:
            edit(folder / name, content)
        elif name:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content, encoding="utf-8")
    return n_commands


def commands_of(block: str) -> list[tuple[str, str, int]]:
    """Return each command of a block with its expected output and exit code."""
    found = []
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        match = re.search(r"^\[(\d+)\]\n\Z", expected, re.MULTILINE)
        found.append((command, expected[: match.start()] if match else expected, int(match[1]) if match else 0))
    return found


def require_output(command: str, expected: str, code: int, folder: Path) -> None:
    """Run a command, and fail unless it prints what is expected and exits with the code."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    said = [line for line in done.stderr.splitlines(keepends=True) if not PROGRESS.fullmatch(line.strip())]
    printed = done.stdout + "".join(said)
    matches = doctest.OutputChecker().check_output(expected, printed, FLAGS)
    assert matches and done.returncode == code, (
        f"$ {command}\nexpected [{code}]:\n{expected}\nprinted [{done.returncode}]:\n{printed}"
    )


def edit(path: Path, difference: str) -> None:
    """Replace the lines of a block that are not new by those that are not old."""
    lines = difference.splitlines(keepends=True)
    old, new = ("".join(line[1:] or "\n" for line in lines if line[0] in kinds) for kinds in (" \n-", " \n+"))
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path.name} must have these lines once:\n{old}"
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("tutorial-components", 12),
        ("tutorial-planner-ci", 8),
        ("tutorial-failure", 6),
        ("tutorial-ros2", 2),
        ("studies", 1),
    ],
)
def test_what_a_page_says_is_what_happens(name: str, least: int, tmp_path: Path) -> None:
    assert run_page((DOCS / f"{name}.md").read_text(encoding="utf-8"), tmp_path) >= least


def test_what_the_page_on_clusters_says_is_what_happens(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    page = (DOCS / "tutorial-cluster.md").read_text(encoding="utf-8").replace(":8786", f":{port}")
    try:
        assert run_page(page.replace("--port 8786", f"--port {port}"), tmp_path) >= 8
    finally:  # also of a page that fails: nothing that it has started is left
        for process in tmp_path.glob("*.pid"):
            with contextlib.suppress(ProcessLookupError):
                os.kill(int(process.read_text()), signal.SIGKILL)


@pytest.mark.parametrize(
    ("page", "wrong"),
    [
        ("```console\n$ echo yes\nno\n```\n", "expected"),
        ("```console\n$ exit 3\n```\n", "printed [3]"),
        ("```console\n$ true\n[1]\n```\n", "expected [1]"),
        ("```text a.txt\none\n```\n```diff a.txt\n-two\n+three\n```\n", "must have these lines once"),
    ],
)
def test_a_page_that_says_something_else_fails(page: str, wrong: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=re.escape(wrong)):
        run_page(page, tmp_path)


def test_a_page_that_says_what_happens_passes(tmp_path: Path) -> None:
    page = (
        "```text a.txt\none\ntwo\n```\n```diff a.txt\n one\n-two\n+three\n```\n"
        "```console\n$ cat a.txt; echo 'cases: 1 of 2' >&2\none\n...\n$ cat absent\ncat: ...\n[1]\n```\n"
    )
    assert run_page(page, tmp_path) == 2
