"""Files of tracks: what is read, and what is said of those that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.others.tracks import Tracks, read_tracks
from parcours_navigation.protocol import Floats


def test_tracks_are_read_by_agent_in_the_order_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "walk.csv"
    file.write_text("t, agent, x, y, note\n0, b, 1, 2, here\n0.5,a,0,0,\n\n0.4,b,1.5,2,\n", encoding="utf-8")
    tracks = read_tracks(file)
    assert tracks.names == ("b", "a")
    assert tracks.rows[0].tolist() == [[0.0, 1.0, 2.0], [0.4, 1.5, 2.0]]
    assert tracks.fastest == pytest.approx(1.25)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("agent,t,x\na,0,0\n", r"walk.csv:1: columns must be agent, t, x, y, but y is missing from"),
        ("", r"walk.csv:1: columns must be agent, t, x, y, but agent, t, x, y is missing from the first line"),
        ("agent,t,x,y\n", r"walk.csv: a file of tracks must have a row, but has none"),
        ("agent,t,x,y\na,0,0,0\na,0,1,1\n", r"walk.csv:3: times of an agent must increase, but 0 s of 'a' follows 0 s"),
        ("agent,t,x,y\na,0,zero,0\n", r"walk.csv:2: x must be a number from -1e\+06 to 1e\+06, but is 'zero'"),
        ("agent,t,x,y\na,nan,0,0\n", r"walk.csv:2: t must be a number"),
        ("agent,t,x,y\na,0,0,1e9\n", r"walk.csv:2: y must be a number"),
        ("agent,t,x,y\na,0,0\n", r"walk.csv:2: a row must have 4 columns like the first line, but has 3"),
        ('agent,t,x,y\n"a,0,0,0\n', r"walk.csv:2: it must be CSV, but"),
    ],
)
def test_a_bad_file_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "walk.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadRequest, match=rf"{message}.*\[others-track\]"):
        read_tracks(file)


def test_what_is_no_text_or_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "picture.csv").write_bytes(b"\xff\xfe\x00\x01")
    for name in ("picture.csv", "missing.csv"):
        with pytest.raises(BadRequest, match=r"a file of tracks must be (readable|UTF-8 text).*\[others-track\]"):
            read_tracks(tmp_path / name)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (np.zeros((0, 3)), "a track must have rows"),
        (np.zeros((2, 2)), "a track must have rows"),
        (np.array([[0.0, np.inf, 0.0]]), "every number must be finite"),
        (np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), "times must increase, but 0.5 s follows 1 s"),
    ],
)
def test_tracks_given_as_arrays_are_checked_too(rows: Floats, message: str) -> None:
    with pytest.raises(BadRequest, match=rf"tracks, agent 'a': {message}.*\[others-track\]"):
        Tracks(("a",), (rows,))
