"""Checks that a planner remembers nothing it must not: the last case, arrays, the order of obstacles, global dice."""

from __future__ import annotations

import random
from collections.abc import Iterator

import numpy as np

from parcours_navigation.checking.remark import Remark, error, warning
from parcours_navigation.checking.scenes import copied, observation, script
from parcours_navigation.checking.subject import Speeds, Subject, replayed
from parcours_navigation.protocol import Observation


def repeats_itself(subject: Subject) -> Iterator[Remark]:
    """Two new planners answer the same case alike."""
    task = subject.task()
    one, two = (replayed(subject, task, script(task)) for _ in range(2))
    if one != two:
        remedy = "draw random numbers from a generator made of task.seed in reset, never from clocks or global dice"
        yield error("nondeterministic", f"two new planners on the same case: {_first_difference(one, two)}", remedy)


def forgets_the_last_case(subject: Subject) -> Iterator[Remark]:
    """After a reset it answers as new, whatever it did before."""
    task, other = subject.task(), subject.task((0.2, 1.7), seed=8)
    fresh = replayed(subject, task, script(task))
    if fresh != replayed(subject, task, script(task)):
        return  # not the reset's fault: repeats_itself reports it
    slot = subject.slot(other)
    for seen in script(other, 17):
        slot.speeds(seen)
    again = replayed(subject, task, script(task), slot)
    if again != fresh:
        remedy = "set everything that observe changes again in reset, the random generator included"
        yield error("remembers", f"after another case and a reset: {_first_difference(fresh, again)}", remedy)


def rolls_its_own_dice(subject: Subject) -> Iterator[Remark]:
    """It leaves the global random generators of Python and NumPy alone."""
    task = subject.task()
    before = _dice()
    replayed(subject, task, script(task))
    touched = [name for name, state in _dice().items() if state != before[name]]
    if touched:
        remedy = "a case would depend on all cases before it; use numpy.random.default_rng(task.seed)"
        yield warning("global-dice", f"the state of {' and '.join(touched)} changed", remedy)


def _dice() -> dict[str, str]:
    """Return the states of the global generators, in words that can be compared."""
    name, keys, position, *_ = np.random.get_state(legacy=True)  # noqa: NPY002
    return {"random": repr(random.getstate()), "numpy.random": f"{name} {position} {hash(np.asarray(keys).tobytes())}"}


def leaves_observations_alone(subject: Subject) -> Iterator[Remark]:
    """It does not write into the arrays it is shown."""
    task = subject.task()
    slot = subject.slot(task)
    for seen in script(task):
        shown = copied(seen)
        slot.speeds(shown)
        for name in ("robot", "obstacles"):
            if getattr(seen, name).tobytes() != getattr(shown, name).tobytes():
                found = f"observation.{name} was written to at {seen.time:.1f} s"
                yield error("changes-observation", found, f"work on a copy: observation.{name}.copy()")
                return


def keeps_no_observation(subject: Subject) -> Iterator[Remark]:
    """What it remembers of an observation is a copy: the arrays are filled again each time."""
    task = subject.task()
    fresh = replayed(subject, task, script(task))
    if fresh != replayed(subject, task, script(task)):
        return
    slot = subject.slot(task)
    shared = observation(task, (0.0, 0.0, 0.0), ((0.0,),) * 3)
    reused = []
    for seen in script(task):
        shared.time, shared.scan, shared.map, shared.path = seen.time, None, None, None  # made again of what it sees
        shared.robot[:], shared.obstacles[:] = seen.robot, seen.obstacles
        reused.append(slot.speeds(shared))
        shared.robot[:], shared.obstacles[:] = 7.7e3, -7.7e3  # what a kept reference would show from now on
    if reused != fresh:
        found = f"with arrays that are filled again for each observation: {_first_difference(fresh, reused)}"
        remedy = "copy what is to be kept: observation.robot.copy(), observation.obstacles.copy()"
        yield error("keeps-observation", found, remedy)


def takes_obstacles_in_any_order(subject: Subject) -> Iterator[Remark]:
    """The order of the obstacles changes nothing."""
    task = subject.task()
    steps = script(task)
    forward = replayed(subject, task, steps)
    turned = [Observation(one.time, one.robot.copy(), one.obstacles[::-1].copy(), one.task) for one in steps]
    scale = np.array([subject.body.limits.speed, subject.body.limits.yaw_rate])
    far = (np.abs(np.array(forward) - np.array(replayed(subject, task, turned))) / scale).max(axis=1)
    if far.max() > 0.05:
        seen = (
            f"obstacles in reverse order change {int((far > 0.05).sum())} of {len(far)} answers, at most by "
            f"{100 * far.max():.0f} % of the limits"
        )
        remedy = "do not favour the first or last row; an observation's rows have no rank"
        yield warning("obstacle-order", seen, remedy)


def _first_difference(one: list[Speeds], two: list[Speeds]) -> str:
    """Return the first observation that two runs answered differently, in words.

    >>> _first_difference([(0.1, 0.0), (0.2, 0.0)], [(0.1, 0.0), (0.2, 0.5)])
    'observation 1 was answered (0.2, 0) and (0.2, 0.5)'
    """
    k = next(k for k, (a, b) in enumerate(zip(one, two, strict=True)) if a != b)
    return f"observation {k} was answered ({one[k][0]:.6g}, {one[k][1]:.6g}) and ({two[k][0]:.6g}, {two[k][1]:.6g})"
