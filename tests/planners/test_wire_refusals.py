"""What is no message of RAMP, or none of its channel: refused by name, and with nothing but BadRequest."""

from __future__ import annotations

import functools
import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_ramp.planner.messages import (
    MAX_KNOTS,
    MAX_LEGS,
    MAX_PIECES,
    MODIFICATION,
    OBSTACLE_STATE,
    PATH,
    POSE,
    PREDICTION,
    TRAJECTORY,
    EvaluationRequest,
    EvaluationResponse,
    ModificationRequest,
    ModificationResponse,
    Obstacles,
    StateReport,
    Tag,
    TrajectoryRequest,
    TrajectoryResponse,
    many,
    one,
)
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.route import HYBRID, ROUTE
from parcours_ramp.planner.trajectory_generator import generate
from parcours_ramp.planner.wire import FORMS, VERSION, decode, encode, flatten, restore

TAG = Tag("sensing", 3)


def patched(values: NDArray[Any], at: int, value: Any) -> NDArray[Any]:
    other = values.copy()
    other[at] = value
    return other


HOSTILE: list[tuple[str, str, Any, str]] = [
    # channel, field, what is put there instead or a function of what was there, and the rule that refuses it
    ("update", "x", math.nan, "wire-finite"),
    ("update", "x", math.inf, "wire-finite"),
    ("update", "x", 1, "wire-kind"),
    ("update", "x", "1.0", "wire-kind"),
    ("update", "x", None, "wire-kind"),
    ("update", "stamp", 1.0, "wire-kind"),
    ("update", "stamp", True, "wire-kind"),
    ("update", "stamp", 2**63, "wire-range"),
    ("imminent_collision", "imminent", 1, "wire-kind"),
    ("speed_limit", "limit", math.nan, "wire-finite"),
    ("cmd_vel", "v", -math.inf, "wire-finite"),
    ("obstacles", "states", lambda v: v[:-1], "wire-counts"),
    ("obstacles", "states", lambda v: patched(v, 4, math.nan), "wire-finite"),
    ("obstacles", "states", np.zeros(6 * 1001), "wire-counts"),
    ("obstacles", "states", 0.0, "wire-kind"),
    ("obstacles", "states", [[0.0] * 6], "wire-kind"),
    ("trajectory_request", "cycle", 3, "wire-range"),
    ("trajectory_request", "cycle", -1, "wire-range"),
    ("trajectory_request", "for_obstacles", True, "wire-counts"),
    ("trajectory_request", "states", np.zeros(6), "wire-counts"),
    ("trajectory_request", "stamp", 9, "wire-range"),
    ("trajectory_request", "kinds", lambda v: v + 3, "wire-range"),
    ("trajectory_request", "kinds", lambda v: v[:-1], "wire-counts"),
    ("trajectory_request", "starts", lambda v: v[:-5], "wire-counts"),
    ("trajectory_request", "path_counts", lambda v: patched(v, 0, MAX_KNOTS + 1), "wire-counts"),
    ("trajectory_request", "path_counts", lambda v: patched(v, 0, v[0] + 1), "wire-counts"),
    ("trajectory_request", "path_counts", lambda v: patched(v, 0, 1), "wire-counts"),
    ("trajectory_request", "path_counts", lambda v: patched(v, 0, -1), "wire-counts"),
    ("trajectory_request", "path_x", lambda v: v[1:], "wire-counts"),
    ("trajectory_response", "for_obstacles", True, "wire-counts"),
    ("trajectory_response", "trajectory_counts", lambda v: np.tile(v, 20), "wire-counts"),
    ("trajectory_response", "trajectory_counts", lambda v: v[:-1], "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: np.tile(v, 2), "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: v[:0], "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: patched(v, 0, 502), "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: patched(v, 1, MAX_PIECES + 1), "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: patched(v, 1, v[1] - 1), "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: patched(v, 2, MAX_LEGS + 1), "wire-counts"),
    ("best_trajectory", "trajectory_counts", lambda v: patched(v, 2, -(2**63)), "wire-counts"),
    ("best_trajectory", "pieces", lambda v: patched(v, 3, math.nan), "wire-finite"),
    ("best_trajectory", "pieces", lambda v: v[:-21], "wire-counts"),
    ("best_trajectory", "piece_kinds", lambda v: v[:-1], "wire-counts"),
    ("best_trajectory", "piece_kinds", lambda v: v.astype(float).tolist(), "wire-kind"),
    ("best_trajectory", "legs", lambda v: patched(v, 1, math.inf), "wire-finite"),
    ("best_trajectory", "legs", lambda v: v[:-8], "wire-counts"),
    ("best_trajectory", "knot_times", lambda v: v[:-8], "wire-counts"),
    ("best_trajectory", "trajectory_slacks", lambda v: patched(v, 0, math.nan), "wire-finite"),
    ("best_trajectory", "trajectory_values", lambda v: patched(v, 1, math.nan), "wire-finite"),
    ("evaluation_request", "prediction_counts", lambda v: patched(v, 0, 122), "wire-counts"),
    ("evaluation_request", "prediction_straights", lambda v: np.zeros_like(v), "wire-range"),
    ("evaluation_request", "prediction_straights", lambda v: v * math.nan, "wire-finite"),
    ("evaluation_request", "prediction_y", lambda v: v[1:], "wire-counts"),
    ("evaluation_request", "window_first", -1, "wire-range"),
    ("evaluation_request", "window_first", 10**10, "wire-range"),
    ("evaluation_request", "window_last", 2**62, "wire-range"),
    ("evaluation_request", "windowed", False, "wire-range"),
    ("evaluation_response", "fitness", lambda v: v[1:], "wire-counts"),
    ("evaluation_response", "t_collision", lambda v: v[:0], "wire-counts"),
    ("evaluation_response", "feasible", np.zeros(17, np.int64), "wire-counts"),
    ("modification_request", "operator", 6, "wire-range"),
    ("modification_request", "path_counts", lambda v: patched(v, 0, 1), "wire-counts"),
    ("modification_request", "path_counts", lambda v: v[:1], "wire-counts"),
    ("modification_response", "path_counts", lambda v: patched(v, 0, 0), "wire-counts"),
]


