"""A name on a ROS 1 graph: registers at the master, forms TCPROS connections, and hears all of them in one thread.

Parcours speaks ROS 1 by its own sockets: of rospy a process has one node for good, its publishers stand still or drop
while a reader is frozen, and each message changes threads on its way. Here the thread that spins reads all sockets;
others only form connections:

    master ──publisherUpdate──► slave's thread ──► "ros1-join" threads ──┐
    other nodes ──connect──► doorman's thread ──► "ros1-welcome" threads ─┴─ attend ──► epoll ◄── spin
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence

from parcours.errors import HostFailure
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.ros1.endpoints import ANY, WITHIN, Kind, Ros1Client, Ros1Publisher, Server, Subscriber, opened
from parcours.run.hosts.ros1.graph import LOOPBACK, Slave, ask, ask_all
from parcours.run.hosts.ros1.streams import ANSWERED, REFUSED, Doorway, Stream, write_header

_TRIES, _PAUSE = 10, 0.5
"""How often a publisher is asked for a connection, and how long after the last time [s]."""

_LAYOUT = 8
"""Length of the empty layout before the bytes of a frame: no dimensions, no offset."""

Heard = Callable[[bytes, bytes], None]


class Ros1Node:
    """A name on the graph, on loopback."""

    def __init__(self, name: str, master: str, refused: Callable[[str], None] = lambda text: None,
                 frame_kind: Kind | None = None) -> None:  # fmt: skip
        self.name, self.master, self._refused, self.frame_kind = name, master, refused, frame_kind
        self.is_ended = False
        """Whether a tool of the graph has ordered it to shut down (rosnode kill)."""
        self.publishers: dict[str, Ros1Publisher] = {}
        self.subscribers: dict[str, Subscriber] = {}
        self.servers: dict[str, Server] = {}
        self._streams: dict[int, tuple[Stream, Heard, Callable[[], None]]] = {}
        self._crowded: set[Stream] = set()
        self._watched: dict[int, Callable[[], None]] = {}
        self._lock = threading.RLock()
        self._poll = select.epoll()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll.register(self._wake, select.EPOLLIN)
        self._closed = False
        self._door = Doorway(self._admit, refused)
        self._slave = Slave(master, {
            "requestTopic": self._where, "publisherUpdate": self._update,
            "getPublications": lambda: [[one.topic, one.kind.type] for one in self.publishers.values()],
            "getSubscriptions": lambda: [[one.topic, one.kind.type] for one in self.subscribers.values()],
            "getBusInfo": self._connections,
        }, self._end)  # fmt: skip
        self.uri, self._at = self._slave.uri, f"rosrpc://{LOOPBACK}:{self._door.port}"
        self._unregistered: list[tuple[str, tuple[object, ...]]] = []

    # What it offers and wants, registered at the master by `join`, or by the next `spin`.

    def publish(self, topic: str, kind: Kind, peer: str = "", *, queue: int = 16, latch: bool = False) -> Ros1Publisher:
        """Offer a topic; see `Ros1Publisher`."""
        publisher = self.publishers[topic] = Ros1Publisher(self, topic, kind, queue, latch, peer)
        self._unregistered.append(("registerPublisher", (self.name, topic, kind.type, self.uri)))
        return publisher

    def subscribe(self, topic: str, kind: Kind, heard: Callable[[bytes], None], peer: str = "", *,
                  joined: Callable[[Kind], None] = lambda kind: None,
                  lost: Callable[[], None] = lambda: None) -> Subscriber:  # fmt: skip
        """Hear a topic; see `Subscriber`."""
        subscriber = self.subscribers[topic] = Subscriber(topic, kind, peer, heard, joined, lost)
        self._unregistered.append(("registerSubscriber", (self.name, topic, kind.type, self.uri)))
        return subscriber

    def serve(self, service: str, kind: Kind, asked: Callable[[bytes, Reply], None], peer: str = "") -> None:
        """Serve a service; see `Server`."""
        self.servers[service] = Server(service, kind, asked, peer)
        self._unregistered.insert(0, ("registerService", (self.name, service, self._at, self.uri)))

    def call(self, service: str, kind: Kind, lanes: int = 1) -> Ros1Client:
        """Return what calls a service; nothing is connected yet."""
        return Ros1Client(self, service, kind, lanes)

    # One frame per message, also where several are sent together: the Google Test export's C++ reads the same.

    def wrap(self, frames: Sequence[bytes]) -> list[bytes]:
        """Return each frame as a std_msgs/UInt8MultiArray."""
        return [bytes(_LAYOUT) + len(frame).to_bytes(4, "little") + frame for frame in frames]

    def unwrap(self, message: bytes) -> tuple[bytes]:
        """Return the bytes of a UInt8MultiArray with an empty layout. Raises HostFailure for other bytes."""
        size = int.from_bytes(message[_LAYOUT : _LAYOUT + 4], "little")
        if message[:_LAYOUT] != bytes(_LAYOUT) or size != len(message) - _LAYOUT - 4:
            rule = f"must be an array of bytes, but {len(message)} other bytes came"
            raise HostFailure("ROS 1 frame", rule, slug="frame-foreign")
        return (message[_LAYOUT + 4 :],)

    def join(self) -> None:
        """Register what is not registered yet. Raises HostFailure if the master does not answer, or refuses."""
        calls, self._unregistered = self._unregistered, []
        for (method, arguments), answer in zip(calls, ask_all(self.master, calls), strict=True):
            if answer is None:
                rule = f"must be let into the graph, but the master refuses {method} of {arguments[1]}"
                raise HostFailure(f"ROS 1 node {self.name}", rule, slug="ros1-answer")
            if method == "registerSubscriber":
                self._update(str(arguments[1]), answer)

    def leave(self, names: Sequence[str]) -> None:
        """Withdraw topics and services of these names, and close what is heard on them."""
        calls: list[tuple[str, tuple[object, ...]]] = []
        for name in names:
            if self.publishers.pop(name, None):
                calls.append(("unregisterPublisher", (self.name, name, self.uri)))
            subscriber = self.subscribers.pop(name, None)
            if subscriber is not None:
                calls.append(("unregisterSubscriber", (self.name, name, self.uri)))
                for stream in list(subscriber.streams.values()):
                    self.drop(stream)
            if self.servers.pop(name, None):
                calls.append(("unregisterService", (self.name, name, self._at)))
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

    def spin(self, until: int | None) -> bool:
        """Hear what has arrived, or what arrives before the monotonic clock shows `until` [ns]; None waits on.

        Returns:
            whether anything happened.
        """
        if self._unregistered:
            self.join()
        events = self._poll.poll(0)
        if not events:
            left = None if until is None else (until - time.perf_counter_ns()) * 1e-9
            if left is not None and left <= 0:
                return False
            select.select([self._poll], [], [], left)  # to the microsecond; an epoll waits by milliseconds
            events = self._poll.poll(0)
        for descriptor, what in events:
            if descriptor in self._watched:
                self._watched[descriptor]()
            elif descriptor in self._streams:
                self._attend(descriptor, what, *self._streams[descriptor])
            else:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
        return bool(events)

    def _attend(self, descriptor: int, what: int, stream: Stream, heard: Heard, lost: Callable[[], None]) -> None:
        if what & select.EPOLLOUT:
            stream.flush()
            if not stream.waits:
                self._crowded.discard(stream)
                with self._lock:
                    self._poll.modify(descriptor, select.EPOLLIN)
        if what & ~select.EPOLLOUT:
            for mark, message in stream.marked_frames():
                heard(mark, message)
        if stream.closed and self._forget(stream):
            lost()

    def attend(self, stream: Stream, heard: Heard, lost: Callable[[], None]) -> None:
        """Call `heard` with (mark, message) of the stream, in the thread that spins; `lost` at its end."""
        with self._lock:
            if self._closed:
                stream.close()
                return
            self._streams[stream.fileno()] = stream, heard, lost
            self._poll.register(stream.fileno(), select.EPOLLIN | (select.EPOLLOUT if stream.waits else 0))

    def send(self, stream: Stream, *messages: bytes, mark: bytes = b"") -> None:
        """Send messages; what finds no room leaves while the client spins."""
        stream.send(*messages, mark=mark)
        if stream.waits:
            self._crowded.add(stream)
            with self._lock:
                if stream.fileno() in self._streams:
                    self._poll.modify(stream.fileno(), select.EPOLLIN | select.EPOLLOUT)

    def flush(self, peer: str) -> None:
        """Wait until everything for `peer` has left."""
        for stream in list(self._crowded):
            if stream.peer == peer:
                stream.flush(wait=True)
                self._crowded.discard(stream)

    def drop(self, stream: Stream) -> None:
        """Close the stream; `lost` is not called."""
        self._forget(stream)
        stream.close()

    def _forget(self, stream: Stream) -> bool:
        """Attend to the stream no longer and close it; return whether it was attended to."""
        with self._lock:
            descriptor = stream.fileno()
            if self._streams.get(descriptor, (None,))[0] is not stream:
                return False
            del self._streams[descriptor]
            with contextlib.suppress(OSError):
                self._poll.unregister(descriptor)
            self._crowded.discard(stream)
            stream.close()
            return True

    def close(self) -> None:
        """Leave the graph, and end the threads. Again: do nothing."""
        if self._closed:
            return
        self.leave([*self.publishers, *self.subscribers, *self.servers])
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

    def _end(self) -> None:
        self.is_ended = True
        with contextlib.suppress(OSError):
            os.eventfd_write(self._wake, 1)

    def _where(self, topic: str, protocols: list[list[object]]) -> object:
        if topic not in self.publishers:
            raise HostFailure(self.name, f"does not publish {topic}", slug="ros1-header")
        if not any(protocol and protocol[0] == "TCPROS" for protocol in protocols):
            raise HostFailure(self.name, "speaks TCPROS only", slug="ros1-header")
        return ["TCPROS", LOOPBACK, self._door.port]

    def _connections(self) -> list[list[object]]:
        out = [(peer, "o", one.topic) for one in list(self.publishers.values()) for peer in one.peers]
        into = [(uri, "i", one.topic) for one in list(self.subscribers.values()) for uri in list(one.streams)]
        return [[k, other, way, "TCPROS", topic, True] for k, (other, way, topic) in enumerate(out + into)]

    def _update(self, topic: str, publishers: list[str]) -> int:
        subscriber = self.subscribers.get(topic)
        if subscriber is not None:
            subscriber.publishers = frozenset(publishers)
            threading.Thread(target=self._connect, args=(subscriber, publishers), daemon=True, name="ros1-join").start()
        return 0

    def _connect(self, subscriber: Subscriber, publishers: list[str]) -> None:
        """Connect with publishers; again, if one does not answer: a busy machine may keep it from that."""
        failed: set[str] = set()
        for _ in range(_TRIES):
            with subscriber.lock:
                publishers = [uri for uri in publishers if not self._is_connected(subscriber, uri, failed)]
            if not publishers:
                return
            time.sleep(_PAUSE)

    def _is_connected(self, subscriber: Subscriber, uri: str, failed: set[str]) -> bool:
        """Return whether nothing is left to do for this publisher, after trying; `failed` have been reported."""
        is_gone = uri not in subscriber.publishers or self.subscribers.get(subscriber.topic) is not subscriber
        if is_gone or self._closed or uri == self.uri or subscriber.is_heard(uri):
            return True
        try:
            self._listen(subscriber, uri)
        except HostFailure as failure:
            if uri not in failed:
                self._refused(f"{subscriber.topic}: no connection to the publisher at {uri}: {failure.rule}")
            failed.add(uri)
            return False
        return True

    def _listen(self, subscriber: Subscriber, uri: str) -> None:
        topic, kind = subscriber.topic, subscriber.kind
        found = ask(uri, "requestTopic", self.name, topic, [["TCPROS"]], within=WITHIN)
        if not (isinstance(found, list) and len(found) == 3 and found[0] == "TCPROS"):
            raise HostFailure(uri, f"must offer {topic} by TCPROS, but answers {found!r:.60}", slug="ros1-header")
        header = {"callerid": self.name, "topic": topic, "tcp_nodelay": "1", **kind.fields()}
        connection, theirs = opened(str(found[1]), int(found[2]), header)
        peer = theirs.get("callerid", "?")
        if subscriber.sender not in ("", peer):
            connection.close()
            whose = f"it belongs to {subscriber.sender}; it is not heard"
            self._refused(f"{topic}: {peer} publishes {_named(theirs)} there, but {whose}")
            return
        if not kind.agrees(theirs):
            connection.close()
            raise HostFailure(uri, f"carries {_named(theirs)}, not {kind.type}", slug="ros1-header")
        stream = Stream(connection, peer)
        subscriber.streams[uri] = stream
        definition = theirs.get("message_definition", "")
        subscriber.joined(Kind(theirs.get("type", ANY), theirs.get("md5sum", ANY), definition))

        def lost() -> None:
            if subscriber.streams.get(uri) is stream:
                del subscriber.streams[uri]
            subscriber.lost()

        self.attend(stream, lambda mark, data: subscriber.heard(data), lost)

    def _admit(self, connection: socket.socket, header: Mapping[str, str]) -> str:
        """Let the other end in, or return why not."""
        who = header.get("callerid", "?")
        if "topic" in header:
            publisher = self.publishers.get(header["topic"])
            if publisher is None:
                return f"{header['topic']}: {who} wants to hear it, but {self.name} does not publish it"
            if not publisher.kind.agrees(header):
                return f"{publisher.topic}: carries {publisher.kind.type}, but {who} wants {_named(header)}"
            publisher.admit(connection, who)
            return ""
        server = self.servers.get(header.get("service", ""))
        if server is None:
            return f"{header.get('service', 'a connection')}: {who} calls it, but {self.name} does not serve it"
        if not server.kind.agrees(header):
            return f"{server.service}: is {server.kind.type}, but {who} calls {_named(header)}"
        is_probe = header.get("probe") == "1"
        if not is_probe and server.client not in ("", who):
            return f"{server.service}: serves {server.client} only, but {who} calls it"
        write_header(connection, {"callerid": self.name, "service": server.service, **server.kind.fields()})
        if is_probe:
            connection.close()
            return ""
        stream = Stream(connection, who)

        def reply(data: bytes | None) -> None:
            refusal = data is None
            self.send(stream, b"the call failed" if data is None else data, mark=REFUSED if refusal else ANSWERED)

        self.attend(stream, lambda mark, data: server.asked(data, reply), lambda: None)
        return ""


def _named(header: Mapping[str, str]) -> str:
    return f"{header.get('type', 'something')} (md5 {header.get('md5sum', 'unknown')})"
