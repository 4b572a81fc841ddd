"""What a world's author wants to know: can its cases be made, and can they be solved."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from parcours.errors import ParcoursError
from parcours_navigation.arena.solvability import SOLVABLE, UNSOLVABLE
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, World, find_world
from parcours_navigation.worlds.paper import paper_cases
from parcours_navigation.worlds.solving import solve_worlds

PERIOD = 0.05  # Between observations, as planners are asked by default [s]
_ENOUGH = 5
"""If none of this many first cases can be made, no other is tried; nor after a ground that cannot be generated."""


@dataclass(frozen=True, slots=True)
class CheckedWorld:
    """What was found of the first cases of a world."""

    world: World
    n: int
    wrong: tuple[str, ...]  # cases that cannot be made, and why
    bodies: tuple[int, int]  # fewest and most others
    walls: tuple[int, int]
    discs: tuple[int, int]  # that stand
    gives: tuple[str, ...]  # of `protocol.SENSES`
    unsolvable: tuple[int, ...]
    solvable: int
    is_paper: bool = False

    @property
    def passed(self) -> bool:
        """Whether every case can be made, and the ground lets a robot through."""
        return not self.wrong and not self.unsolvable

    def document(self) -> dict[str, object]:
        """Return it as JSON values."""
        return {
            "world": self.world.name, "cases": self.n, "passed": self.passed, "wrong": list(self.wrong),
            "others": list(self.bodies), "walls": list(self.walls), "discs": list(self.discs),
            "gives": list(self.gives), "unsolvable": list(self.unsolvable), "solvable": self.solvable,
        }  # fmt: skip


def check_world(name: str, n: int, seed: int, progress: Callable[[int, int], None]) -> CheckedWorld:
    """Make the first n cases of a world, and ask which of them cannot be solved.

    Raises BadWorld if its file is bad, or none of them can be made.
    """
    world = find_world(name)
    if paper_cases(world, seed, "navigation") is not None:
        return CheckedWorld(world, n, (), (3, 3), (0, 0), (0, 0), (), (), 0, True)
    cases, wrong, bodies, walls, discs = WorldCases(seed, world), [], [], [], []
    good: list[int] = []
    for number in range(n):
        try:
            [staged] = cases.staged([number], PERIOD)
        except ParcoursError as error:
            wrong.append(error)
            if not good and (len(wrong) == _ENOUGH or error.slug == "ground-connected"):
                raise wrong[0] from None
        else:
            good.append(number)
            bodies.append(len(staged.scene.obstacles))
            land = cases.land(number)
            walls.append(len(land.edges()))
            discs.append(len(land.ground.discs))
        progress(number + 1, n)
    if not good:
        raise wrong[0]  # not of some cases, but of the file
    found = solve_worlds(cases, np.array(good, np.int64))
    plan = cases.plan(good[0])
    gives = plan.sensing.gives(bool(plan.task.path))
    never = tuple(number for number, one in zip(good, found["answer"], strict=True) if one == UNSOLVABLE)
    return CheckedWorld(
        world,
        n,
        tuple(map(str, wrong)),
        _span(bodies),
        _span(walls),
        _span(discs),
        gives,
        never,
        int((found["answer"] == SOLVABLE).sum()),
    )


def _span(values: list[int]) -> tuple[int, int]:
    return (min(values), max(values)) if values else (0, 0)


def lines(found: CheckedWorld) -> Iterator[str]:
    """Yield what to say."""
    yield f"{found.world.name}: {found.world.doc}" if found.world.doc else found.world.name
    if found.is_paper:
        yield "the paper's arena: its cases are those of parcours run navigation without a world"
        return
    ground = f"walls: {_words(found.walls)}" + f"; discs: {_words(found.discs)}" * (found.discs[1] > 0)
    shown = "".join(f", the {name}" for name in found.gives)
    yield f"others: {_words(found.bodies)}; {ground}; planners are shown the others{shown}"
    for one in found.wrong[:5]:
        yield f"error: {one}"
    if len(found.wrong) > 5:
        yield f"... and {len(found.wrong) - 5} more"
    if found.unsolvable:
        some, n = ", ".join(map(str, found.unsolvable[:10])), len(found.unsolvable)
        where = f"{found.world.origin}:{found.world.line_of('task, goal')}: task, goal"
        rule = f"a robot of this size and speed must be able to get there in time, but none can in {n} cases: {some}"
        remedy = "widen the way, move the goal or the start, or raise time_limit"
        yield f"error: {BadWorld(where, rule, remedy, slug='goal-unreachable')}"
    sure = f"; {found.solvable} of them can certainly be solved" if found.solvable else ""
    yield f"{found.n - len(found.wrong)} of {found.n} cases can be made{sure}"


def _words(span: tuple[int, int]) -> str:
    return str(span[0]) if span[0] == span[1] else f"{span[0]} to {span[1]}"