@functools.cache
def base(channel: str) -> Any:
    """Return a payload of the channel in which every part that can be damaged is there."""
    paths, starts, trajectories, state = many(PATH, 2), many(POSE, 2), many(TRAJECTORY, 2), one(OBSTACLE_STATE)
    predictions = many(PREDICTION, 2)
    for k in range(2):
        paths[k].n, paths[k].x[:3], paths[k].y[:3] = 3, (0.0, 1.0, 2.0), (0.0, 0.2 + k, 2.0)
        generate(paths[k], starts[k], HYBRID, guarded().record(), one(ROUTE), trajectories[k])
        state.pose.v, state.pose.w, state.radius = 0.3, 0.5 * k, 0.2
        predict(state, 7, predictions[k])
    modification = one(MODIFICATION)
    modification.first, modification.operator = paths[0], 2
    seen = Obstacles(5, np.array([state, state], OBSTACLE_STATE).view(np.recarray))
    payloads: dict[str, Any] = {
        "odometry": seen,
        "obstacles": seen,
        "trajectory_request": TrajectoryRequest(TAG, paths, starts, np.array([0, 2])),
        "trajectory_response": TrajectoryResponse(TAG, trajectories),
        "evaluation_request": EvaluationRequest(
            TAG, trajectories, predictions, (0.0, 0.1), 0.2, True, (5, 1, 31, 0.025, True)
        ),
        "evaluation_response": EvaluationResponse(TAG, np.array([1, 0]), np.array([0.1, 0.2]), np.array([9999.0, 3.0])),
        "modification_request": ModificationRequest(TAG, modification),
        "modification_response": ModificationResponse(TAG, paths),
        "best_trajectory": trajectories[0],
        "update": StateReport(3, one(POSE), 4),
        "imminent_collision": True,
        "speed_limit": 0.1,
        "pose": StateReport(3, one(POSE)),
        "cmd_vel": (0.1, -0.2),
    }
    return payloads[channel]


