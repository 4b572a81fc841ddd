"""When a worker counts as hung: by the time it stays at one place, not by what its neighbours do meanwhile."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from parcours.run import heartbeat as heartbeat
from parcours.run.strangers import computed

DTYPE = np.dtype([("number", "i8")])


@dataclass(frozen=True)
class Neighbours:
    """Case 0 stays at one place until the others are done; the others take next to no time."""

    folder: Path
    allowed: float
    lost: tuple[heartbeat.LostCase, ...] = ()
    heartbeat_words: int = 3

    def without(self, lost: tuple[heartbeat.LostCase, ...]) -> Neighbours:
        return replace(self, lost=lost)

    def __call__(self, number: int, count: int) -> np.ndarray:
        with (self.folder / "begun").open("a") as file:
            file.write(f"{number}\n")
        if number == 0 and not self.lost:
            heartbeat.enter(number, self.allowed)
            while not (self.folder / "others are done").exists():
                time.sleep(0.01)
            heartbeat.leave()
        return np.array([(number,)], DTYPE)


def cases(n: int) -> list[range]:
    return [range(k, k + 1) for k in range(n)]


def test_fast_neighbours_do_not_make_a_slow_case_hung(tmp_path: Path) -> None:
    n = 400  # turns of the loop; 305 looks of 0.1 s at one place are as long as the slow case may stay there
    done = set()
    for number, _ in computed(Neighbours(tmp_path, 20.0), cases(n), 2, str, forks=True):
        done.add(number)
        if len(done | {0}) == n:
            (tmp_path / "others are done").touch()
    assert done == set(range(n))
    assert (tmp_path / "begun").read_text().split().count("0") == 1


def test_a_case_that_stays_too_long_is_lost_and_its_task_done_without_it(tmp_path: Path) -> None:
    [(number, rows)] = computed(Neighbours(tmp_path, 0.1), cases(1), 1, str, forks=True)
    assert number == 0 and rows["number"].tolist() == [0]
    assert (tmp_path / "begun").read_text().split() == ["0", "0"]


def test_a_stopped_machine_counts_as_one_look() -> None:
    with worker(limit=0.1) as (watch, _, _):
        assert [watch.has_hung() for _ in range(10)] == [False] * 7 + [True] * 3


def test_only_what_goes_forward_is_a_sign_of_life() -> None:
    with worker(limit=0.1) as (watch, words, _):
        seen = []
        for ticks in (0.0, 5.0, 3.0, 4.0, 1e300, float("nan"), 5.0, -1.0, 5.2, 5.4, 5.6, 5.9):
            words[heartbeat.TIME] = 1e7 * ticks
            seen.append(watch.has_hung())
        assert seen == [False] * 8 + [True] * 4
        words[heartbeat.TIME] = 7e7
        assert not watch.has_hung()


def test_what_was_said_of_cases_cannot_be_taken_back() -> None:
    with worker(limit=0.1) as (watch, words, pipe):
        words[heartbeat.CASE], words[heartbeat.TIME] = 17.0, 3.0
        assert watch.lost("died", "so") == heartbeat.LostCase(4, 3, "died", "so")
        words[heartbeat.TIME] = float("nan")
        assert watch.lost("died", "so") == heartbeat.LostCase(4, 0, "died", "so")
        heartbeat._ENTRY.pack_into(entry := bytearray(16), 0, heartbeat.NO_CASE, 1.0)
        os.write(pipe, entry)
        assert watch.lost("died", "so") is None


@pytest.mark.parametrize("bytes_of_others", [b"x", bytes(16), bytes(17), b"\xff" * 48])
def test_after_bytes_of_others_nothing_is_believed(bytes_of_others: bytes) -> None:
    with worker(limit=0.1) as (watch, _, pipe):
        os.write(pipe, bytes_of_others)
        assert watch.was_garbled()
        os.write(pipe, heartbeat._ENTRY.pack(2.0, 0.1))
        assert watch.lost("tampered", "so") == heartbeat.LostCase(4, None, "tampered", "so")


@contextlib.contextmanager
def worker(limit: float) -> Iterator[tuple[heartbeat.WorkerWatch, np.ndarray, int]]:
    """Yield the watch of a worker that has said it is on case 4, its words, and its end of the pipe."""
    block = heartbeat.new_block(multiprocessing, 3)
    ours, theirs = os.pipe()
    os.set_blocking(ours, False)
    os.write(theirs, heartbeat._ENTRY.pack(-4711.0, 1.0) + heartbeat._ENTRY.pack(4.0, limit))
    try:
        yield heartbeat.WorkerWatch(block, ours), np.frombuffer(block), theirs
    finally:
        os.close(ours)
        os.close(theirs)
