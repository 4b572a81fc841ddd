"""People against a plain program: brute force, complex numbers, the machine's own sin, exp and atan2.

One decision and one tick from random pictures: a crowd is chaotic, so longer runs would compare nothing but rounding.
"""

from __future__ import annotations

import cmath
import itertools
import math
from typing import Any

import numpy as np
import pytest

from parcours.kernels import Record
from parcours_navigation.others.agent import ORCA, STAND
from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import Crowd, drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.others.half_planes import half_plane, nearest_permitted, wall_plane
from parcours_navigation.others.kinds import ConstantVelocity, OrcaPeople, SocialForcePeople
from parcours_navigation.protocol import Floats

TICK = 10_000_000
WALLS = np.array([[0.0, 0.0, 9.0, 0.0], [9.0, 0.0, 9.0, 9.0], [4.0, 3.0, 4.0, 6.0]])


def picture(seed: int) -> tuple[Crowd, Floats]:
    """Return a crowd in the middle of things, and a robot."""
    rng = np.random.default_rng(seed)
    area = (0.5, 0.5, 8.5, 8.5)
    others = [
        Others(
            SocialForcePeople(cohesion=3.0), number=int(rng.integers(1, 8)), group=3, area=area, radius=0.25, effort=0.7
        ),
        Others(OrcaPeople(), number=int(rng.integers(1, 8)), area=area, radius=0.2, yields=0.5),
        Others(OrcaPeople(goals=((1.0, 1.0),), loop=False, acceleration=2.0), number=3, area=area, radius=0.2),
        Others(ConstantVelocity(), number=int(rng.integers(1, 30)), area=area, radius=0.05, speed=0.8),
    ]
    crowd = drawn(others, seed, 0)
    for obstacle in crowd.obstacles:  # some touch
        obstacle.x0 += rng.uniform(-0.3, 0.3)
        obstacle.y0 += rng.uniform(-0.3, 0.3)
    begin_agents(crowd.agents, crowd.ways, crowd.obstacles, WALLS)
    for agent in crowd.agents:
        agent.vx, agent.vy = rng.uniform(-1.0, 1.0, 2)
        if agent.kind == 0:
            agent.start = -TICK  # it has set out already
    still = rng.permutation(np.flatnonzero(crowd.agents["kind"] == ORCA))[:2]  # one was stopped, one waits
    crowd.agents["vx"][still] = crowd.agents["vy"][still] = 0.0
    crowd.obstacles[still[0]].stop, crowd.agents[still[1]].start = 0, 10 * TICK
    return crowd, np.array([*rng.uniform(1.0, 8.0, 2), *rng.uniform(-1.0, 1.0, 2), 0.3])


def z(x: float, y: float) -> complex:
    return complex(x, y)


def feet(at: complex) -> list[tuple[float, complex, Floats]]:
    """Return distance, nearest point and segment of every wall, nearest first."""
    found = []
    for ax, ay, bx, by in WALLS:
        a, b = z(ax, ay), z(bx, by)
        t = ((at - a) * (b - a).conjugate()).real / abs(b - a) ** 2
        foot = a + min(max(t, 0.0), 1.0) * (b - a)
        found.append((abs(at - foot), foot, np.array([ax, ay, bx, by])))
    return sorted(found, key=lambda each: each[0])


def wanted(agent: Record, ways: Floats, at: complex) -> complex:
    rows = ways[agent.first : agent.first + agent.count]
    k = agent.at - agent.first
    if abs(z(*rows[k, 1:]) - at) <= agent.arrive:
        if k == len(rows) - 1 and agent.ends == STAND:
            return 0j
        k = (k + 1) % len(rows)
    to = z(*rows[k, 1:]) - at
    speed = agent.speed
    if agent.ends == STAND and k == len(rows) - 1:
        speed = min(speed, abs(to) / 0.5)
    return cmath.rect(speed, cmath.phase(to))


def fading(x: float) -> float:
    return math.exp(-x) if x < 12.0 else 0.0


