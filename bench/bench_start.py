"""How long a user waits for the first result: with compiled kernels on disk, and from an empty cache.

python bench/bench_start.py            best of 3 warm starts, two cold starts, the paper's 905 cases
python bench/bench_start.py --no-cold  without compiling again

Wall-clock time of whole commands of `parcours`, from typing return to the prompt: starting Python, loading kernels,
drawing and running cases, writing results and printing their tables. Beside it stands the processor time, which tells
on a busy machine how long it would take on an idle one. The cold start points PARCOURS_CACHE_DIR at an empty folder,
and looks whether the user is told what takes so long.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from parcours_navigation.cases.family import PUBLISHED_CASES
from parcours_ramp.system.study import SCHEDULES

PROGRAM = str(Path(sys.executable).with_name("parcours"))

SYSTEM = tuple((f"ramp_system, {schedule}", ("ramp_system", "--schedule", schedule)) for schedule in SCHEDULES)
PLANNERS = tuple((f"navigation, {name}", ("navigation", "--planner", name)) for name in ("orca", "dwa", "mppi"))


def processor() -> float:
    """Return the processor time of all finished child processes [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def wait(arguments: tuple[str, ...], cache: str | None = None) -> tuple[float, float, str]:
    """Return how long a command of `parcours` took [s], its processor time [s], and its standard error."""
    environment = {**os.environ, "PARCOURS_CACHE_DIR": cache} if cache else dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # with it Python compiles our modules again at each start
    begun, used = time.perf_counter(), processor()
    done = subprocess.run([PROGRAM, *arguments], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"parcours {' '.join(arguments)} ended with exit code {done.returncode}:\n{done.stderr}")
    return time.perf_counter() - begun, processor() - used, done.stderr


def run(arguments: tuple[str, ...], cases: int, cache: str | None = None) -> tuple[float, float, str]:
    """Return the same of `parcours run` with this many cases."""
    with tempfile.TemporaryDirectory() as folder:
        more = ("--cases", str(cases), "--out", f"{folder}/out", "--fail-if", "errors > 0")  # cases may fail
        return wait(("run", *arguments, *more), cache)


def best(arguments: tuple[str, ...], cases: int, tries: int) -> tuple[float, float]:
    """Return wall-clock and processor time of the quickest of several runs [s]."""
    return min(run(arguments, cases)[:2] for _ in range(tries))


def line(what: str, taken: float, used: float, bound: float | None, more: str = "") -> None:
    """Print what took how long, against the bound that is hoped for [s]."""
    share = f"   {taken / bound:>5.2f} of {bound:.0f} s" if bound is not None else ""
    print(f"{what:<60} {taken:>7.2f} s, processor {used:>7.2f} s{share}{more}", flush=True)


def main() -> None:
    """Print a line for each start."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=3, help="the best of this many warm starts counts")
    parser.add_argument("--no-cold", action="store_true", help="leave out the cold start")
    chosen = parser.parse_args()
    if chosen.tries < 1:
        parser.error(f"--tries must be at least 1, but is {chosen.tries}")
    for what, arguments in (*SYSTEM, *PLANNERS):
        run(arguments, 1)  # compiles what is missing, untimed
        line(f"warm, 1 case: {what}", *best(arguments, 1, chosen.tries), 2.0)
    for what, arguments in SYSTEM:
        times = best(arguments, PUBLISHED_CASES, chosen.tries)
        line(f"warm, {PUBLISHED_CASES} cases, {os.cpu_count()} workers, in all: {what}", *times, None)
    if chosen.no_cold:
        return
    with tempfile.TemporaryDirectory() as cache:
        what, arguments = SYSTEM[0]
        taken, used, said = run(arguments, 1, cache)
        told = next((f"; it says: {text!r}" for text in said.splitlines() if "compiling" in text), "; it says nothing")
        line(f"cold, 1 case: {what}", taken, used, 60.0, told)
    with tempfile.TemporaryDirectory() as cache:
        line(f"cold, everything, {os.cpu_count()} workers", *wait(("compile",), cache)[:2], 60.0)


if __name__ == "__main__":
    main()
