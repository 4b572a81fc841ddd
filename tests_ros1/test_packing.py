"""Values go into the same bytes as ROS's message classes write, and come back; other bytes are refused by name."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests_ros1.ros1_toys import Field

from parcours.errors import BadRequest
from parcours.run.hosts.ros1.messages import Messages, load
from parcours.run.hosts.ros1.packing import Packing
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.planner.wire import FORMS


@pytest.fixture(scope="module")
def messages(package: Path) -> Messages:
    return load(package)


def _values(channel: str, rng: np.random.Generator) -> tuple[Any, ...]:
    make: dict[str, Any] = {
        "float": lambda: float(rng.normal()),
        "int": lambda: int(rng.integers(-(2**63), 2**63)),
        "bool": lambda: bool(rng.integers(2)),
        "floats": lambda: rng.normal(size=rng.integers(5) * 7),
        "ints": lambda: rng.integers(-(2**63), 2**63, size=rng.integers(5) * 7),
    }
    return tuple(make[field.kind]() for field in FORMS[channel])


def test_the_bytes_are_those_of_the_message_classes_and_the_values_come_back(messages: Messages) -> None:
    rng = np.random.default_rng(5)
    for channel in [*messages.endpoints] * 20:
        packing, values, buffer = Packing(channel, FORMS[channel]), _values(channel, rng), BytesIO()
        messages.to_ros(channel, values).serialize(buffer)
        data = packing.pack(values)
        assert data == buffer.getvalue()
        back = packing.unpack(data)
        assert [type(value) for value in back] == [type(value) for value in values]
        for one, other in zip(back, values, strict=True):
            np.testing.assert_array_equal(one, other, strict=True)


def test_bytes_that_are_too_few_or_too_many_and_other_values_are_refused_with_the_channel() -> None:
    packing = Packing("news", [Field("a", "float"), Field("b", "floats"), Field("c", "bool")])
    data = packing.pack((1.0, [2.0, 3.0], True))
    assert packing.unpack(data)[::2] == (1.0, True)
    for wrong in [data[:cut] for cut in range(len(data))] + [data + b"\0", b"\xff" * len(data)]:
        with pytest.raises(BadRequest, match=rf"^channel 'news': {len(wrong)} bytes are no such message: .*ros1-bytes"):
            packing.unpack(wrong)
    for values in ((1.0, [2.0]), ("x", [2.0], True), (1.0, ["x"], True), (1.0, [[2.0], [3.0, 4.0]], True)):
        with pytest.raises(BadRequest, match=r"^channel 'news': .*ros1-bytes"):
            packing.pack(values)
    with pytest.raises(BadRequest, match="did you mean 'update'"):
        CODEC.decode("updat", b"")


def test_a_message_without_fields_is_no_bytes() -> None:
    assert Packing("tick", []).pack(()) == b""
    assert Packing("tick", []).unpack(b"") == ()
