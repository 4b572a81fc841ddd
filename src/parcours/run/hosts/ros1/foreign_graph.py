"""A name on a ROS 1 graph of others -> what anybody says to it as bytes, in one thread; types are learned from peers.

Unlike `participant`, whose nodes are ours and known by name, this end hears every publisher, serves every client, keeps
latched messages, and advertises types that it has only read in another's connection header.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Callable

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.foreign_endpoints import (
    ANY,
    WITHIN,
    Caller,
    Kind,
    Publisher,
    Reply,
    ServiceServer,
    Subscriber,
    opened,
)
from parcours.run.hosts.ros1.foreign_listener import Door
from parcours.run.hosts.ros1.graph import Slave, ask, ask_all
from parcours.run.hosts.ros1.master import LOOPBACK
from parcours.run.hosts.ros1.streams import Stream

_TRIES, _PAUSE = 10, 0.5
"""So often a publisher is asked to let the tester hear it, and how long after another [s]."""


class Middle:
    """The tester's name on the graph, on loopback.

    Args:
        name: with its slash.
        master: http://host:port.
        refused: told, in any thread, of connections that were declined or could not be made, and why.
    """

    def __init__(self, name: str, master: str, refused: Callable[[str], None] = lambda text: None) -> None:
        self.name, self.master, self._refused = name, master, refused
        self._publishers: dict[str, Publisher] = {}
        self._subscribers: dict[str, Subscriber] = {}
        self._servers: dict[str, ServiceServer] = {}
        self._streams: dict[int, tuple[Stream, Callable[[bytes, bytes], None], Callable[[], None]]] = {}
        self._lock = threading.RLock()
        self._poll = select.epoll()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll.register(self._wake, select.EPOLLIN)
        self._watched: dict[int, Callable[[], None]] = {}
        self._closed = False
        self._door = Door(self, self._publishers, self._servers, refused)
        self._slave = Slave(master, {
            "requestTopic": self._where, "publisherUpdate": self._update,
            "getPublications": lambda: [[one.topic, one.kind.type] for one in self._publishers.values()],
            "getSubscriptions": lambda: [[one.topic, one.kind.type] for one in self._subscribers.values()],
            "getBusInfo": self._connections,
        })  # fmt: skip
        self.uri = self._slave.uri

    def publish(self, topic: str, kind: Kind, *, queue: int = 16, latch: bool = False) -> Publisher:
        """Offer a topic, at once. Raises HostFailure if the master refuses."""
        publisher = self._publishers[topic] = Publisher(self, topic, kind, queue, latch)
        ask(self.master, "registerPublisher", self.name, topic, kind.type, self.uri)
        return publisher

    def subscribe(self, topic: str, kind: Kind, heard: Callable[[str, bytes], None],
                  joined: Callable[[Kind], None] = lambda kind: None) -> Subscriber:  # fmt: skip
        """Hear a topic, from now on; `joined` is told, in any thread, what each publisher says it carries."""
        subscriber = self._subscribers[topic] = Subscriber(topic, kind, heard, joined)
        publishers = ask(self.master, "registerSubscriber", self.name, topic, kind.type, self.uri)
        self._connect_later(subscriber, publishers)
        return subscriber

    def serve(self, service: str, kind: Kind, asked: Callable[[str, bytes, Reply], None]) -> None:
        """Serve a service, from now on."""
        self._servers[service] = ServiceServer(service, kind, asked)
        at = f"rosrpc://{LOOPBACK}:{self._door.port}"
        ask(self.master, "registerService", self.name, service, at, self.uri)

    def call(self, service: str, kind: Kind) -> Caller:
        """Return what calls a service; nothing is connected yet."""
        return Caller(self, service, kind)

    def leave(self, names: list[str]) -> None:
        """Withdraw topics and services of these names, and end what is connected to them."""
        at = f"rosrpc://{LOOPBACK}:{self._door.port}"
        calls: list[tuple[str, tuple[object, ...]]] = []
        for name in names:
            if self._publishers.pop(name, None):
                calls.append(("unregisterPublisher", (self.name, name, self.uri)))
            subscriber = self._subscribers.pop(name, None)
            if subscriber is not None:
                calls.append(("unregisterSubscriber", (self.name, name, self.uri)))
                for stream in list(subscriber.streams.values()):
                    self.drop(stream)
            if self._servers.pop(name, None):
                calls.append(("unregisterService", (self.name, name, at)))
        with contextlib.suppress(HostFailure):
            ask_all(self.master, calls)

    # The thread that waits.

    def watch(self, descriptor: int, ready: Callable[[], None]) -> None:
        """Call `ready`, in the thread that spins, whenever the descriptor can be read."""
        with self._lock:
            self._watched[descriptor] = ready
            self._poll.register(descriptor, select.EPOLLIN)

    def unwatch(self, descriptor: int) -> None:
        """Watch it no longer."""
        with self._lock:
            if self._watched.pop(descriptor, None) is not None:
                self._poll.unregister(descriptor)

    def spin(self, until: int) -> bool:
        """Hear what has arrived, or what arrives before the monotonic clock shows `until` [ns].

        Returns:
            whether anything happened.
        """
        events = self._poll.poll(0)
        if not events:
            left = (until - time.perf_counter_ns()) * 1e-9
            if left <= 0:
                return False
            select.select([self._poll], [], [], left)  # to the microsecond; an epoll waits by milliseconds
            events = self._poll.poll(0)
        for descriptor, what in events:
            watched = self._watched.get(descriptor)
            if watched is not None:
                watched()
                continue
            end = self._streams.get(descriptor)
            if end is None:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
                continue
            self._attend(descriptor, what, *end)
        return bool(events)

    def _attend(self, descriptor: int, what: int, stream: Stream, heard: Callable[[bytes, bytes], None],
                lost: Callable[[], None]) -> None:  # fmt: skip
        if what & select.EPOLLOUT:
            stream.flush()
            if not stream.waits and not stream.closed:
                self._poll.modify(descriptor, select.EPOLLIN)
        if what & ~select.EPOLLOUT:
            stream.read()
            while stream.arrived:
                heard(*stream.arrived.popleft())
        if stream.closed and self._forget(descriptor, stream):
            lost()

    def attend(self, stream: Stream, heard: Callable[[bytes, bytes], None], lost: Callable[[], None]) -> None:
        """Call `heard` with (mark, message) of the stream, in the thread that spins; `lost` at its end."""
        with self._lock:
            if self._closed:
                stream.close()
                return
            self._streams[stream.fileno()] = stream, heard, lost
            self._poll.register(stream.fileno(), select.EPOLLIN | (select.EPOLLOUT if stream.waits else 0))

    def await_room(self, stream: Stream) -> None:
        """See to it that the stream sends on what waits, as soon as there is room."""
        with self._lock:
            if stream.fileno() in self._streams:
                self._poll.modify(stream.fileno(), select.EPOLLIN | select.EPOLLOUT)

    def drop(self, stream: Stream) -> None:
        """Close the stream; its end is told to nobody."""
        with self._lock:
            descriptor = stream.fileno()
            if self._streams.get(descriptor, (None,))[0] is stream:
                self._forget(descriptor, stream)
        stream.close()

    def _forget(self, descriptor: int, stream: Stream) -> bool:
        with self._lock:
            if self._streams.get(descriptor, (None,))[0] is not stream:
                return False
            del self._streams[descriptor]
            with contextlib.suppress(OSError):
                self._poll.unregister(descriptor)
            stream.close()
            return True

    def close(self) -> None:
        """Leave the graph, and end the threads. Closing again does nothing."""
        if self._closed:
            return
        self.leave([*self._publishers, *self._subscribers, *self._servers])
        with self._lock:
            self._closed = True
        self._slave.close()
        self._door.close()
        for stream, _, _ in list(self._streams.values()):
            stream.close()
        self._streams.clear()
        self._poll.close()
        os.close(self._wake)

    # Other threads: connections are formed.

    def _where(self, topic: str, protocols: list[list[object]]) -> object:
        if topic not in self._publishers:
            raise HostFailure(self.name, f"does not publish {topic}", slug="ros1-header")
        if not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            raise HostFailure(self.name, "speaks TCPROS only", slug="ros1-header")
        return ["TCPROS", LOOPBACK, self._door.port]

    def _update(self, topic: str, publishers: list[str]) -> int:
        if topic in self._subscribers:
            self._connect_later(self._subscribers[topic], publishers)
        return 0

    def _connections(self) -> list[list[object]]:
        found: list[list[object]] = []
        for publisher in list(self._publishers.values()):
            found += [
                [len(found) + k, peer, "o", "TCPROS", publisher.topic, True] for k, peer in enumerate(publisher.peers)
            ]
        for subscriber in list(self._subscribers.values()):
            found += [
                [len(found) + k, uri, "i", "TCPROS", subscriber.topic, True] for k, uri in enumerate(subscriber.streams)
            ]
        return found

    def _connect_later(self, subscriber: Subscriber, publishers: list[str]) -> None:
        subscriber.publishers = frozenset(publishers)
        threading.Thread(target=self._connect, args=(subscriber, publishers), daemon=True, name="ros1-join").start()

    def _connect(self, subscriber: Subscriber, publishers: list[str]) -> None:
        """Connect with publishers; again, if one does not answer: a busy machine may keep it from that."""
        for _ in range(_TRIES):
            with subscriber.lock:
                publishers = [uri for uri in publishers if not self._is_connected(subscriber, uri)]
            if not publishers:
                return
            time.sleep(_PAUSE)

    def _is_connected(self, subscriber: Subscriber, uri: str) -> bool:
        """Whether nothing is left to do for this publisher, after trying."""
        known = subscriber.streams.get(uri)
        is_gone = uri not in subscriber.publishers or self._subscribers.get(subscriber.topic) is not subscriber
        if is_gone or uri == self.uri or (known is not None and not known.closed):
            return True
        try:
            self._listen(subscriber, uri)
        except HostFailure as failure:
            if not self._closed:
                self._refused(f"{subscriber.topic}: no connection to the publisher at {uri}: {failure.rule}")
            return self._closed
        return True

    def _listen(self, subscriber: Subscriber, uri: str) -> None:
        found = ask(uri, "requestTopic", self.name, subscriber.topic, [["TCPROS"]], within=WITHIN)
        if not (isinstance(found, list) and len(found) == 3 and found[0] == "TCPROS"):
            raise HostFailure(
                uri, f"must offer {subscriber.topic} by TCPROS, but answers {found!r:.60}", slug="ros1-header"
            )
        wanted = {"type": subscriber.kind.type, "md5sum": subscriber.kind.md5}
        header = {"callerid": self.name, "topic": subscriber.topic, "tcp_nodelay": "1", **wanted}
        connection, told = opened(str(found[1]), int(found[2]), header)
        if not subscriber.kind.agrees(told):
            connection.close()
            raise HostFailure(uri, f"carries {told.get('type')}, md5 {told.get('md5sum')}, not {subscriber.kind.type}",
                              slug="ros1-header")  # fmt: skip
        stream = Stream(connection, told.get("callerid", "?"))
        subscriber.streams[uri] = stream
        subscriber.joined(Kind(told.get("type", ANY), told.get("md5sum", ANY), told.get("message_definition", "")))

        def lost() -> None:
            if subscriber.streams.get(uri) is stream:
                del subscriber.streams[uri]

        self.attend(stream, lambda mark, data: subscriber.heard(stream.peer, data), lost)
