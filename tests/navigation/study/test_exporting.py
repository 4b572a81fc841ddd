"""Replays as files for other tools, and beside each other."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image

from parcours.errors import BadRequest
from parcours.report.exporting import export, together
from parcours.report.pieces import Page, Section, Text
from parcours_navigation.study.replay import Replay
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
