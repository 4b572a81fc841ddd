"""A replay: what it refuses, the data that a page plays, and the picture that stands for it on paper."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.pieces import Page, Section
from parcours_navigation.study.replay import Replay, embedded, steps
from parcours_navigation.study.replay_picture import animation, moments, stays, still


def run(title: str = "case", n: int = 41, halted_from: int = 20) -> Replay:
    """A robot that goes up the diagonal and halts, past an obstacle that comes down the side."""
    times = np.linspace(0.0, 2.0, n)
    x = np.minimum(times, times[halted_from])
    return Replay(
        title, title, times, x, x, np.full(n, 0.785), np.arange(n) >= halted_from,
        np.full((n, 1), 1.6), 2.0 - times[:, None], 0.125, (0.1,), (2.0, 2.0), (2.0, 2.0), 0.2,
    )  # fmt: skip


def test_a_page_holds_the_still_the_data_and_the_player() -> None:
    document = to_html(Page("p", "", (), (Section("s", "", (animation(run()),)),)))
    assert embedded(run()) in document and "ResizeObserver" in document
    assert still(run()).partition(">")[2] in document


def test_a_replays_data_holds_no_word_of_its_author() -> None:
    assert embedded(run("</script>")) == embedded(run("case"))


def test_embedded_numbers_are_the_recorded_ones_to_half_a_millimetre() -> None:
    replay = run()
    record = json.loads(embedded(replay))
    for key, values in (("x", replay.x), ("y", replay.y), ("h", replay.heading), ("t", replay.times)):
        assert np.abs(np.cumsum(record[key]) / 1000 - values).max() <= 0.5e-3 + 1e-12
    assert np.abs(np.cumsum(record["oy"][0]) / 1000 - replay.obstacle_y[:, 0]).max() <= 0.5e-3 + 1e-12


def test_the_least_clearance_is_that_of_the_run_not_of_its_rounded_copy() -> None:
    replay = run()
    at, least = json.loads(embedded(replay))["least"]
    assert least == pytest.approx(replay.clearance().min(), abs=0.5e-4)
    assert replay.clearance()[at] == replay.clearance().min()


@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=200))
def test_steps_do_not_add_up_rounding_errors(values: list[float]) -> None:
    array = np.array(values)
    assert np.abs(np.cumsum(steps(array, 1000)) - array * 1000).max() <= 0.5 + 1e-6


@given(st.lists(st.booleans(), min_size=2, max_size=60))
def test_halts_say_exactly_when_the_robot_was_held(held: list[bool]) -> None:
    n = len(held)
    zero, times = np.zeros(n), np.linspace(0.0, 1.0, n)
    replay = Replay(
        "t", "", times, zero, zero, zero, np.array(held), np.zeros((n, 0)), np.zeros((n, 0)),
        0.1, (), (1.0, 1.0), (1.0, 1.0), 0.1,
    )  # fmt: skip
    changes = json.loads(embedded(replay))["halts"]
    assert [sum(change <= i for change in changes) % 2 == 1 for i in range(n)] == held


def test_a_still_shows_each_second_and_the_last_sample() -> None:
    replay = run(n=41)
    assert [replay.times[i] for i in moments(replay)] == pytest.approx([0.0, 1.0, 2.0])
    assert stays(replay.x, replay.y, moments(replay)) == [(0, 0), (20, 40)]
    picture = still(replay)
    assert "1–2 s" in picture
    assert picture.count("var(--c0") > 0, "a halted robot has the colour of halts"


@pytest.mark.parametrize(
    ("field", "value", "slug"),
    [
        ("x", np.zeros(3), "replay-shape"),
        ("obstacle_x", np.zeros((41, 2)), "replay-shape"),
        ("y", np.full(41, np.nan), "replay-values"),
        ("times", np.zeros(41), "replay-values"),
        ("robot_radius", 0.0, "replay-values"),
        ("arena", (2.0, -1.0), "replay-values"),
        ("goal", (np.inf, 0.0), "replay-values"),
    ],
)
def test_a_replay_that_cannot_be_drawn_is_refused(field: str, value: object, slug: str) -> None:
    good = run()
    fields = {name: getattr(good, name) for name in Replay.__slots__}
    with pytest.raises(BadRequest, match=rf"replay 'case': .*\[{slug}\]"):
        Replay(**{**fields, field: value})


def test_clearance_is_the_gap_between_the_edges() -> None:
    replay = run()
    assert replay.clearance()[0] == pytest.approx(np.hypot(1.6, 2.0) - 0.225)
