"""The paper's arena as a world file: its cases are the paper's own, by their model and domains, bit for bit."""

from __future__ import annotations

from parcours.errors import BadRequest
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.worlds.file import BadWorld, World
from parcours_navigation.worlds.plan import PaperObstacles, Sensing


def paper_cases(world: World, seed: int, study: str) -> SystemCases | None:
    """Return the paper's cases if the world's obstacles are the paper's; None for any other world.

    Raises BadWorld if anything else in such a world is not as the paper has it.
    """
    if world.inputs is not None:
        return None
    plan = world.plan()
    entries = [entry for entry in plan.others if entry.get("motion") == "paper"]
    if not entries:
        return None
    where = f"{world.origin}: others"
    if len(plan.others) > 1:
        raise BadWorld(where, "the paper's obstacles come alone, but there are others beside them", slug="world-range")
    try:
        found = PaperObstacles(**entries[0])
    except TypeError as error:
        raise BadWorld(where, f"its keys must be protocol and radius, but: {error}", slug="world-range") from None
    body, task = plan.robot, plan.task
    as_given = (
        task.start is not None and tuple(task.goal or ()) == (2.0, 2.0) and task.start[:2] == (0.0, 0.0)
        and body.kind == "unicycle" and not body.footprint and plan.sensing == Sensing()
        and plan.ground.bounds is None and not plan.ground.walls
    )  # fmt: skip
    if not as_given:
        rule = "the paper's obstacles head for a robot that starts in the origin, senses all, and goes to (2, 2)"
        raise BadWorld(where, rule, "use stop-move-stop obstacles in other worlds", slug="world-range")
    try:
        return SystemCases(seed, found.protocol, body.radius, found.radius, study)
    except BadRequest as error:
        raise BadWorld(where, error.rule, error.remedy, slug=error.slug) from error
