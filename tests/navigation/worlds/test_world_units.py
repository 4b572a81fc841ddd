"""A number of a world file has the unit of its key, or none; what has another dimension is said with its line."""

from __future__ import annotations

import dataclasses
import typing
from inspect import signature
from pathlib import Path

import pytest

from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import MOTIONS
from parcours_navigation.robots.kinds import Body, Odometry
from parcours_navigation.worlds import plan
from parcours_navigation.worlds.file import BadWorld, parse_world
from parcours_navigation.worlds.staging import GENERATORS
from parcours_navigation.worlds.units import UNIT_OF

TASK = "task: {start: [1, 2, 90 deg], goal: [5 m, 2], time_limit: 1 min}\n"
PARTS = (plan.Detection, plan.LaserScan, plan.SensingPlan, plan.TaskPlan, plan.StopMoveStop, plan.GroundPlan,
         Body, Odometry, Others, *MOTIONS.values())  # fmt: skip


def world(body: str) -> None:
    parse_world(f"parcours: world/1\nname: w\n{body}", "w.yaml", Path())


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("robot: {radius: 22 s}", r"w.yaml:4: the world, robot, radius: it must be in m, but is in s: '22 s'"),
        ("robot: {speed: 2 m}", r"robot, speed: it must be in m/s, but is in m"),
        ("robot: {radius: 10 cm + 1 s}", r"must have one unit, but is in m and s"),
        ("robot:\n  speed: 1\n  delay: 2 * 3 cm", r"w.yaml:6: .*delay: it must be in s, but is in m"),
        ("sensing: {scan: {beams: 5 m}}", r"beams: it must be a plain number, but is in m"),
        ("ground: {generated: {kind: barn, cell: 2 s}}", r"cell: it must be in m, but is in s"),
        ("others: [{motion: random-walk, turn: 1 rad/s}]", r"others 1, turn: it must be in rad, but is in 1/s"),
        ("others: [{motion: stop-move-stop, turn: [0, 1 rad]}]", r"others 1, turn: it must be in rad/s, but is an"),
        ("others: [{motion: orca, start: [1 s, 2 m]}]", r"others 1, start: it must be in s, but is in m"),
        ("robot: {radius: a}\ndata: {parameters: {a: {unit: s, edges: [0.1, 0.2]}}}", r"in m, but is in s: 'a' \(with"),
        ("robot: {radius: a}\ndata: {parameters: {a: {unit: cm, edges: [10, 20]}}}", r"w.yaml:5: .*'a' is in cm"),
    ],
)  # fmt: skip
def test_another_dimension_is_said_with_its_line(body: str, said: str) -> None:
    with pytest.raises(BadWorld, match=said + r".*\[world-unit\]"):
        world(TASK + body)


@pytest.mark.parametrize(
    "robot",
    [
        "{radius: 22 cm, speed: 1.3 m/s, acceleration: 1 m/s2, yaw_rate: 90 deg/s, delay: 50 ms}",
        "{radius: 'min(2 * 10 cm, 0.3)', speed: 0.5 m / 2 s, yaw_rate: 2 * pi / 3, odometry: {way_scale: 1 cm / 1 m}}",
    ],
)
def test_units_of_the_right_dimension_and_plain_numbers_pass(robot: str) -> None:
    world(f"{TASK}robot: {robot}\n")


def test_every_number_that_a_world_may_have_has_a_unit() -> None:
    given = {key.rpartition(", ")[2] for key in UNIT_OF}
    fields = {name for part in PARTS for name, hint in typing.get_type_hints(part).items() if "float" in str(hint)}
    whole = {one.name for part in PARTS for one in dataclasses.fields(part) if one.type in ("int", int)}
    arguments = {name for draw in GENERATORS.values() for name in signature(draw).parameters}
    points = {"area", "bounds", "goals", "places", "points"}
    assert (fields | whole | arguments | points) - {"tracks"} <= given