def felt(agent: Record, to: complex, approach: complex, reach: float) -> complex:
    """Return the force of Moussaid et al. 2009; bodies wider than 0.5 m are nearer by what they exceed it."""
    distance = max(abs(to) - max(reach - 0.5, 0.0), 0.0)
    d = agent.ahead * approach + to / abs(to)
    b = agent.range * abs(d)
    theta = cmath.phase(to / d) + b * agent.side
    slow = agent.strength * fading(distance / b + (agent.slowing * b * theta) ** 2)
    turn = math.copysign(agent.strength, theta) * fading(distance / b + (agent.turning * b * theta) ** 2)
    return complex(-(slow + turn * 1j) * d / abs(d))


def pushed(agent: Record, to: complex, reach: float) -> complex:
    return complex(-agent.stiffness * max(reach - abs(to), 0.0) * to / abs(to))


class Twin:
    """The same picture, decided by brute force."""

    def __init__(self, crowd: Crowd, robot: Floats) -> None:
        self.crowd, self.robot = crowd, robot
        self.at = [z(o.x, o.y) for o in crowd.obstacles]
        self.v = [z(a.vx, a.vy) for a in crowd.agents]
        self.radii = [float(o.radius) for o in crowd.obstacles]

    def is_still(self, i: int) -> bool:
        return bool(self.crowd.obstacles[i].stop <= 0 or self.crowd.agents[i].start > 0)

    def near(self, i: int) -> list[int]:
        agent = self.crowd.agents[i]
        by_distance = sorted(range(len(self.at)), key=lambda j: (abs(self.at[j] - self.at[i]), j))
        return [j for j in by_distance if j != i and abs(self.at[j] - self.at[i]) < agent.reach][: agent.nearest]

    def acceleration(self, i: int) -> complex:
        agent, at, v, radius = self.crowd.agents[i], self.at[i], self.v[i], self.radii[i]
        total = (wanted(agent, self.crowd.ways, at) - v) / agent.relax
        for j in self.near(i):
            to = self.at[j] - at
            reach = radius + self.radii[j]
            total += felt(agent, to, v - self.v[j], reach)
        to = z(*self.robot[:2]) - at
        if abs(to) < agent.reach:
            reach = radius + float(self.robot[4])
            total += agent.yields * felt(agent, to, v - z(*self.robot[2:4]), reach)
        for distance, foot, _ in feet(at):
            if distance < 10.0 * agent.wall_range + radius:
                size = agent.wall_strength * math.exp(min((radius - distance) / agent.wall_range, 3.0))
                total += size * (at - foot) / distance
        mates = [self.at[a.obstacle] for a in self.crowd.agents if a.group == agent.group >= 0]
        if mates:
            to = sum(mates) / len(mates) - at
            if abs(to) > 0.5 * (len(mates) - 1):
                total += agent.cohesion * to / abs(to)
        return complex(total)

    def contact(self, i: int) -> complex:
        agent, at, radius = self.crowd.agents[i], self.at[i], self.radii[i]
        total = sum(pushed(agent, self.at[j] - at, radius + self.radii[j]) for j in self.near(i))
        if agent.yields > 0.0:
            total += pushed(agent, z(*self.robot[:2]) - at, radius + float(self.robot[4]))
        return complex(total)

    def planes(self, i: int) -> tuple[Floats, int]:
        agent, at, v = self.crowd.agents[i], self.at[i], self.v[i]
        rows = []
        for distance, _, wall in feet(at):
            if distance < agent.top * agent.wall_horizon + self.radii[i]:
                own = wall - [at.real, at.imag, at.real, at.imag]
                rows.append(
                    wall_plane(own[0], own[1], own[2], own[3], self.radii[i], agent.wall_horizon, v.real, v.imag)
                )
        n_walls = len(rows)
        bodies = [
            (self.at[j], self.v[j], self.radii[j], self.crowd.agents[j].kind == ORCA and not self.is_still(j))
            for j in self.near(i)
        ]
        if agent.yields > 0.0 and abs(z(*self.robot[:2]) - at) < agent.reach:
            bodies.insert(0, (z(*self.robot[:2]), z(*self.robot[2:4]), float(self.robot[4]), False))
        for place, velocity, radius, gives in bodies:
            to, ahead = place - at, v - velocity
            reach = self.radii[i] + radius + agent.margin * (2 if gives else 1)
            ux, uy, nx, ny = half_plane(to.real, to.imag, ahead.real, ahead.imag, reach, agent.horizon, 0.1)
            share = (
                0.5
                if gives
                else (agent.yields if (place, velocity) == (z(*self.robot[:2]), z(*self.robot[2:4])) else 1.0)
            )
            rows.append((nx, ny, (v.real + share * ux) * nx + (v.imag + share * uy) * ny))
        return np.array(rows).reshape(-1, 3), n_walls