def raw(value: Any) -> Any:
    return value.tobytes() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize(("channel", "name", "change", "slug"), HOSTILE)
def test_a_value_that_its_form_does_not_allow_is_refused_by_the_name_of_its_field(
    channel: str, name: str, change: Any, slug: str
) -> None:
    values = list(flatten(channel, base(channel)))
    restore(channel, values)
    place = [field.name for field in FORMS[channel]].index(name)
    values[place] = change(values[place]) if callable(change) else change
    with pytest.raises(BadRequest) as refused:
        decode(channel, msgspec.msgpack.encode([VERSION, channel, *map(raw, values)]))
    assert refused.value.slug == slug
    assert repr(channel) in refused.value.where
    assert name in str(refused.value)


def test_a_refusal_says_which_field_what_it_takes_and_what_was_given() -> None:
    values = list(flatten("cmd_vel", (0.25, 0.5)))
    with pytest.raises(BadRequest) as refused:
        restore("cmd_vel", [values[0], math.nan])
    assert str(refused.value) == (
        "message on channel 'cmd_vel', field 'w': must be finite, but nan was given; "
        "send what `parcours_ramp.planner.wire.FORMS` says [wire-finite]"
    )


ENVELOPES: list[tuple[bytes, str]] = [
    (b"", "wire-bytes"),
    (b"\xc1", "wire-bytes"),
    (b"\x94\x01", "wire-bytes"),
    (b"\xdd\xff\xff\xff\xff", "wire-bytes"),
    (b"\x91" * 100_000, "wire-bytes"),
    (b"\x94" + b"\x91" * 100_000, "wire-bytes"),
    (msgspec.msgpack.encode({"v": 0.1, "w": 0.2}), "wire-kind"),
    (msgspec.msgpack.encode(None), "wire-kind"),
    (msgspec.msgpack.encode([]), "wire-fields"),
    (msgspec.msgpack.encode([VERSION, "cmd_vel"]), "wire-fields"),
    (msgspec.msgpack.encode([VERSION, "cmd_vel", 0.1]), "wire-fields"),
    (msgspec.msgpack.encode([VERSION, "cmd_vel", 0.1, 0.2, 0.3]), "wire-fields"),
    (msgspec.msgpack.encode([VERSION + 1, "cmd_vel", 0.1, 0.2]), "wire-version"),
    (msgspec.msgpack.encode([VERSION + 1, "cmd_vel", 0.1, 0.2, 0.3]), "wire-version"),
    (msgspec.msgpack.encode(["1", "cmd_vel", 0.1, 0.2]), "wire-kind"),
    (msgspec.msgpack.encode([VERSION, "twist", 0.1, 0.2]), "wire-channel"),
    (msgspec.msgpack.encode([VERSION, "update", 0.1]), "wire-channel"),
    (msgspec.msgpack.encode([VERSION, b"cmd_vel", 0.1, 0.2]), "wire-kind"),
    (msgspec.msgpack.encode([VERSION, "cmd_vel", 0.1, [0.2]]), "wire-kind"),
    (msgspec.msgpack.encode([VERSION, "cmd_vel", 0.1, msgspec.msgpack.Ext(5, b"12345678")]), "wire-kind"),
    (b"\x94\x01\xa7cmd_ve\xff" + b"\xcb" + bytes(8) + b"\xcb" + bytes(8), "wire-bytes"),
    (encode("cmd_vel", (0.1, 0.2)) + b"\x00", "wire-bytes"),
    (encode("cmd_vel", (0.1, 0.2))[:-1], "wire-bytes"),
]


@pytest.mark.parametrize(("data", "slug"), ENVELOPES)
def test_bytes_that_are_no_message_of_the_channel_are_refused_with_the_reason(data: bytes, slug: str) -> None:
    with pytest.raises(BadRequest) as refused:
        decode("cmd_vel", data)
    assert refused.value.slug == slug
    assert "'cmd_vel'" in refused.value.where


