"""When a worker counts as hung: by the time it stays at one place, not by what its neighbours do meanwhile."""

from __future__ import annotations

import multiprocessing
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from parcours.run import heartbeat as heartbeat
from parcours.run.campaign import run_tasks


@dataclass(frozen=True)
class Neighbours:
    """Task 0 stays at one place until the others are done; the others take next to no time."""

    folder: Path
    allowed: float

    def __call__(self, number: int, lost: tuple[heartbeat.LostCase, ...]) -> None:
        with (self.folder / "begun").open("a") as file:
            file.write(f"{number}\n")
        if number or lost:
            return
        words = heartbeat.words(3)
        words[heartbeat.TIME], words[heartbeat.LIMIT], words[heartbeat.CASE] = 0.0, self.allowed, 0.0
        while not (self.folder / "others are done").exists():
            time.sleep(0.01)
        words[heartbeat.CASE] = heartbeat.NO_CASE


def test_fast_neighbours_do_not_make_a_slow_case_hung(tmp_path: Path) -> None:
    n = 400  # turns of the loop; 305 looks of 0.1 s at one place are as long as the slow case may stay there
    done = set()
    for number in run_tasks(Neighbours(tmp_path, 20.0), range(n), 2, str, heartbeat_words=3, forks=True):
        done.add(number)
        if len(done | {0}) == n:
            (tmp_path / "others are done").touch()
    assert done == set(range(n))
    assert (tmp_path / "begun").read_text().split().count("0") == 1


def test_a_case_that_stays_too_long_is_lost_and_its_task_done_without_it(tmp_path: Path) -> None:
    assert list(run_tasks(Neighbours(tmp_path, 0.1), [0], 1, str, heartbeat_words=3, forks=True)) == [0]
    assert (tmp_path / "begun").read_text().split() == ["0", "0"]


def test_a_stopped_machine_counts_as_one_look() -> None:
    block = heartbeat.new_block(multiprocessing, 3)
    words = np.frombuffer(block)
    watch = heartbeat.Watch(block)
    words[heartbeat.TIME], words[heartbeat.LIMIT], words[heartbeat.CASE] = 0.0, 0.1, 4.0
    seen = [watch.has_hung() for _ in range(10)]
    assert seen == [False] * 7 + [True] * 3
