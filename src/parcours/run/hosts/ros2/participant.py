"""A node of a ROS 2 graph that sends and hears bytes in standard messages and services.

A topic carries `std_msgs/msg/UInt8MultiArray`, a service `diagnostic_msgs/srv/AddDiagnostics`: of the standard service
types it is the one whose request and response are both free text. rclpy's executors make a new wait set, timer and
tasks for each callback, and wait busily while an answer is held back; this waits on one set, and answers at any time.
"""

from __future__ import annotations

import binascii
import contextlib
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from parcours.errors import HostFailure
from parcours.run.binding.domains import LAST_DOMAIN
from parcours.run.binding.graph import Quality
from parcours.run.binding.message_types import MessageTypes
from parcours.run.hosts.graph_line import Answered, Reply
from parcours.run.hosts.ros2.cdr import read, writer

DEPTH = 10_000
"""How many messages wait for a reader that is slow, or frozen, before the oldest are lost."""

_SETTINGS = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("profiles.xml")),
}
"""Defaults for the environment: the graph stays on this machine, and losses are made good at once."""

_CHUNK = 20_000_000
"""The longest wait in one piece [ns]: Python hears of signals in between."""

Heard = Callable[[bytes], None]


class Ros2Participant:
    """A node of the graph, in a context of its own.

    Raises HostFailure if rclpy is not there, or there is no such domain.

    Args:
        name: of the node.
        domain: the graph's number; that of the environment, or 0, if not given.
        beside: one on another domain, which from now on hears for this one, too, when it spins; it closes both.
    """

    def __init__(self, name: str, domain: int | None = None, beside: Ros2Participant | None = None) -> None:
        for variable, value in _SETTINGS.items():
            os.environ.setdefault(variable, value)
        require_rclpy()
        import rclpy
        from rclpy.context import Context
        from rclpy.node import Node
        from rclpy.signals import SignalHandlerOptions

        number = _checked(os.environ.get("ROS_DOMAIN_ID") or 0 if domain is None else domain)
        self.domain = number
        self._context: Any = Context()
        rclpy.init(args=[], context=self._context, domain_id=number, signal_handler_options=SignalHandlerOptions.NO)
        self.node: Any = Node(name, context=self._context, use_global_arguments=False, enable_rosout=False,
                              start_parameter_services=False)  # fmt: skip
        self._takers: dict[str, list[tuple[Any, Callable[[], bool]]]] = {
            "subscription": [],
            "client": [],
            "service": [],
        }
        self._set: Any = None
        self._beside: list[Ros2Participant] = []
        self._listening = self if beside is None else beside
        if beside is not None:
            beside._beside.append(self)

    is_ended = False
    """No tool of a ROS 2 graph orders nodes to end."""

    frame_kind = "frames"

    def publish(self, topic: str, kind: str, peer: str = "") -> Ros2Publisher:
        """Publish a topic whose messages are called `kind`."""
        from std_msgs.msg import UInt8MultiArray

        return Ros2Publisher(self.node.create_publisher(UInt8MultiArray, topic, _quality()), writer(kind))

    def subscribe(self, topic: str, kind: str, heard: Heard, peer: str = "", *,
                  lost: Callable[[], None] = lambda: None) -> Subscription:  # fmt: skip
        """Call `heard` with the bytes of each message. A graph does not report ends: `lost` is never called."""
        from std_msgs.msg import UInt8MultiArray

        return self.overhear(UInt8MultiArray, topic, lambda message: heard(read(message)), _quality())

    # Frames that are sent together travel in one message: a message costs as much as its content.

    def wrap(self, frames: Sequence[bytes]) -> list[bytes]:
        """Return one message with all these frames."""
        return [msgspec.msgpack.encode([msgspec.Raw(frame) for frame in frames])]

    def unwrap(self, message: bytes) -> list[bytes]:
        """Return the frames of a message."""
        return [bytes(frame) for frame in msgspec.msgpack.decode(message, type=list[msgspec.Raw])]

    def overhear(self, kind: Any, topic: str, heard: Heard, quality: Any) -> Subscription:
        """Call `heard` with each message of any type, serialised."""
        subscription = self.node.create_subscription(kind, topic, lambda message: None, quality, raw=True)

        def take() -> bool:
            taken = subscription.handle.take_message(kind, True)
            if taken is None:
                return False
            heard(taken[0])
            return True

        self._add("subscription", subscription, take)
        return Subscription(subscription)

    def serve(self, service: str, kind: str, asked: Callable[[bytes, Reply], None], peer: str = "") -> None:
        """Call `asked` with the bytes of each request, and with what answers it, now or later, at most once."""
        from diagnostic_msgs.srv import AddDiagnostics

        server = self.node.create_service(
            AddDiagnostics, service, lambda request, answer: answer, qos_profile=_quality()
        )

        def take() -> bool:
            request, header = server.handle.service_take_request(AddDiagnostics.Request)
            if header is None:
                return False
            asked(_bytes(request.load_namespace), reply_to(header))
            return True

        def reply_to(header: Any) -> Reply:
            def reply(data: bytes | None) -> None:
                text = "" if data is None else _text(data)
                server.send_response(AddDiagnostics.Response(success=data is not None, message=text), header)

            return reply

        self._add("service", server, take)

    def serve_any(self, kind: Any, service: str, asked: Callable[[bytes, Reply], None], types: MessageTypes) -> None:
        """Call `asked` with the bytes of each request of a service of any type; who is refused hears nothing."""
        server = self.node.create_service(kind, service, lambda request, answer: answer, qos_profile=_quality())

        def take() -> bool:
            request, header = server.handle.service_take_request(kind.Request)
            if header is None:
                return False

            def reply(data: bytes | None) -> None:
                if data is not None:
                    with contextlib.suppress(Exception):  # bytes that were corrupted on purpose are no answer
                        server.send_response(types.unpacked_as(kind.Response, data), header)

            asked(types.packed(request), reply)
            return True

        self._add("service", server, take)

    def call(self, service: str, kind: str = "") -> Ros2Client:
        """Return what calls a service."""
        from diagnostic_msgs.srv import AddDiagnostics

        waiting: dict[int, Answered] = {}

        def taken(number: int, answer: Any) -> None:
            answered = waiting.pop(number)
            answered(*((_bytes(answer.message), "") if answer.success else (None, "declined")))

        client = self.inquire(AddDiagnostics, service, taken)
        return Ros2Client(client, lambda data: AddDiagnostics.Request(load_namespace=_text(data)), waiting)

    def inquire(self, kind: Any, service: str, answered: Callable[[int, Any], None]) -> Any:
        """Return a client of a service of any type; `answered` gets the number of each request and its response."""
        client = self.node.create_client(kind, service, qos_profile=_quality())

        def take() -> bool:
            header, answer = client.handle.take_response(kind.Response)
            if header is None:
                return False
            answered(header.request_id.sequence_number, answer)
            return True

        self._add("client", client, take)
        return client

    def _add(self, kind: str, entity: Any, take: Callable[[], bool]) -> None:
        self._listening._takers[kind].append((entity.handle, take))  # a wait set takes what is of other contexts, too
        self._listening._set = None

    def forget(self, client: Any) -> None:
        """Ask no more."""
        takers = self._listening._takers
        takers["client"] = [one for one in takers["client"] if one[0] is not client.handle]
        self._listening._set = None
        self.node.destroy_client(client)

    def spin(self, until: int | None) -> bool:
        """Hear what has arrived, or what arrives before the monotonic clock shows `until` [ns], if not None.

        Returns:
            whether anything was heard.
        """
        while True:
            left = _CHUNK if until is None else max(0, until - time.perf_counter_ns())
            if self._hear(min(left, _CHUNK)):
                return True
            if left == 0:
                return False

    def _hear(self, left: int) -> bool:
        if not any(self._takers.values()):  # rcl refuses to wait for nothing
            time.sleep(left * 1e-9)
            return False
        waiting = self._ready_set()
        waiting.wait(left)
        heard = False
        for kind, takers in self._takers.items():
            ready = waiting.get_ready_entities(kind)
            for handle, take in takers:
                if handle.pointer in ready:
                    while take():
                        heard = True
        return heard

    def _ready_set(self) -> Any:
        subscriptions, clients, services = self._takers.values()
        if self._set is None:
            from rclpy.impl.implementation_singleton import rclpy_implementation

            self._set = rclpy_implementation.WaitSet(len(subscriptions), 0, 0, len(clients), len(services), 0,
                                                     self._context.handle)  # fmt: skip
        self._set.clear_entities()
        for handle, _ in subscriptions:
            self._set.add_subscription(handle)
        for handle, _ in clients:
            self._set.add_client(handle)
        for handle, _ in services:
            self._set.add_service(handle)
        return self._set

    def flush(self, peer: str) -> None:
        """Do nothing: the middleware sends in threads of its own."""

    def close(self) -> None:
        """Leave the graph. Again: do nothing."""
        for one in self._beside:
            one.close()
        self._set = None
        for takers in self._takers.values():
            takers.clear()
        with contextlib.suppress(Exception):
            self.node.destroy_node()
        self._context.try_shutdown()


