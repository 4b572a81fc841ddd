"""Checks whether a planner sees the world as it is: left is left, angles are radians, and no place is special."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from parcours_navigation.checking.remark import Remark, error, note, warning
from parcours_navigation.checking.scenes import mirrored, moved, script
from parcours_navigation.checking.subject import Subject, drive, replayed
from parcours_navigation.protocol import Observation

_FAR = 0.05
"""A deviation of this share of the limits counts as another answer."""


def turns_towards_the_goal(subject: Subject) -> Iterator[Remark]:
    """A goal to the left makes the robot turn left, one to the right turns it right, from any heading."""
    wrong = []
    for heading in (0.0, 1.9, -2.6):
        for side, name in ((1.0, "left"), (-1.0, "right")):
            aim = heading + side * math.pi / 2.0
            goal = (1.0 + 1.2 * math.cos(aim), 1.0 + 1.2 * math.sin(aim))
            drove = drive(subject, subject.task(goal), (1.0, 1.0, heading), seconds=2.5)
            headings = np.unwrap(drove.states[:, 2])
            turn = float(headings[-1] - headings[0])
            if turn * side < -0.2:
                wrong.append(f"goal {name} of heading {heading:g} rad: turned {abs(turn):.1f} rad the other way")
    if not wrong:
        return
    seen = f"in {len(wrong)} of 6 empty worlds; {wrong[0]}"
    if len(wrong) >= 3:
        remedy = "yaw rates and headings run counter-clockwise from x, in radians; y points left of x"
        yield error("turns-away", seen, remedy)
    else:
        remedy = "wrap differences of headings into [-pi, pi): at some headings the long way round is taken"
        yield warning("turns-away", seen, remedy)


def commands_in_units(subject: Subject) -> Iterator[Remark]:
    """Commands are metres a second and radians a second, within what the robot can do."""
    task = subject.task()
    answers = np.array(replayed(subject, task, script(task)))
    start = drive(subject, task, (0.0, 0.0, -0.8), seconds=10.0).commands
    answers = np.concatenate([answers, start])
    for column, limit, unit, guesses in (
        (0, subject.body.limits.speed, "m/s", ((100.0, "centimetres"), (1000.0, "millimetres"))),
        (1, subject.body.limits.yaw_rate, "rad/s", ((180.0 / math.pi, "degrees"),)),
    ):
        sizes = np.abs(answers[:, column])
        over = sizes > 1.01 * limit
        if not over.any():
            continue
        typical, what = float(np.median(sizes[over])), "vw"[column]
        often = f"{over.mean():.0%} of {len(sizes)} answers"
        seen = f"{what} beyond the limit of {limit:.3g} {unit} in {often}, typically {typical:.3g}"
        if over.mean() > 0.25 and typical > 5.0 * limit:
            known = [name for factor, name in guesses if typical < 1.5 * factor * limit]
            guess = f"are these {known[0]}? " if known else ""
            yield error("units", seen, f"{guess}commands are in {unit}")
        elif over.mean() > 0.25:
            remedy = "keep to task.limits: the world clips what is beyond, so the robot drives another curve than meant"
            yield warning("beyond-limits", seen, remedy)
        else:
            yield note("beyond-limits", seen, "the world clips them")
    reach = np.array([subject.body.limits.acceleration, subject.body.limits.yaw_acceleration]) * task.period
    again = np.array(replayed(subject, task, script(task)))
    jumps = (np.abs(np.diff(again, axis=0)) > 1.01 * reach).any(axis=1)
    if jumps.mean() > 0.2:
        seen = (
            f"{jumps.mean():.0%} of successive answers differ by more than the robot can change in {task.period:g} s "
            f"({reach[0]:.2g} m/s, {reach[1]:.2g} rad/s)"
        )
        remedy = "the world follows as fast as it can; plan with task.limits to know where the robot will really be"
        yield note("jumps", seen, remedy)


def no_place_is_special(subject: Subject) -> Iterator[Remark]:
    """A world that is turned and shifted gets the same commands."""
    turns = {
        "turned by 90 degrees about the middle of the arena": (math.pi / 2.0, (0.0, 0.0)),
        "turned by 0.6 rad and shifted by (5, -3) m": (0.6, (5.0, -3.0)),
    }
    for words, (angle, shift) in turns.items():
        share, worst = _deviates(subject, lambda seen, a=angle, s=shift: moved(seen, a, s, (1.0, 1.0)), 1.0)  # type: ignore[misc]
        seen = f"a world {words} changes {share:.0%} of the answers, at most by {worst:.0%} of the limits"
        if share > 0.5 and worst > 4.0 * _FAR:
            remedy = "headings are radians from x, positions metres in one frame: use differences to the robot's own"
            yield error("frame", seen, remedy)
            return
        if share > 0.1:
            yield warning("frame", seen, "is anything tied to the axes, to the origin, or to the border of the arena?")
            return


def left_is_as_good_as_right(subject: Subject) -> Iterator[Remark]:
    """A mirrored world gets mirrored commands."""
    share, worst = _deviates(subject, mirrored, -1.0)
    seen = f"a mirrored world changes {share:.0%} of the answers, at most by {worst:.0%} of the limits"
    if share > 0.5:
        remedy = "fine if it samples at random or keeps to one side on purpose; else look for a sign"
        yield warning("handed", seen, remedy)
    elif share > 0.1:
        yield note("handed", seen, "random samples and ties explain this; a wrong sign would change more")


def _deviates(subject: Subject, change: Callable[[Observation], Observation], sign: float) -> tuple[float, float]:
    """Return which share of answers changes with the world, and the largest change as a share of the limits."""
    task = subject.task()
    steps = script(task)
    changed = [change(seen) for seen in steps]
    scale = np.array([subject.body.limits.speed, subject.body.limits.yaw_rate])
    plain = np.array(replayed(subject, task, steps)) / scale
    other = np.array(replayed(subject, changed[0].task, changed)) / scale * np.array([1.0, sign])
    gaps = np.abs(plain - other).max(axis=1)
    return float((gaps > _FAR).mean()), float(gaps.max())
