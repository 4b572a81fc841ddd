"""What recordings of either format consist of: topics with the text of their message definition, and messages."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

from parcours.errors import BadRequest
from parcours.run.recording.source import ByteSource

Format = Literal["mcap", "bag"]
Encoding = Literal["ros1", "cdr"]

CHUNK = 1 << 19
"""A chunk is written to the file as soon as it holds this much [bytes]."""

CHUNK_SPAN = 250_000_000
"""A chunk spans no more of the run's time [ns]: at most this is lost if the writer is killed."""

BAG_MAGIC = b"#ROSBAG V2.0\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True, slots=True)
class Topic:
    """Where messages of one type pass.

    Attributes:
        name: e.g. /obstacles.
        type: ROS name of the messages' type, e.g. nav_msgs/Odometry, or nav_msgs/msg/Odometry of ROS 2.
        md5: of the definition, as ROS 1 computes it, 32 hexadecimal digits; empty on ROS 2.
        definition: the whole text, with the definitions of the types it uses as ROS appends them.
        latched: its last message is shown to late subscribers.
        encoding: how its messages are serialised: by ROS 1, or as CDR by ROS 2.
    """

    name: str
    type: str
    md5: str
    definition: str
    latched: bool = False
    encoding: Encoding = "ros1"


@dataclass(frozen=True, slots=True)
class Raw:
    """A message of a type that Parcours does not know, serialised by ROS: recorded and read as it is.

    Attributes:
        type, md5, definition, encoding: as in Topic.
        content: the serialised message.
    """

    type: str
    md5: str
    definition: str
    content: bytes
    encoding: Encoding = "ros1"


Message = tuple[Topic, int, bytes]
"""Where it passes, when [ns since the epoch], and its bytes."""


class TopicWriter(ABC):
    """Writes messages to a file of one format, chunk by chunk.

    Args:
        file: empty, open for writing, seekable; closed with the writer.
        where: its name, for complaints.
    """

    latest: int
    """No time that the format can hold is later [ns since the epoch]."""

    def __init__(self, file: BinaryIO, where: str) -> None:
        self._file, self._where = file, where
        self._known: dict[Topic, Any] = {}
        self._first: int | None = None

    def write(self, topic: Topic, time: int, content: bytes) -> None:
        """Write a message of the topic at the time [ns since the epoch].

        Raises:
            BadRequest: the time cannot be written.
        """
        self.require_time(time)
        if self._first is not None and time - self._first > CHUNK_SPAN:
            self.flush()
        self._first = time if self._first is None else min(self._first, time)
        if topic not in self._known:
            self._known[topic] = self._declared(topic)
        self._add(self._known[topic], time, content)

    def require_time(self, time: int) -> None:
        """Raise BadRequest unless the time [ns since the epoch] can be written."""
        if not 0 <= time < self.latest:
            rule = f"its times lie from 0 up to {self.latest} ns since the epoch, but {time} ns was given"
            remedy = "give times since the start of the run, and when it started"
            raise BadRequest(self._where, rule, remedy, slug="recording-time")

    def flush(self) -> None:
        """Let the file hold everything written so far, as a chunk of its own."""
        self._first = None
        self._end_chunk()

    @abstractmethod
    def close(self) -> None:
        """Write the index and close the file, which is then whole."""

    def remark(self, name: str, entries: Mapping[str, str]) -> None:  # noqa: B027 (bags have no remarks)
        """Write a remark outside all topics, if the format has such."""

    @abstractmethod
    def _declared(self, topic: Topic) -> Any: ...

    @abstractmethod
    def _add(self, known: Any, time: int, content: bytes) -> None: ...

    @abstractmethod
    def _end_chunk(self) -> None: ...


def open_writer(form: Format, file: BinaryIO, where: str, encoding: Encoding = "ros1") -> TopicWriter:
    """Return what writes a recording to an empty file; Parcours' own messages, too, in the encoding given.

    Raises:
        BadRequest: a bag holds messages of ROS 1 only.
    """
    if form == "mcap":  # imported here: most runs are not recorded, and the libraries cost a tenth of a second each
        from parcours.run.recording.mcap import McapWriter

        return McapWriter(file, where, encoding)
    if encoding != "ros1":
        raise no_bag(where)
    from parcours.run.recording.bag import BagWriter

    return BagWriter(file, where)


def no_bag(where: str) -> BadRequest:
    """Return the complaint that messages of ROS 2 cannot be written to a bag of ROS 1."""
    rule = "a ROS 1 bag holds messages of ROS 1, but these are of ROS 2"
    return BadRequest(where, rule, "record MCAP", slug="recording-encoding")


def messages(source: ByteSource, form: Format) -> Iterator[Message]:
    """Yield the messages of a recording in the order of the file, without trust in its index.

    Raises:
        CutOff: after the last whole message of a file that is not whole.
        BadResults: the file is damaged, or its messages are not of ROS 1.
    """
    if form == "mcap":
        from parcours.run.recording.mcap import mcap_messages

        return mcap_messages(source)
    from parcours.run.recording.bag import bag_messages

    return bag_messages(source)


def format_of(path: Path) -> Format:
    """Return the format that a file's name asks for.

    Raises:
        BadRequest: it ends neither in .mcap nor in .bag.

    >>> format_of(Path("run.bag"))
    'bag'
    """
    if path.suffix == ".mcap":
        return "mcap"
    if path.suffix == ".bag":
        return "bag"
    rule = "a recording ends in .mcap or .bag, but this name does not"
    raise BadRequest(str(path), rule, "name it so", slug="recording-suffix")