def best(planes: Floats, want: complex, top: float) -> complex | None:
    """Return the permitted velocity nearest to the wanted one, of all corners and feet; None if there is none."""
    n, b = planes[:, 0] + 1j * planes[:, 1], planes[:, 2]
    candidates = [want if abs(want) <= top else want * top / abs(want)]
    for k in range(len(b)):
        candidates.append(want + n[k] * (b[k] - (want * n[k].conjugate()).real))
        if abs(b[k]) < top:
            half = math.sqrt(top * top - b[k] * b[k])
            candidates += [n[k] * (b[k] + 1j * half), n[k] * (b[k] - 1j * half)]
    for k, m in itertools.combinations(range(len(b)), 2):
        cross = (n[k].conjugate() * n[m]).imag
        if abs(cross) > 1e-9:
            candidates.append((n[m] * b[k] - n[k] * b[m]) / (1j * cross))
    permitted = [
        c for c in candidates if abs(c) <= top + 1e-9 and all((c * n.conjugate()).real >= b - 1e-9)
    ]  # fmt: skip
    return min(permitted, key=lambda c: abs(c - want)) if permitted else None


@pytest.mark.parametrize("seed", range(60))
def test_people_decide_and_move_as_the_plain_program_says(seed: int) -> None:
    crowd, robot = picture(seed)
    twin = Twin(crowd, robot)
    before: list[Any] = [(agent.copy(), twin.at[i], twin.v[i]) for i, agent in enumerate(crowd.agents)]
    decisions: list[Any] = []
    for i, agent in enumerate(crowd.agents):
        if agent.kind < 4 or twin.is_still(i):
            decisions.append(None)
        elif agent.kind == ORCA:
            planes, n_walls = twin.planes(i)
            want = wanted(agent, crowd.ways, twin.at[i]) * cmath.rect(1.0, agent.tilt)
            decisions.append((planes, n_walls, want))
        else:
            decisions.append((twin.acceleration(i), twin.contact(i)))
    step_agents(
        crowd.agents, crowd.ways, crowd.obstacles, WALLS, robot[0], robot[1], robot[2], robot[3], robot[4], TICK, 0.01
    )
    for (agent, at, v), decision, after, obstacle in zip(before, decisions, crowd.agents, crowd.obstacles, strict=True):
        if decision is None:
            continue
        if agent.kind == ORCA:
            planes, n_walls, want = decision
            new = best(planes, want, agent.top)
            assert (new is not None) == (
                nearest_permitted(planes, len(planes), agent.top, want.real, want.imag, False)[0] == len(planes)
            )
            if new is None:
                continue
            change = new - v
            if abs(change) > agent.acceleration * 0.05:
                new = v + change / abs(change) * agent.acceleration * 0.05
        else:
            soft, hard = decision
            assert (after.ax, after.ay) == pytest.approx((soft.real, soft.imag), abs=1e-9, rel=1e-9)
            new = v + (soft + hard) * 0.01
            new *= min(1.0, agent.top / abs(new))
        if feet(at + new * 0.01)[0][0] < obstacle.radius:
            continue  # put back by a wall: below
        assert (after.vx, after.vy) == pytest.approx((new.real, new.imag), abs=1e-8)
        moved = at + new * 0.01
        assert (obstacle.x, obstacle.y) == pytest.approx((moved.real, moved.imag), abs=1e-10)
        assert obstacle.v == pytest.approx(abs(new), abs=1e-8)
        if abs(new) > 1e-6:
            assert math.remainder(obstacle.heading - cmath.phase(new), math.tau) == pytest.approx(0.0, abs=1e-6)
