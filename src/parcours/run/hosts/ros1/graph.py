"""Asks a ROS 1 master and other nodes by XML-RPC, and answers what they ask; messages travel by other ways."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from http.client import HTTPConnection, HTTPException
from socketserver import ThreadingMixIn
from typing import Any, NoReturn
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as RpcError
from xmlrpc.client import dumps, loads
from xmlrpc.server import SimpleXMLRPCServer

from parcours.errors import HostFailure

LOOPBACK = "127.0.0.1"
WITHIN = 5.0
"""How long a node or the master may take to answer [s]."""

_ASKER = "/parcours"
_LONGEST_ANSWER = 4_000_000


def ask(uri: str, method: str, *arguments: object, within: float = WITHIN) -> Any:
    """Return what a node or the master answers, the third of its triple.

    Raises HostFailure if there is no answer, or not one of ROS, or it is a refusal.
    """
    code, text, value = _triple(uri, method, _asked(uri, method, arguments, within))
    if code != 1:
        _fail(uri, method, text)
    return value


def ask_all(uri: str, calls: Sequence[tuple[str, Sequence[object]]], within: float = WITHIN) -> list[Any]:
    """Return the answers to several (method, arguments) of the master at once; None for what is refused.

    Raises HostFailure if there is no answer, or not one of ROS.
    """
    if not calls:
        return []
    many = [{"methodName": method, "params": list(arguments)} for method, arguments in calls]
    answers = _asked(uri, "system.multicall", (many,), within)
    found: list[Any] = []
    for (method, _), answer in zip(calls, answers, strict=True):
        code, _text, value = _triple(uri, method, answer[0] if isinstance(answer, list) else answer)
        found.append(value if code == 1 else None)
    return found


def _asked(uri: str, method: str, arguments: tuple[Any, ...], within: float) -> Any:
    parts = urlsplit(uri)
    connection = HTTPConnection(parts.hostname or "", parts.port, timeout=within)
    try:
        connection.request("POST", "/RPC2", dumps(arguments, method), {"Content-Type": "text/xml"})
        (answer,), _ = loads(connection.getresponse().read(_LONGEST_ANSWER), use_builtin_types=True)
    except OSError as error:
        _fail(uri, method, error.strerror or str(error) or "silence")
    except (HTTPException, RpcError, ExpatError, ValueError, TypeError) as error:
        _fail(uri, method, f"what answers there is not ROS: {error!r:.80}")
    finally:
        connection.close()
    return answer


def _triple(uri: str, method: str, answer: Any) -> tuple[int, str, Any]:
    if not isinstance(answer, list | tuple) or len(answer) != 3:
        _fail(uri, method, f"it answers {answer!r:.80}")
    return answer[0], str(answer[1]), answer[2]


def _fail(uri: str, method: str, what: str) -> NoReturn:
    raise HostFailure(f"ROS 1 at {uri}", f"must answer {method}, but: {what}", "is it still running?",
                      slug="ros1-answer")  # fmt: skip


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    """Threads, since a node that asks another may be asked by it meanwhile."""

    daemon_threads = True
    block_on_close = False

    def __init__(self, ended: Callable[[], None]) -> None:
        super().__init__((LOOPBACK, 0), allow_none=True, logRequests=False)
        self.is_to_end = False
        self._ended = ended

    def shutdown_request(self, request: Any) -> None:
        """Close a connection; by now its answer has left."""
        super().shutdown_request(request)
        if self.is_to_end:
            self._ended()


Answers = Mapping[str, Callable[..., object]]
"""Method -> its answer; a HostFailure is answered as a refusal."""


class Slave:
    """A name's end of the graph: it answers, on loopback, in threads of its own."""

    def __init__(self, master: str, answers: Answers, ended: Callable[[], None] = lambda: None) -> None:
        self._server = _Server(ended)
        self.uri = f"http://{LOOPBACK}:{self._server.server_address[1]}/"
        usual: dict[str, Callable[..., object]] = {
            "getPid": os.getpid,
            "getMasterUri": lambda: master,
            "getBusStats": lambda: [[], [], []],
            "paramUpdate": lambda key, value: 0,
            "shutdown": self._end,
        }
        for name, answer in {**usual, **answers}.items():
            self._server.register_function(_method(answer), name)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True, name="ros1-graph")
        self._thread.start()

    def _end(self, reason: str = "") -> int:
        self._server.is_to_end = True
        return 0

    def close(self) -> None:
        """Answer no more."""
        self._server.shutdown()
        self._thread.join()
        with contextlib.suppress(OSError):
            self._server.server_close()


def _method(answer: Callable[..., object]) -> Any:
    def method(caller: str, *arguments: object) -> list[object]:
        try:
            return [1, "", answer(*arguments)]
        except HostFailure as refused:
            return [-1, str(refused), 0]

    return method


def require_free(master: str, names: Sequence[str]) -> None:
    """Refuse names that a living node has on the graph: the master would tell that one to end.

    Raises HostFailure if one of them is taken.
    """
    for name in names:
        try:
            uri = ask(master, "lookupNode", _ASKER, name)
            process = ask(uri, "getPid", _ASKER, within=1.0)
        except HostFailure:
            continue
        rule = f"must be free on the graph, but a node of that name runs (process {process})"
        raise HostFailure(f"ROS 1 node {name}", rule, "stop it, or use a master of its own", slug="ros1-name")


def leave(master: str, names: list[str]) -> None:
    """Remove all that nodes of these names have registered, as far as the master lets it be."""
    with contextlib.suppress(HostFailure):
        publishers, subscribers, services = ask(master, "getSystemState", _ASKER)
        uris = dict(zip(names, ask_all(master, [("lookupNode", (_ASKER, name)) for name in names]), strict=True))
        calls: list[tuple[str, tuple[object, ...]]] = []
        for method, state in (("unregisterPublisher", publishers), ("unregisterSubscriber", subscribers)):
            calls += [(method, (who, topic, uris[who])) for topic, all_ in state for who in all_ if uris.get(who)]
        held = [(service, who) for service, all_ in services for who in all_ if who in uris]
        where = ask_all(master, [("lookupService", (_ASKER, service)) for service, _ in held])
        calls += [("unregisterService", (who, service, at)) for (service, who), at in zip(held, where, strict=True)]
        ask_all(master, calls)