def test_an_unknown_channel_is_refused_by_all_and_the_nearest_named() -> None:
    for call in (
        lambda: flatten("cmd_val", (0.0, 0.0)),
        lambda: restore("cmd_val", []),
        lambda: decode("cmd_val", b""),
    ):
        with pytest.raises(BadRequest, match=r"did you mean 'cmd_vel'.*\[wire-channel\]"):
            call()


@pytest.mark.parametrize(
    ("channel", "payload"),
    [
        ("cmd_vel", (0.1,)),
        ("cmd_vel", (1, 2)),
        ("speed_limit", "0.1"),
        ("imminent_collision", 1),
        ("update", one(POSE)),
        ("update", StateReport(0, one(OBSTACLE_STATE))),
        ("obstacles", Obstacles(0, many(POSE, 2))),
        ("best_trajectory", one(POSE)),
        ("trajectory_request", TrajectoryRequest(TAG)),
        ("trajectory_request", TrajectoryRequest(TAG, many(PATH, 1), many(POSE, 1), np.zeros(1, np.int64),
                                                 Obstacles(0, many(OBSTACLE_STATE, 0)))),
        ("trajectory_response", TrajectoryResponse(TAG, many(POSE, 1))),
        ("evaluation_response", TrajectoryResponse(TAG, many(TRAJECTORY, 1))),
        ("evaluation_response", EvaluationResponse(Tag("sleeping", 1), np.zeros(0, np.int64), np.zeros(0),  # type: ignore[arg-type]
                                                   np.zeros(0))),
    ],
)  # fmt: skip
def test_a_payload_that_does_not_belong_on_the_channel_is_not_sent(channel: str, payload: object) -> None:
    with pytest.raises(BadRequest) as refused:
        encode(channel, payload)
    assert refused.value.slug == "wire-payload"


def outcome(channel: str, data: bytes) -> str:
    """Return what became of the bytes; what is taken must be a message that is the same again."""
    try:
        payload = decode(channel, data)
    except BadRequest as refused:
        assert refused.slug.startswith("wire-")
        return refused.slug
    again = encode(channel, payload)
    assert encode(channel, decode(channel, again)) == again
    return "taken"


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(sorted(FORMS)), st.binary(max_size=200))
def test_any_bytes_are_taken_or_refused(channel: str, data: bytes) -> None:
    outcome(channel, data)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(FORMS)), st.data())
def test_a_damaged_message_is_taken_or_refused(channel: str, data: st.DataObject) -> None:
    message = bytearray(encode(channel, base(channel)))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, min(len(message), 160) - 1))
        match data.draw(st.sampled_from(["set", "cut", "put"])):
            case "set":
                message[at] = data.draw(st.integers(0, 255))
            case "cut":
                del message[at : at + data.draw(st.integers(1, 9))]
            case _:
                message[at:at] = data.draw(st.binary(max_size=9))
        if not message:
            break
    outcome(channel, bytes(message))


INTS = st.sampled_from([0, 1, 2, 3, -1, 8, 9, 121, 501, 2**31, -(2**63), 2**63 - 1, 2**64 - 1]) | st.integers(-9, 9)
FLOATS = st.floats()
ANY = (
    INTS
    | FLOATS
    | st.booleans()
    | st.none()
    | st.text(max_size=3)
    | st.binary(max_size=24)
    | st.lists(INTS, max_size=3)
)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(FORMS)), st.data())
def test_any_values_in_the_place_of_others_are_taken_or_refused(channel: str, data: st.DataObject) -> None:
    values: list[Any] = [raw(value) for value in flatten(channel, base(channel))]
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(values) - 1))
        kind = FORMS[channel][place].kind
        width = FORMS[channel][place].width
        arrays = st.lists(INTS.filter(lambda n: n < 2**63), max_size=3 * width).map(
            lambda v: np.array(v, np.int64).tobytes()
        )
        numbers = st.lists(FLOATS, max_size=3 * width).map(lambda v: np.array(v).tobytes())
        fitting = {"int": INTS, "float": FLOATS, "bool": st.booleans(), "ints": arrays, "floats": numbers}[kind]
        values[place] = data.draw(fitting | ANY)
    outcome(channel, msgspec.msgpack.encode([VERSION, channel, *values]))
