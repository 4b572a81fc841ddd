"""The noise meter: it sees what is taken from it, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest, HostFailure
from parcours.run import noise as module
from parcours.run.noise import Noise, NoiseMeter, lost


def children(of: int) -> list[int]:
    """The processes that a process has started and that still run."""
    return [
        int(word) for task in Path(f"/proc/{of}/task").iterdir() for word in (task / "children").read_text().split()
    ]


def echoes() -> list[int]:
    """The bare processes of meters in this one."""
    return [child for child in children(os.getpid()) if b"os.read" in Path(f"/proc/{child}/cmdline").read_bytes()]


def gone(pid: int, within: float) -> bool:
    """Whether a process has ended (a zombie has) before so many seconds pass."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.01)
    return False


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=300))
def test_noise_tells_its_quantiles_in_whatever_order_it_was_measured(times: list[int]) -> None:
    noise = Noise(tuple(times))
    assert noise.times == tuple(sorted(times))
    assert (noise.samples, noise.max) == (len(times), max(times))
    for percent, quantile in ((50, noise.p50), (99, noise.p99)):
        assert 100 * sum(time <= quantile for time in times) >= percent * len(times)
        assert 100 * sum(time < quantile for time in times) < percent * len(times)


@pytest.mark.parametrize("times", [(), (3, -1)])
def test_no_sample_or_a_negative_one_is_no_noise(times: tuple[int, ...]) -> None:
    with pytest.raises(BadRequest, match=r"\[noise-samples\]"):
        Noise(times)


@pytest.mark.parametrize(("trips", "work"), [(-1, 5), (0, 0), (1, -1)])
def test_a_meter_of_nothing_is_refused(trips: int, work: int) -> None:
    with pytest.raises(BadRequest, match=r"\[count-range\]"):
        NoiseMeter(trips=trips, work=work)


def test_time_taken_from_the_work_is_lost_and_the_reading_itself_is_not() -> None:
    def clock(gaps: list[int]) -> Iterator[int]:
        now = 0
        yield now
        for gap in gaps:
            now += gap
            yield now

    assert lost(1_000, clock([100] * 10).__next__) == 0
    assert lost(1_000, clock([100] * 4 + [4_000_000] + [100] * 3 + [30_000] + [100] * 3).__next__) == 4_030_000


def test_a_partner_that_is_stopped_for_50_ms_shows_as_50_ms(monkeypatch: pytest.MonkeyPatch) -> None:
    with NoiseMeter(trips=1, work=0) as meter:
        (echo,) = echoes()
        waker = threading.Timer(0.05, os.kill, (echo, signal.SIGCONT))

        def read() -> int:
            """The clock; once the sample has begun, its 50 ms begin too."""
            now = time.perf_counter_ns()
            if not waker.ident:
                os.kill(echo, signal.SIGSTOP)
                waker.start()
            return now

        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter_ns=read))
        meter.sample()
        waker.join()
        assert meter.noise().max >= 50_000_000


def test_a_meter_leaves_no_process_behind() -> None:
    with NoiseMeter(trips=1, work=0) as meter:
        meter.sample(3)
        (echo,) = echoes()
    assert gone(echo, 5.0)
    assert meter.noise().samples == 3


def test_a_meter_whose_process_died_says_so() -> None:
    with NoiseMeter(trips=1, work=0) as meter:
        os.kill(echoes()[0], signal.SIGKILL)
        with pytest.raises(HostFailure, match=r"bare process: it must answer within 5 s, but: .*\[noise-meter\]"):
            meter.sample()


def test_a_meter_whose_process_hangs_says_so_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_PATIENCE", 0.1)
    with NoiseMeter(trips=1, work=0) as meter:
        (echo,) = echoes()
        os.kill(echo, signal.SIGSTOP)
        with pytest.raises(HostFailure, match=r"but: timed out.*\[noise-meter\]"):
            meter.sample()
    assert gone(echo, 5.0), "a stopped process is ended too"


def test_a_meter_measures_while_it_is_open_only() -> None:
    with pytest.raises(HostFailure, match=r"it is not open.*\[noise-meter\]"):
        NoiseMeter(trips=1).sample()
    with pytest.raises(BadRequest, match=r"\[noise-samples\]"):
        NoiseMeter(trips=1).noise()


def test_the_bare_process_ends_when_the_measuring_one_is_killed() -> None:
    program = (
        "import time\nfrom parcours.run.noise import NoiseMeter\n"
        "with NoiseMeter(trips=1, work=0) as meter:\n    print('open', flush=True)\n    time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as measuring:
        assert measuring.stdout is not None and measuring.stdout.readline() == b"open\n"
        (echo,) = children(measuring.pid)
        measuring.kill()
        assert gone(echo, 5.0)
