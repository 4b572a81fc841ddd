"""The tester on the graph of a foreign ROS 2 system (`hosts.foreign.graph`).

Every run gets a participant of its own: what a killed process has left behind is known to older ones for as long as its
lease. Ends of topics are made as soon as the other end is discovered, since their quality (QoS) is matched to it.
"""

from __future__ import annotations

import contextlib
import os
import select
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from parcours.errors import BadRequest, HostFailure, one_of
from parcours.run.binding import Binding, RegisteredGraph
from parcours.run.binding.domains import at_home, domains, parted, within
from parcours.run.binding.graph import Quality
from parcours.run.binding.schema import LIVES
from parcours.run.binding.slots import ProcessSlot
from parcours.run.binding.structure import Value
from parcours.run.hosts.graph_line import Reply
from parcours.run.hosts.interfaces import TESTER
from parcours.run.hosts.ros2.foreign_ends import (
    Listener,
    PublishedTopic,
    ServiceCaller,
    TopicEnd,
    full_name,
    quality_of,
    short_type,
)
from parcours.run.hosts.ros2.foreign_types import Ros2Types
from parcours.run.hosts.ros2.participant import Ros2Participant
from parcours.run.hosts.ros2.transport import claim, occupied
from parcours.run.hosts.scheduling import real_time
from parcours.run.recording import Raw

_LOOK = 10_000_000
"""How often to look for the other ends that are not there yet [ns]."""

_PIECE = 5_000_000
"""The longest wait in one piece [ns]: in between, descriptors are looked at."""

_CHANGES = {("unconfigured", True): "configure", ("inactive", True): "activate", ("active", False): "deactivate",
            ("inactive", False): "cleanup"}  # fmt: skip
"""The next transition of a lifecycle node, by its state and whether it goes up."""

_LISTEN = 600_000_000
"""For how long to listen for nodes that are there already [ns]: discovery takes some 0.15 s."""

_ANSWER = 1.0
"""How long a node may take to answer a question about its parameters [s]."""


