"""The serialised form that is written by hand is the one that rclpy makes of a message object."""

from __future__ import annotations

import pytest

from parcours.errors import BadRequest
from parcours.run.hosts.ros2.cdr import read, writer


@pytest.mark.parametrize("label", ["", "a", "abc", "abcd", "Odometry", "Überholung"])
@pytest.mark.parametrize("size", [0, 1, 2, 3, 4, 1000])
def test_what_one_writes_the_other_reads(label: str, size: int) -> None:
    from rclpy.serialization import deserialize_message, serialize_message
    from std_msgs.msg import MultiArrayDimension, MultiArrayLayout, UInt8MultiArray

    data = bytes(k % 256 for k in range(size))
    dimension = MultiArrayDimension(label=label, size=size, stride=size)
    message = UInt8MultiArray(layout=MultiArrayLayout(dim=[dimension]), data=data)
    assert deserialize_message(writer(label)(data), UInt8MultiArray) == message
    assert read(bytes(serialize_message(message))) == data


def test_a_message_with_other_dimensions_is_read_too() -> None:
    from rclpy.serialization import serialize_message
    from std_msgs.msg import MultiArrayDimension, MultiArrayLayout, UInt8MultiArray

    dimensions = [MultiArrayDimension(label=label, size=1, stride=1) for label in ("x", "yy", "zzz")]
    for layout in (MultiArrayLayout(), MultiArrayLayout(dim=dimensions, data_offset=2)):
        message = serialize_message(UInt8MultiArray(layout=layout, data=b"..data"))
        assert read(bytes(message)) == b"..data"[layout.data_offset :]


def test_a_message_cut_short_is_refused_wherever_it_is_cut() -> None:
    whole = writer("Odometry")(b"0123456789")
    for size in range(len(whole)):
        with pytest.raises(BadRequest, match="ros2-message"):
            read(whole[:size])
