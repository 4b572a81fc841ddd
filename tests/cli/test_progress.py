"""Without a terminal a long command says now and then how far it is; with one it draws a bar."""

from __future__ import annotations

import pytest

from parcours.cli.progress import PERIOD, progress


class Hand:
    """A clock that is set by hand [s]."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_line_when_it_begins_then_at_most_every_period_and_when_it_is_over(
    capsys: pytest.CaptureFixture[str],
) -> None:
    clock = Hand()
    with progress(clock) as report:
        for done in range(101):
            report("navigation, orca", done, 100)
            clock.now += 0.5
    out, err = capsys.readouterr()
    assert out == "" and err.splitlines() == [
        "navigation, orca: 0 of 100",
        "navigation, orca: 20 of 100, 20 %, 10 s, 2 a second, about 40 s left",
        "navigation, orca: 40 of 100, 40 %, 20 s, 2 a second, about 30 s left",
        "navigation, orca: 60 of 100, 60 %, 30 s, 2 a second, about 20 s left",
        "navigation, orca: 80 of 100, 80 %, 40 s, 2 a second, about 10 s left",
        "navigation, orca: 100 of 100, 100 %, 50 s, 2 a second",
    ]


def test_what_was_resumed_does_not_count_as_fast(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Hand()
    with progress(clock) as report:
        report("cases", 900, 1000)
        clock.now += PERIOD
        report("cases", 910, 1000)
    assert capsys.readouterr().err.splitlines()[1] == "cases: 910 of 1000, 91 %, 10 s, 1 a second, about 90 s left"


def test_an_interrupted_work_says_how_far_it_came(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Hand()
    with pytest.raises(KeyboardInterrupt), progress(clock) as report:
        report("cases", 0, 1000)
        clock.now += 1.0
        report("cases", 50, 1000)
        raise KeyboardInterrupt
    assert capsys.readouterr().err.splitlines() == [
        "cases: 0 of 1000",
        "cases: 50 of 1000, 5 %, 1 s, 50 a second, about 19 s left",
    ]


def test_a_work_that_is_done_at_once_or_again_is_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    with progress(Hand()) as report:
        for _ in range(3):
            report("checks", 7, 7)
    assert capsys.readouterr().err == "checks: 7 of 7, 100 %\n"


def test_on_a_terminal_a_bar_is_drawn(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # which makes rich take anything for a terminal
    monkeypatch.setenv("COLUMNS", "120")
    clock = Hand()
    with progress(clock) as report:
        report("cases", 0, 100)
        clock.now += 10.0
        report("cases\nfailed 2 % [1, 3]", 50, 100)
    err = capsys.readouterr().err
    assert "50/100" in err and "50 of 100" not in err
    assert "5 a second, about 10 s left; failed 2 % [1, 3]" in err
