"""Runs commands of Parcours as processes of their own: what may take long, or runs the folder's code, is apart."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import signal
import sys
from collections.abc import AsyncGenerator
from dataclasses import dataclass, field
from pathlib import Path

from parcours.errors import BadRequest
from parcours.studio.folder import RESULTS, Folder

PATIENCE = 30.0
"""Longest time of a command whose answer is waited for [s]."""

_MOST_SAID = 8_000_000  # output of a command [bytes]
_MOST_KEPT = 4000  # last words of a run [characters]
_GRACE = 5.0  # from the request to end until the end by force [s]


async def answer_of(folder: Folder, arguments: list[str], module: str = "parcours") -> object:
    """Return the JSON value that a command prints.

    Raises BadRequest: it refuses, prints too much or takes too long; the message is its own.
    """
    process = await _started(folder, module, arguments, asyncio.subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    try:
        async with asyncio.timeout(PATIENCE):
            said, complaint = await asyncio.gather(_all(process.stdout), _all(process.stderr))
            await process.wait()
    except TimeoutError:
        rule = f"an answer must take {PATIENCE:g} s at most, but this one took longer"
        raise BadRequest(arguments[0], rule, "ask on the command line", slug="studio-long") from None
    finally:
        await _end(process, signal.SIGKILL)
    try:
        if process.returncode in (0, 1, 3):
            return json.loads(said)
    except ValueError:
        pass
    words = [line for line in complaint.decode(errors="replace").splitlines() if line.startswith("parcours: ")]
    rule = words[0].removeprefix("parcours: ") if words else complaint.decode(errors="replace")[-_MOST_KEPT:]
    raise BadRequest(f"parcours {arguments[0]}", f"refused: {rule}", slug="studio-refused")


async def lines_of(folder: Folder, module: str, arguments: list[str]) -> AsyncGenerator[str, None]:
    """Yield the lines that a module prints while it runs; it is ended when no more are wanted.

    Raises BadRequest: it refuses; the message is its own.
    """
    process = await _started(folder, module, arguments, asyncio.subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    try:
        while line := await process.stdout.readline():
            yield line.decode().strip()
        said = (await process.stderr.read(_MOST_KEPT)).decode(errors="replace")
        raise BadRequest(arguments[-1], f"its study cannot be read: {said}", slug="studio-refused")
    finally:
        await _end(process, signal.SIGKILL)


async def _all(stream: asyncio.StreamReader) -> bytes:
    content = bytearray()
    while part := await stream.read(65536):
        content += part
        if len(content) > _MOST_SAID:
            rule = f"an answer has at most {_MOST_SAID} bytes, but this one has more"
            raise BadRequest("parcours", rule, "ask on the command line", slug="studio-long")
    return bytes(content)


async def _started(folder: Folder, module: str, arguments: list[str], output: int) -> asyncio.subprocess.Process:
    # -P: modules that lie in the folder are not taken for those of Python and Parcours.
    return await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", module, *arguments, cwd=folder.root, stdin=asyncio.subprocess.DEVNULL,
        stdout=output, stderr=asyncio.subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


async def _end(process: asyncio.subprocess.Process, number: signal.Signals) -> None:
    """End a command with the processes that it has started."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        await process.wait()


@dataclass
class _Running:
    process: asyncio.subprocess.Process
    words: str = ""  # the last ones on standard error
    reading: asyncio.Task[None] | None = field(default=None, repr=False)


class StudioRuns:
    """The runs that the studio has started, by their folder; they end with it."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._running: dict[str, _Running] = {}

    async def start(self, study: str, named: str, options: list[str]) -> str:
        """Start `parcours run` of a study, `named` as on the command line; return the path of its new folder."""
        if any(one.process.returncode is None for one in self._running.values()):
            raise BadRequest(study, "one run at a time, but another goes on", "stop it first", slug="studio-running")
        name = Path(study).parent.name or (study if study.isidentifier() else "study")
        places = (f"out/{name}-{number}" for number in itertools.count(1))
        place = next(one for one in places if not os.path.lexists(self._folder.root / one))
        arguments = ["run", named, "--out", str(self._folder.root / place), *options]
        if self._folder.inside(self._folder.root / place) is None:
            raise BadRequest(place, "results must lie in the folder, but a link leads elsewhere", slug="studio-file")
        process = await _started(self._folder, "parcours", arguments, asyncio.subprocess.DEVNULL)
        running = self._running[place] = _Running(process)
        running.reading = asyncio.create_task(_listen(running))
        while not any((self._folder.root / place / name).exists() for name in RESULTS):
            await asyncio.sleep(0.05)
            if process.returncode is not None and running.reading.done():
                raise BadRequest(study, f"the run must start, but: {running.words}", slug="studio-refused")
        return place

    def state(self, run: str) -> dict[str, object]:
        """Return whether a run goes on, how it ended, and its last words; nothing of runs that others started."""
        one = self._running.get(run)
        if one is None:
            return {}
        return {"running": one.process.returncode is None, "exit": one.process.returncode, "words": one.words}

    async def stop(self, run: str) -> None:
        """End a run as Ctrl-C does: finished cases are kept."""
        one = self._running.get(run)
        if one is None or one.process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            one.process.send_signal(signal.SIGINT)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_GRACE):
                await one.process.wait()
        await _end(one.process, signal.SIGKILL)

    async def stop_all(self) -> None:
        """End all runs."""
        for run in self._running:
            await self.stop(run)


async def _listen(running: _Running) -> None:
    assert running.process.stderr is not None
    while part := await running.process.stderr.read(4096):
        running.words = (running.words + part.decode(errors="replace"))[-_MOST_KEPT:]
    await running.process.wait()
