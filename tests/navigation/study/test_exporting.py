"""Replays as files for other tools, and beside each other."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image

from parcours.errors import BadRequest
from parcours.report.exporting import export, together
from parcours.report.pieces import Page, Section, Text
from parcours_navigation.study.replay import Replay, StandingThings
from parcours_navigation.study.replay_picture import animation

TIMES = np.linspace(0.0, 4.0, 81)
REPLAY = Replay(
    "case/1", "reached", TIMES, 0.5 + TIMES / 2, np.full(81, 1.0), np.zeros(81), TIMES > 3.9, np.full((81, 1), 2.0),
    np.full((81, 1), 1.8), 0.2, (0.3,), (3.0, 2.0), (2.6, 1.0), 0.2,
)  # fmt: skip


def page(*pieces: object) -> Page:
    return Page("case/1", "reached", (), (Section("Replay", "", pieces),))  # type: ignore[arg-type]


def test_a_gif_shows_the_robot_where_it_is_and_lasts_half_the_time(tmp_path: Path) -> None:
    export(page(animation(REPLAY)), tmp_path / "new/case.gif")
    with Image.open(tmp_path / "new/case.gif") as film:
        assert film.n_frames == 21  # type: ignore[attr-defined]
        scale = 480 / (3.0 + 2 * 0.36)
        for frame, halted in ((0, False), (20, True)):
            film.seek(frame)
            x = 0.5 if frame == 0 else 2.5
            at = ((x - 0.1 + 0.36) * scale, (2.0 - 1.0 + 0.36) * scale)  # behind the centre: ahead is its nose
            red, _, blue = film.convert("RGB").getpixel((round(at[0]), round(at[1])))  # type: ignore[misc]
            assert (red > blue) == halted


def test_an_mcap_holds_every_sample_as_scene_robot_and_clearance(tmp_path: Path) -> None:
    export(page(animation(REPLAY)), tmp_path / "case.mcap")
    said: dict[str, list[dict[str, object]]] = {}
    with (tmp_path / "case.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None and (channel.topic != "/scene" or schema.name == "foxglove.SceneUpdate")
            said.setdefault(channel.topic, []).append(json.loads(message.data))
    assert {topic: len(all_of) for topic, all_of in said.items()} == {"/scene": 81, "/robot": 81, "/clearance": 81}
    assert [one["value"] for one in said["/clearance"]] == REPLAY.clearance().tolist()
    assert said["/robot"][40]["x"] == 1.5 and said["/robot"][40]["speed"] == pytest.approx(0.5)
    last = {one["id"]: one for one in said["/scene"][-1]["entities"]}  # type: ignore[attr-defined]
    assert last["robot"]["cylinders"][0]["pose"]["position"]["x"] == 2.5 and set(last) == {"robot", "others"}


KINDS = {"number": int | float, "integer": int, "boolean": bool, "string": str, "array": list, "object": dict}


def keeps(schema: Mapping[str, Any], value: Any) -> bool:
    """Return whether a value has the type that a JSON schema names, and its fields, all of them and no other."""
    if not isinstance(value, KINDS[schema["type"]]) or isinstance(value, bool) != (schema["type"] == "boolean"):
        return False
    if isinstance(value, list):
        return all(keeps(schema["items"], one) for one in value)
    if not isinstance(value, dict):
        return True
    fields = schema["properties"]
    return set(schema["required"]) == set(value) == set(fields) and all(keeps(fields[k], value[k]) for k in value)


def test_messages_of_an_mcap_keep_to_their_schemas_in_the_order_of_their_times(tmp_path: Path) -> None:
    wall, disc = np.array([[0.0, 0.0, 1.0, 1.0]]), np.array([[1.0, 1.0, 0.2]])
    ground = StandingThings(wall, disc, np.full(81, 0.5), np.zeros((0, 2)))
    export(page(animation(dataclasses.replace(REPLAY, ground=ground))), tmp_path / "case.mcap")
    with (tmp_path / "case.mcap").open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    times = [message.log_time for _, _, message in found]
    assert times == sorted(times) == [message.publish_time for _, _, message in found] and times[-1] == 4 * 10**9
    for schema, channel, message in found:
        assert schema is not None and schema.encoding == "jsonschema" and channel.message_encoding == "json"
        assert keeps(json.loads(schema.data), json.loads(message.data)), (channel.topic, message.log_time)
    scene = next(json.loads(schema.data) for schema, channel, _ in found if schema and channel.topic == "/scene")
    assert not keeps(scene, {"deletions": [], "entities": [{}]}) and not keeps(scene, {"deletions": []})


def test_a_still_has_colours_that_every_program_knows(tmp_path: Path) -> None:
    export(page(animation(REPLAY)), tmp_path / "case.svg")
    text = (tmp_path / "case.svg").read_text()
    assert text.startswith("<svg xmlns") and "var(" not in text and "#0072b2" in text


def test_what_a_page_cannot_give_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=r"must end in \.gif or \.mcap or \.svg, but ends in '\.mp4'"):
        export(page(animation(REPLAY)), tmp_path / "case.mp4")
    for wrong in (lambda: export(page(Text("words")), tmp_path / "a.svg"), lambda: together([page(Text("words"))])):
        with pytest.raises(BadRequest, match="replay-export"):
            wrong()