class Ros2Publisher:
    """A publisher of bytes."""

    def __init__(self, publisher: Any, write: Callable[[bytes], bytes]) -> None:
        self._publisher, self._write = publisher, write

    def send(self, *messages: bytes) -> None:
        """Publish."""
        for data in messages:
            self._publisher.publish(self._write(data))

    @property
    def is_matched(self) -> bool:
        """Whether somebody listens."""
        return bool(self._publisher.get_subscription_count())


class Subscription:
    """A topic that is heard."""

    def __init__(self, subscription: Any) -> None:
        self._subscription = subscription

    @property
    def is_matched(self) -> bool:
        """Whether somebody publishes."""
        return self.speakers > 0

    @property
    def speakers(self) -> int:
        """How many publish."""
        return int(self._subscription.get_publisher_count())


class Ros2Client:
    """A client of a service; `waiting` are the calls that have no response yet, by number."""

    def __init__(self, client: Any, request: Callable[[bytes], Any], waiting: dict[int, Answered]) -> None:
        self._client, self._request, self._waiting = client, request, waiting

    def ask(self, data: bytes, answered: Answered) -> None:
        """Send a request, without waiting for the response."""
        self._waiting[self._client.handle.send_request(self._request(data))] = answered

    @property
    def is_matched(self) -> bool:
        """Whether the service is there."""
        return bool(self._client.service_is_ready())


