"""What recordings of either format consist of: topics with the text of their message definition, and messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal, Protocol

from parcours.errors import BadRequest, BadResults

Format = Literal["mcap", "bag"]

LONGEST = 1 << 28
"""No record of a recording is longer [bytes]; whatever a file says about its lengths, no more is read at once."""

CHUNK = 1 << 19
"""A chunk is written to the file as soon as it holds this much [bytes]."""

CHUNK_SPAN = 250_000_000
"""A chunk spans no more of the run's time [ns]: so much is lost if the writer is killed."""


@dataclass(frozen=True, slots=True)
class Topic:
    """Where messages of one type pass.

    Attributes:
        name: e.g. /obstacles.
        type: ROS 1 name of the messages' type, e.g. nav_msgs/Odometry.
        md5: of the definition, as ROS computes it; 32 hexadecimal digits.
        definition: the whole text, with the definitions of the types it uses as ROS appends them.
        latched: its last message is shown to whoever comes later.
    """

    name: str
    type: str
    md5: str
    definition: str
    latched: bool = False


@dataclass(frozen=True, slots=True)
class Raw:
    """A message of a type that Parcours does not know, serialised by ROS 1: recorded and read as it is.

    Attributes:
        type, md5, definition: as in Topic.
        content: the serialised message.
    """

    type: str
    md5: str
    definition: str
    content: bytes


class Writer(Protocol):
    """Writes messages to a file of one format, chunk by chunk."""

    def write(self, topic: Topic, time: int, content: bytes) -> None:
        """Write a message of the topic at the time [ns since the epoch]."""

    def remark(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a remark outside all topics, if the format has such."""

    def flush(self) -> None:
        """Let the file hold everything written so far."""

    def close(self) -> None:
        """Write the index; the file is whole."""


class Reader(Protocol):
    """Reads the messages of a file of one format, in the order of the file, without trust in its index."""

    cut: str
    """Why the file is not whole, known once all messages are read; empty if it is."""

    def messages(self) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield (topic, time [ns since the epoch], content).

        Raises:
            BadResults: the file is damaged.
        """


def damaged(where: str, what: str) -> BadResults:
    """Return the complaint that a recording says what makes no sense."""
    return BadResults(
        where,
        f"a recording's records agree with each other, but {what}",
        "the file is damaged: copy it again, or run the case again",
        slug="recording-damaged",
    )


def too_large(where: str, given: int, most: int) -> BadResults:
    """Return the complaint that more is to be read than allowed [bytes]."""
    return BadResults(
        where,
        f"at most {most} bytes are read, but there are {given}",
        "give a greater limit if the file is sound, or cut it into pieces with its own tools",
        slug="recording-too-large",
    )


def put(file: BinaryIO, content: bytes) -> None:
    """Write all of the content, also to a file without buffer, which may take less at once."""
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]


def taken(file: BinaryIO, n: int, where: str) -> bytes:
    """Return the next n bytes.

    Raises:
        BadResults: n is more than is ever read at once, or the file has become shorter since it was measured.
    """
    if n > LONGEST:
        raise too_large(where, n, LONGEST)
    content = file.read(n)
    if len(content) != n:
        raise damaged(where, "it became shorter while it was read")
    return content


def require_time(where: str, time: int, most: int) -> None:
    """Raise BadRequest unless the time [ns since the epoch] can be written."""
    if not 0 <= time < most:
        raise BadRequest(
            where,
            f"its times lie from 0 up to {most} ns since the epoch, but {time} ns was given",
            "give times since the begin of the run, and when it began",
            slug="recording-time",
        )


def format_of(path: Path) -> Format:
    """Return the format that a file's name asks for.

    Raises:
        BadRequest: it ends neither in .mcap nor in .bag.

    >>> format_of(Path("run.bag"))
    'bag'
    """
    match path.suffix:
        case ".mcap":
            return "mcap"
        case ".bag":
            return "bag"
    raise BadRequest(
        str(path), "a recording ends in .mcap or .bag, but this name does not", "name it so", slug="recording-suffix"
    )
