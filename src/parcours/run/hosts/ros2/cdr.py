"""Converts bytes to a serialised `std_msgs/msg/UInt8MultiArray` (OMG CDR) and back, without a message object.

rclpy publishes and takes serialised messages as they are; its message objects cost more than all else that it does.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from parcours.errors import BadRequest

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little endian
_ALIGNMENT = 4


def writer(label: str) -> Callable[[bytes], bytes]:
    """Return what puts bytes into a message of one dimension that has this label.

    >>> message = writer("Odometry")(b"xyz")
    >>> len(message), read(message)
    (43, b'xyz')
    """
    name = label.encode() + b"\x00"
    name += bytes(-len(name) % _ALIGNMENT)
    front = _HEADER + struct.pack("<II", 1, len(label.encode()) + 1) + name
    rest = struct.Struct("<IIII")  # size and stride of the dimension, offset of the data, and how many they are

    def write(data: bytes) -> bytes:
        return front + rest.pack(len(data), len(data), 0, len(data)) + data

    return write


def read(message: bytes) -> bytes:
    """Return the data of a message, whatever its dimensions.

    Raises:
        BadRequest: these bytes are no such message.

    >>> read(b"?")
    Traceback (most recent call last):
    parcours.errors.BadRequest: ROS 2 message: must be a std_msgs/msg/UInt8MultiArray, but 1 byte came; let nobody \
else publish on the transport's topics [ros2-message]
    """
    try:
        number = struct.Struct("<I" if message[1] & 1 else ">I").unpack_from
        (dimensions,) = number(message, 4)
        at = 8
        for _ in range(dimensions):
            (length,) = number(message, at)
            at += 4 + length + -length % _ALIGNMENT + 8
        offset, size = number(message, at)[0], number(message, at + 4)[0]
        data = message[at + 8 : at + 8 + size]
    except (IndexError, struct.error) as error:
        raise _foreign(message) from error
    if len(data) < size or offset > size:
        raise _foreign(message)
    return data[offset:]


def _foreign(message: bytes) -> BadRequest:
    size = "1 byte" if len(message) == 1 else f"{len(message)} bytes"
    rule = f"must be a std_msgs/msg/UInt8MultiArray, but {size} came"
    return BadRequest("ROS 2 message", rule, "let nobody else publish on the transport's topics", slug="ros2-message")
