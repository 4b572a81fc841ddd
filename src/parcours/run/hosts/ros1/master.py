"""Starts a ROS 1 master on loopback with logs of its own, and stops it without leaving anything behind."""

from __future__ import annotations

import errno
import os
import shutil
import socket
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import NoReturn
from urllib.parse import urlsplit

from parcours.errors import HostFailure
from parcours.run.hosts.foreign.process import KeptProcess
from parcours.run.hosts.interfaces import TESTER
from parcours.run.hosts.ros1 import interpreter_with
from parcours.run.hosts.ros1.graph import LOOPBACK, ask

_POLL = 0.01
_PATIENCE = 2.0
"""How long the master may take to end when asked [s]."""
_TAIL = 6


class Master:
    """A real master, without the logger node rosout, which would listen on all interfaces.

    Raises HostFailure if there is no ROS 1, the port is taken, or the master does not answer in time.

    Within the context `os.environ` names the master and loopback; `environment` is the same for other processes.
    Ends with this process, however that ends.

    Args:
        port: where it listens; a free one if not given.
        within: how long it may take to answer [s].
    """

    def __init__(self, port: int | None = None, *, within: float = 30.0) -> None:
        self.port = _free_port() if port is None else port
        self.uri = f"http://{LOOPBACK}:{self.port}/"
        self._within = within
        self._folder: Path | None = None
        self._replaced: dict[str, str | None] = {}
        self._process: KeptProcess | None = None

    @property
    def pid(self) -> int:
        """The master's process id; 0 when it does not run."""
        return self._process.pid if self._process else 0

    @property
    def folder(self) -> Path:
        """Where the master's logs are, until it is closed."""
        if self._folder is None:
            raise HostFailure(f"ROS master {self.uri}", "is not running", "enter its context", slug="master-start")
        return self._folder

    @property
    def environment(self) -> dict[str, str]:
        """What a node needs to find this master, to stay on loopback, and to log into the master's folder."""
        return {
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": LOOPBACK,
            "ROS_HOSTNAME": LOOPBACK,
            "ROS_HOME": str(self.folder / "home"),
            "ROS_LOG_DIR": str(self.folder / "log"),
        }

    def __enter__(self) -> Master:
        python = interpreter_with("rosmaster")
        _require_free(self.port)
        self._folder = Path(tempfile.mkdtemp(prefix="parcours-ros1-"))
        try:
            self._start(python)
        except BaseException:
            self.close()
            raise
        for name, value in self.environment.items():
            self._replaced[name] = os.environ.get(name)
            os.environ[name] = value
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the master, by force if it must be, and remove its folder. Closing again does nothing."""
        for name, value in self._replaced.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        self._replaced.clear()
        process, self._process = self._process, None
        if process is not None:
            process.ask_to_end()
            process.end(_PATIENCE)
        folder, self._folder = self._folder, None
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def _start(self, python: str) -> None:
        for part in ("home", "log"):
            (self.folder / part).mkdir()
        command = [python, "-c", "import rosmaster; rosmaster.rosmaster_main()", "--core", "-p", str(self.port)]
        environment, log = os.environ | self.environment, self.folder / "output"
        process = KeptProcess("ROS master", command, self.folder, environment, log, str(self.folder))
        self._process = process
        process.await_start()
        deadline = time.monotonic() + self._within
        while (left := deadline - time.monotonic()) > 0:
            if _process_at(self.uri, left) == process.pid:
                return
            if process.look():
                self._fail(f"must run, but ended with status {process.status}")
            time.sleep(_POLL)
        self._fail(f"must answer within {self._within:g} s, but does not")

    def _fail(self, rule: str) -> NoReturn:
        lines: list[str] = []
        for path in (self.folder / "output", *sorted((self.folder / "log").rglob("*.log"))):
            with suppress(OSError):
                lines += path.read_text(errors="replace").splitlines()[-_TAIL:]
        remedy = "the last lines of its log: " + (" | ".join(lines) if lines else "none")
        raise HostFailure(f"ROS master {self.uri}", rule, remedy, slug="master-start")


def require_master(uri: str, within: float = 5.0) -> int:
    """Return the process id of the live master at `uri`, after waiting for it if need be.

    Args:
        uri: as in ROS_MASTER_URI: http://host:port.
        within: how long to wait for an answer [s].

    Raises:
        HostFailure: the address cannot be read, or no ROS master answers there in time.

    >>> require_master("127.0.0.1:11311")
    Traceback (most recent call last):
    parcours.errors.HostFailure: ROS_MASTER_URI '127.0.0.1:11311': must read http://host:port; \
for a master on this machine: http://127.0.0.1:11311 [master-uri]
    """
    try:
        parts = urlsplit(uri)
        scheme, host, port = parts.scheme, parts.hostname, parts.port
    except ValueError:
        scheme, host, port = "", None, None
    if scheme != "http" or host is None or port is None:
        remedy = f"for a master on this machine: http://{LOOPBACK}:11311"
        raise HostFailure(f"ROS_MASTER_URI {uri!r}", "must read http://host:port", remedy, slug="master-uri")
    found: list[int | str] = []
    deadline = time.monotonic() + within

    def ask() -> None:
        # On a thread: to resolve a name may take longer than anybody wants to wait, and cannot be interrupted.
        while (left := deadline - time.monotonic()) > 0:
            answer = _process_at(uri, left)
            found.append(answer)
            if isinstance(answer, int):
                return
            time.sleep(5 * _POLL)

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    asking.join(within)
    last = found[-1] if found else f"no answer from {host} within {within:g} s"
    if isinstance(last, int):
        return last
    remedy = (
        "start it (roscore), or correct the address; inside a network namespace only masters started there are seen"
    )
    raise HostFailure(f"ROS master {uri}", f"must answer within {within:g} s, but: {last}", remedy, slug="no-master")


def _process_at(uri: str, within: float) -> int | str:
    """Return the process id that a master gives, or what happened instead."""
    try:
        found = ask(uri, "getPid", TESTER, within=within)
    except HostFailure as failure:
        return failure.rule.partition("but: ")[2]
    return found if isinstance(found, int) else f"it answers {found!r:.80}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _require_free(port: int) -> None:
    if not 0 < port < 65_536:
        raise HostFailure(f"port {port} of {LOOPBACK}", "must lie between 1 and 65535", slug="port-in-use")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
            return
        except OSError as error:
            taken, reason = error.errno == errno.EADDRINUSE, error.strerror
    owner = _process_at(f"http://{LOOPBACK}:{port}/", 1.0) if taken else ""
    who = f"a ROS master (process {owner})" if isinstance(owner, int) else "another program"
    rule = f"must be free, but {who} listens there" if taken else f"must be free to use, but: {reason}"
    remedy = "stop it, give another port or none, or start the graph in a network of its own"
    raise HostFailure(f"port {port} of {LOOPBACK}", rule, remedy, slug="port-in-use")