def _checked(domain: int | str) -> int:
    """Return the number of a domain; the middleware ends the process that asks for another."""
    try:
        if 0 <= int(domain) <= LAST_DOMAIN:
            return int(domain)
    except ValueError:
        pass
    rule = f"domains are numbered 0 to {LAST_DOMAIN}, but {domain!r} was given"
    raise HostFailure("ROS 2 host", rule, "set ROS_DOMAIN_ID", slug="ros2-domain")


def require_rclpy() -> None:
    """Raise HostFailure if rclpy cannot be imported."""
    try:
        import rclpy.node  # noqa: F401
    except ImportError as error:
        where = f"ROS 2 module {error.name or 'rclpy'!r}"
        rule = f"must be importable, but {sys.executable} does not find it: {error}"
        remedy = (
            "install ros-DISTRO-rclpy and ros-DISTRO-common-interfaces (Ubuntu), source /opt/ros/DISTRO/setup.bash, "
            "and use an interpreter that sees Parcours, too; docs/ros2.md tells of wheels"
        )
        raise HostFailure(where, rule, remedy, slug="ros2-missing") from error


def matched_quality(quality: Quality, depth: int) -> Any:
    """Return what rclpy calls a quality."""
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

    times = {"deadline": quality.deadline, "liveliness_lease_duration": quality.lease}
    return QoSProfile(
        depth=depth, history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE if quality.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.latched else DurabilityPolicy.VOLATILE,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if quality.manual else LivelinessPolicy.AUTOMATIC,
        **{name: Duration(nanoseconds=time) for name, time in times.items() if time is not None},
    )  # fmt: skip


def _quality() -> Any:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(depth=DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.VOLATILE)  # fmt: skip


def _text(data: bytes) -> str:
    return binascii.b2a_base64(data, newline=False).decode("ascii")


def _bytes(text: str) -> bytes:
    return binascii.a2b_base64(text)