class Ros2Graph:
    """The tester's node on the domain of the environment, and on each that the binding names.

    Raises:
        HostFailure: there is no rclpy, or another tester is on the domain.
        BadRequest: a parameter belongs to no node of the binding.
    """

    label = "ros2"
    ending = 2.0
    participant: Ros2Participant

    def __init__(self, binding: Binding) -> None:
        self.known = Ros2Types(binding)
        self.types = self.known.types
        self.refusals: list[str] = []
        self.environment: Mapping[str, str] = {}
        self.binding = binding
        self._parameters: dict[str, Value] = {}
        self._published: dict[str, PublishedTopic] = {}
        self._listeners: list[Listener] = []
        self._callers: dict[str, ServiceCaller] = {}
        self._served: set[str] = set()
        self._looked = 0
        self._is_new = True
        self._poll = select.poll()
        self._watched: dict[int, Callable[[], None]] = {}
        self._closing = contextlib.ExitStack()
        self._participant: Ros2Participant | None = None
        self._domains: dict[int | None, Ros2Participant] = {}
        self._join()
        for one in self._domains.values():
            self._closing.enter_context(claim(one.domain, TESTER[1:]))

    def _join(self) -> None:
        with real_time():  # the middleware's threads inherit it
            self.participant = self._participant = own = Ros2Participant(TESTER[1:])
            self.binding = at_home(self.binding, own.domain)
            self._domains = {None: own}
            for one in sorted(domains(self.binding)):
                self._domains[one] = Ros2Participant(TESTER[1:], one, own)
        self.environment = {name: os.environ[name] for name in os.environ if name.startswith(("ROS_", "FASTDDS_"))}
        self.environment = {**self.environment, "ROS_DOMAIN_ID": str(self.participant.domain)}
        if self.known.built is not None:
            paths = (str(self.known.built), os.environ.get("PYTHONPATH", ""))
            self.environment = {**self.environment, "PYTHONPATH": os.pathsep.join(filter(None, paths))}

    def close(self) -> None:
        """Leave the graph."""
        if self._participant is not None:
            self._participant.close()
            self._participant = None
        self._closing.close()

    def renew(self) -> None:
        """Join the graph again, unless nothing has been done on it yet."""
        self.refusals.clear()
        if self._is_new:
            self._is_new = False
            return
        for table in (self._published, self._listeners, self._callers, self._served):
            table.clear()
        self.participant.close()
        self._join()

    def at(self, name: str) -> tuple[Ros2Participant, str]:
        """Return the participant on the domain of a name, and the name there."""
        plain, domain = parted(name)
        return self._domains[domain], plain

    # Ends.

    def publish(self, topic: str, type_: str, *, queue: int, latch: bool, like: str = "") -> PublishedTopic:
        """Publish a topic as soon as somebody listens."""
        end = self._published.get(topic)
        if end is None:
            end = self._published[topic] = PublishedTopic(self, topic, type_, queue, latch, like)
        return end

    def subscribe(self, topic: str, type_: str, heard: Callable[[bytes], None]) -> Listener:
        """Call `heard` with each message of a topic."""
        end = Listener(self, topic, type_, heard)
        self._listeners.append(end)
        return end

    def serve(self, service: str, type_: str, asked: Callable[[bytes, Reply], None]) -> None:
        """Call `asked` with each request; who is refused hears nothing, since ROS 2 knows no refusal."""
        if service not in self._served:
            self._served.add(service)
            participant, name = self.at(service)
            participant.serve_any(self._service(type_), name, asked, self.types)

    def call(self, service: str, type_: str) -> ServiceCaller:
        """Return what calls a service."""
        if service not in self._callers:
            self._callers[service] = ServiceCaller(self, service, self._service(type_))
        return self._callers[service]

    def leave(self, topic: str) -> None:
        """Publish a topic no longer."""
        end = self._published.pop(topic, None)
        if end is not None:
            end.close()

    def knows_service(self, type_: str) -> bool:
        """Return whether a service's type is known."""
        return self.known.service(type_) is not None

    def _service(self, type_: str) -> Any:
        kind = self.known.service(type_)
        if kind is None:
            raise HostFailure(type_, "a service's type must be known, but is not", slug="unknown-message-type")
        return kind

    # The thread that waits.

    def spin(self, until: int) -> bool:
        """Hear what arrives before the monotonic clock shows `until` [ns]; return whether anything happened."""
        while True:
            self._look()
            heard = False
            for descriptor, _ in self._poll.poll(0):
                if descriptor in self._watched:
                    self._watched[descriptor]()
                    heard = True
            left = until - time.perf_counter_ns()
            if self.participant.spin(time.perf_counter_ns() + max(0, min(left, 0 if heard else _PIECE))) or heard:
                return True
            if left <= 0:
                return False

    def _look(self) -> None:
        now = time.perf_counter_ns()
        if now - self._looked >= _LOOK:
            self._looked = now
            ends: tuple[TopicEnd, ...] = (*self._published.values(), *self._listeners)
            for end in ends:
                end.looks()

    def watch(self, descriptor: int, ready: Callable[[], None]) -> None:
        """Call `ready`, in the thread that spins, whenever the descriptor can be read."""
        self._watched[descriptor] = ready
        self._poll.register(descriptor, select.POLLIN)

    def unwatch(self, descriptor: int) -> None:
        """Watch it no longer."""
        if self._watched.pop(descriptor, None) is not None:
            self._poll.unregister(descriptor)

    # Who is there.

    def published(self, topic: str) -> list[Any]:
        """Return who publishes a topic."""
        participant, name = self.at(topic)
        return _others(participant.node.get_publishers_info_by_topic(name))

    def subscribed(self, topic: str) -> list[Any]:
        """Return who subscribes to a topic."""
        participant, name = self.at(topic)
        return _others(participant.node.get_subscriptions_info_by_topic(name))

    def state(self, services: Collection[str] = ()) -> RegisteredGraph:
        """Return who is there without the tester, with the types of everything."""
        types: dict[str, str] = {}
        publishers: dict[str, list[str]] = {}
        subscribers: dict[str, list[str]] = {}
        offered: dict[str, dict[str, Quality]] = {}
        requested: dict[str, dict[str, Quality]] = {}
        topics = [within(topic, domain) for domain, one in self._domains.items()
                  for topic, _ in one.node.get_topic_names_and_types()]  # fmt: skip
        for topic in topics:
            for found, names, qualities in (
                (self.published(topic), publishers, offered), (self.subscribed(topic), subscribers, requested),
            ):  # fmt: skip
                if found:
                    names[topic] = sorted({full_name(one.node_name, one.node_namespace) for one in found})
                    qualities[topic] = {
                        full_name(one.node_name, one.node_namespace): quality_of(one.qos_profile) for one in found
                    }
                    types[topic] = short_type(found[0].topic_type)
        servers: dict[str, list[str]] = {}
        counts: Counter[str] = Counter()
        for domain, one in self._domains.items():
            for name, space in _nodes(one):
                counts[within(full_name(name, space), domain)] += 1
                with contextlib.suppress(Exception):  # it may have gone meanwhile: rclpy has its own error for that
                    for plain, kinds in one.node.get_service_names_and_types_by_node(name, space):
                        service = within(plain, domain)
                        servers.setdefault(service, []).append(full_name(name, space))
                        types[service] = short_type(kinds[0])
        twice = sorted(name for name, count in counts.items() if count > 1)
        return RegisteredGraph(publishers, subscribers, servers, types, offered, requested, twice)

    def require_alone(self) -> None:
        """Raise HostFailure if nodes are there already; those with names of the binding are looked at later."""
        until = time.perf_counter_ns() + _LISTEN
        while time.perf_counter_ns() < until:
            self.spin(until)
        for domain, one in self._domains.items():
            own = {node.ros_node for node in self.binding.nodes if node.domain == domain}
            if strangers := sorted({full_name(*name) for name in _nodes(one)} - own):
                raise occupied(one.domain, strangers)

    def answers(self, node: str) -> bool:
        """Return whether a node is on the graph; one that was killed is, until its lease is over."""
        if self._participant is None:
            return False
        participant, name = self.at(node)
        return any(full_name(*one) == name for one in _nodes(participant))

    def forget(self, node: str) -> None:
        """Do nothing: the next run's participant will not hear of it."""

    # Parameters: each belongs to a node, /planner/speed to /planner.

    def declare(self, values: Mapping[str, Value]) -> None:
        """Note what nodes are started with."""
        names = sorted({node.ros_node for node in self.binding.nodes if node.ros_node})
        for key in values:
            node = key.rpartition("/")[0]
            if node not in names:
                rule = f"a parameter must be a node's on ROS 2, but no node of the binding is called {node or '/'}"
                where = self.binding.source or self.binding.name
                remedy = one_of(node, names) or "give the node its 'ros_node'"
                raise BadRequest(f"{where}: parameter {key}", rule, remedy, slug="binding-parameter")
        self._parameters = dict(values)

    def arguments(self, slot: ProcessSlot) -> tuple[str, ...]:
        """Return a slot's remappings, and the parameters that its node has in the binding."""
        own = slot.node.ros_node
        given = [(key.rpartition("/")[2], value) for key, value in self._parameters.items() if _owner(key) == own]
        words = slot.arguments("ros2")
        if not given:
            return words
        node = slot.ros_node.rpartition("/")[2]
        settings = tuple(word for name, value in given for word in ("-p", f"{node}:{name}:={_yaml(value)}"))
        return (*(words or ("--ros-args",)), *settings)

    def parameter(self, key: str) -> Any:
        """Return the value of a parameter; None if it is not set, or its node does not answer."""
        from rcl_interfaces.srv import GetParameters

        request = GetParameters.Request(names=[parted(_name(key))[0]])
        answer = self._inquired(key, GetParameters, "get_parameters", request)
        return None if answer is None or not answer.values else _plain(answer.values[0])

    def set_parameter(self, key: str, value: Value) -> None:
        """Set a parameter. Raises HostFailure if its node does not answer, or refuses."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        given = Parameter(parted(_name(key))[0], value=list(value) if isinstance(value, tuple) else value)
        request = SetParameters.Request(parameters=[given.to_parameter_msg()])
        answer = self._inquired(key, SetParameters, "set_parameters", request)
        why = "its node does not answer" if answer is None else answer.results[0].reason or "its node refuses"
        if answer is None or not answer.results[0].successful:
            raise HostFailure(f"parameter {key}", f"must be set to {value!r:.60}, but {why}", slug="foreign-step")

    def lead(self, node: str, state: str) -> bool:
        """Lead a lifecycle node towards a state; return whether it is in it. Raises HostFailure if it refuses."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState, GetState

        name, domain = parted(node)
        key = within(f"{name}/", domain)
        while (answer := self._inquired(key, GetState, "get_state", GetState.Request())) is not None:
            now = answer.current_state.label
            if now == state or now not in LIVES:  # it is there, or on its way
                return bool(now == state)
            change = _CHANGES[now, LIVES.index(state) > LIVES.index(now)]
            number = getattr(Transition, f"TRANSITION_{change.upper()}")
            request = ChangeState.Request(transition=Transition(id=number))
            done = self._inquired(key, ChangeState, "change_state", request)
            if done is not None and not done.success:
                rule = f"must become {state}, but from {now} it refuses to {change}"
                raise HostFailure(f"node {node}", rule, "look into its output", slug="foreign-step")
        return False

    def _inquired(self, key: str, kind: Any, service: str, request: Any) -> Any:
        """Return a node's answer; None if there is none in time."""
        answers: list[Any] = []
        name, domain = parted(key)
        owner = _owner(name)
        if domain is None:
            there = [one.domain for one in self.binding.nodes if one.ros_node == owner]
            domain = None if None in there or not there else there[0]
        participant, asked = self._domains[domain], f"{owner}/{service}"
        client = participant.inquire(kind, asked, lambda number, answer: answers.append(answer))
        until, is_sent = time.perf_counter_ns() + int(_ANSWER * 1e9), False
        try:
            while not answers and time.perf_counter_ns() < until:
                if not is_sent and client.service_is_ready():
                    client.handle.send_request(request)
                    is_sent = True
                self.spin(time.perf_counter_ns() + _PIECE)
        finally:
            participant.forget(client)
        return answers[0] if answers else None

    def kind(self, type_: str) -> Raw | None:
        """Return an empty message of a type, as recordings name it."""
        return self.known.kind(type_)


def _nodes(participant: Ros2Participant) -> list[tuple[str, str]]:
    return [
        (str(name), str(space)) for name, space in participant.node.get_node_names_and_namespaces()
        if full_name(name, space) != TESTER
    ]  # fmt: skip


def _others(found: Iterable[Any]) -> list[Any]:
    return [one for one in found if full_name(one.node_name, one.node_namespace) != TESTER]


def _owner(key: str) -> str:
    return key.rpartition("/")[0]


def _name(key: str) -> str:
    return key.rpartition("/")[2]


def _yaml(value: Value) -> str:
    """Return a value as a command line gives it to a node.

    >>> _yaml((1.0, 2.0)), _yaml(True), _yaml("map")
    ('[1.0, 2.0]', 'true', "'map'")
    """
    if isinstance(value, tuple):
        return f"[{', '.join(_yaml(one) for one in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"'{value}'" if isinstance(value, str) else repr(value)


def _plain(value: Any) -> Any:
    from rclpy.parameter import parameter_value_to_python

    found = parameter_value_to_python(value)
    return list(found) if isinstance(found, list | tuple) or hasattr(found, "tolist") else found
