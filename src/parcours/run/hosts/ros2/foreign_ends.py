"""The tester's ends on the graph of a foreign ROS 2 system: topics heard and published, services called.

An end of a topic is made as soon as the other end is discovered, since its quality (QoS) is matched to that one's.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from parcours.run.binding.graph import Quality
from parcours.run.binding.in_transit import Answered
from parcours.run.hosts.ros2.participant import matched_quality

if TYPE_CHECKING:
    from parcours.run.hosts.ros2.foreign_graph import Ros2Graph

_DEPTH = 1000
"""How many messages wait for the tester; a graph does not show the depth of the other end."""


def full_name(name: str, namespace: str) -> str:
    """Return the name of a node with its namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def short_type(type_: str) -> str:
    """Return `std_msgs/String` for `std_msgs/msg/String`."""
    package, _, name = type_.partition("/")
    return f"{package}/{name.rpartition('/')[2]}"


def _nanoseconds(duration: Any) -> int | None:
    value = int(duration.nanoseconds)
    return None if value <= 0 or value >= (1 << 63) - 1_000_000_000 else value


def quality_of(profile: Any) -> Quality:
    """Return the quality that an end found on the graph asks for or offers."""
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy

    return Quality(
        profile.reliability != ReliabilityPolicy.BEST_EFFORT, profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        _nanoseconds(profile.deadline), profile.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC,
        _nanoseconds(profile.liveliness_lease_duration),
    )  # fmt: skip


class TopicEnd(ABC):
    """The tester's end of a topic; it is made when the other end is known."""

    def __init__(self, graph: Ros2Graph, topic: str, type_: str) -> None:
        self._graph, self.topic, self.type = graph, topic, type_
        self._participant, self._name = graph.at(topic)
        self._made: Any = None

    def looks(self) -> bool:
        """Make the end if it can be made by now; return whether it is there."""
        if self._made is None:
            self._made = self._make()
        return self._made is not None

    @abstractmethod
    def _make(self) -> Any: ...

    @abstractmethod
    def _theirs(self) -> list[Any]: ...

    @abstractmethod
    def _matched(self) -> int: ...

    def _fitting(self) -> list[Any]:
        return [one for one in self._theirs() if short_type(one.topic_type) == self.type]

    @property
    def peers(self) -> set[str]:
        """The nodes at the other end, once all of them are connected."""
        if not self.looks():
            return set()
        theirs = self._fitting()
        return (
            {full_name(one.node_name, one.node_namespace) for one in theirs}
            if 0 < len(theirs) <= self._matched()
            else set()
        )


class Listener(TopicEnd):
    """A topic that is heard, in the quality that its publishers offer."""

    def __init__(self, graph: Ros2Graph, topic: str, type_: str, heard: Callable[[bytes], None]) -> None:
        super().__init__(graph, topic, type_)
        self._heard = heard

    def _theirs(self) -> list[Any]:
        return self._graph.published(self.topic)

    def _make(self) -> Any:
        theirs = [quality_of(one.qos_profile) for one in self._fitting()]
        if not theirs:
            return None
        weakest = Quality(all(one.reliable for one in theirs), all(one.latched for one in theirs))
        kind = self._graph.known.find(self.type)
        return self._participant.overhear(kind, self._name, self._heard, matched_quality(weakest, _DEPTH))

    def _matched(self) -> int:
        return int(self._made.speakers)


class PublishedTopic(TopicEnd):
    """A topic that is published: as the sender offers it whose messages are passed on, else as it is requested."""

    def __init__(self, graph: Ros2Graph, topic: str, type_: str, queue: int, latch: bool, like: str) -> None:
        super().__init__(graph, topic, type_)
        self._queue, self._latch, self._like = queue, latch, like
        self._last: bytes | None = None

    def _theirs(self) -> list[Any]:
        return self._graph.subscribed(self.topic)

    def _make(self) -> Any:
        theirs = self._fitting()
        models = self._graph.published(self._like) if self._like else []
        if not theirs or (self._like and not models):
            return None
        quality = (
            quality_of(models[0].qos_profile) if models else _strictest(quality_of(one.qos_profile) for one in theirs)
        )
        if self._latch:
            quality = Quality(quality.reliable, True, quality.deadline, quality.manual, quality.lease)
        depth = self._queue if quality.latched else max(self._queue, _DEPTH)
        kind = self._graph.known.find(self.type)
        made = self._participant.node.create_publisher(kind, self._name, matched_quality(quality, depth))
        if self._last is not None:
            made.publish(self._last)
        return made

    def _matched(self) -> int:
        return int(self._made.get_subscription_count())

    @property
    def peers(self) -> set[str]:
        """The same; while the sender whose messages are passed on is not there, who will hear them."""
        if self._like and not self.looks() and not self._graph.published(self._like):
            return {full_name(one.node_name, one.node_namespace) for one in self._fitting()}
        return super().peers

    def send(self, data: bytes) -> int:
        """Publish; a latched message waits for its first reader."""
        if self.looks():
            self._made.publish(data)
        elif self._latch:
            self._last = data
        return 0

    def close(self) -> None:
        """Publish no longer."""
        if self._made is not None:
            self._participant.node.destroy_publisher(self._made)


def _strictest(requested: Iterable[Quality]) -> Quality:
    """Return what satisfies all requests. What is offered reliably reaches those, too, who do not ask for that."""
    every = list(requested)
    deadlines, leases = ([getattr(one, name) for one in every if getattr(one, name)] for name in ("deadline", "lease"))
    return Quality(True, any(one.latched for one in every), min(deadlines, default=None),
                   any(one.manual for one in every), min(leases, default=None))  # fmt: skip


class ServiceCaller:
    """A client of a service; answers that come late go nowhere."""

    def __init__(self, graph: Ros2Graph, service: str, kind: Any) -> None:
        self._graph, self._kind = graph, kind
        self._waiting: dict[int, Answered] = {}
        participant, name = graph.at(service)
        self._client = participant.inquire(kind, name, self._answer)

    def _answer(self, number: int, response: Any) -> None:
        answered = self._waiting.pop(number, None)
        if answered is not None:
            answered(self._graph.types.packed(response), "")

    @property
    def is_matched(self) -> bool:
        """Whether the server is there."""
        return bool(self._client.service_is_ready())

    def ask(self, data: bytes, answered: Answered) -> None:
        """Call; `answered` gets the response, or None and why there is none."""
        try:
            request = self._graph.types.unpacked_as(self._kind.Request, data)
        except Exception as error:  # corrupted on purpose, or by its sender
            answered(None, f"the request cannot be read: {error}")
            return
        self._waiting[self._client.handle.send_request(request)] = answered

    def abandon(self, answered: Answered) -> None:
        """Wait no longer for a response."""
        for number in [number for number, one in self._waiting.items() if one is answered]:
            del self._waiting[number]
