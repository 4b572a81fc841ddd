"""How a case lies in one array of float64: the clock words, the state of the stage, and then each part of its world.

    clock │ STAGE │ WORLD │ robot as seen │ others as seen │ scan │ obstacles │ body │ agents │ ground │ ... │ track

Passing one plain array to compiled code costs a tenth of passing records. Where each part begins stands in STAGE.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.world import WORLD
from parcours_navigation.others.agent import AGENT
from parcours_navigation.protocol import Map, Task
from parcours_navigation.robots.body import BODY
from parcours_navigation.sensing.detecting import DETECTION, MOST_FALSE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CASE, TIME, LIMIT = range(3)
"""The words for the supervisor: case number, time in the case [ns], longest call allowed [s]."""

PARTS = (
    "seen",
    "scan",
    "obstacles",
    "body",
    "agents",
    "ways",
    "ground",
    "goals",
    "corners",
    "sensor",
    "past",
    "track",
)
"""What follows WORLD and the robot as seen, in this order."""

STAGE = np.dtype(
    [
        ("n", "i8"),  # bodies: obstacles of closed form, and those of agents
        ("n_agents", "i8"),
        ("n_ways", "i8"),  # rows of the agents' ways
        ("n_ground", "i8"),  # words of the packed ground; 0: none
        ("n_goals", "i8"),
        ("n_corners", "i8"),  # of the footprint; 0: a disc
        ("n_beams", "i8"),  # of the scan; 0: none
        ("n_past", "i8"),  # observations kept for late detections; 0: none
        ("n_looks", "i8"),  # observations made
        ("n_seen", "i8"),  # rows of the others as seen
        ("next_goal", "i8"),
        ("t_moving", "i8"),  # last time the robot moved [ns]
        ("n_track", "i8"),  # entries written
        ("most_track", "i8"),  # room for entries
        ("plain", "i8"),  # 1: a unicycle, a disc, obstacles of closed form, perfect sensing, and nothing else
        ("touching", "i8"),  # 1 while the robot is in contact with the ground
        ("ends_on_contact", "i8"),
        ("longest_rest", "i8"),  # the case ends when the robot has not moved for so long [ns]; 0: it goes on
        (
            "within",
            "f8",
            (4,),
        ),  # ... or its place leaves this box: x_low, y_low, x_high, y_high [m]
        ("turn_tolerance", "f8"),  # of the last goal's heading [rad]
        ("scan_first", "f8"),  # direction of the first beam [rad]
        ("scan_step", "f8"),
        ("scan_reach", "f8"),  # [m]
        ("scan_noise", "f8"),  # [m]
        ("scan_dropped", "f8"),  # share of beams
        ("stream", "u8"),  # random numbers of the sensors
        *((f"at_{part}", "i8") for part in PARTS),
    ]
)
"""The stage's own state, and where the parts lie."""

AT_STAGE = 4
AT_WORLD = AT_STAGE + STAGE.itemsize // 8
AT_ROBOT = AT_WORLD + WORLD.itemsize // 8
AT_PARTS = AT_ROBOT + 5
ROW = 8
"""Words of a track entry before the bodies' places: the fields of TRACK, and the gap to the ground."""

_OBSTACLE, _AGENT = OBSTACLE.itemsize // 8, AGENT.itemsize // 8


EVERYWHERE = (-np.inf, -np.inf, np.inf, np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One case's world at its beginning, ready to be moved."""

    obstacles: Record  # array of OBSTACLE, shape (n,): those of closed form, then those of agents
    robot: Record  # array of ROBOT, shape (1,): where it starts, its limits, its radius or that around its footprint
    goals: Floats  # x, y, heading or NaN of each, shape (n_goals, 3)
    tolerance: float  # of each goal [m]
    body: Record = field(default_factory=lambda: np.zeros(1, BODY))  # array of BODY, shape (1,), where it is not plain
    agents: Record = field(default_factory=lambda: np.zeros(0, AGENT))
    ways: Floats = field(default_factory=lambda: np.zeros((0, 3)))  # of the agents
    ground: Floats = field(default_factory=lambda: np.zeros(0))  # packed
    corners: Floats = field(default_factory=lambda: np.zeros((0, 2)))  # of the footprint
    sensor: Record = field(default_factory=lambda: _perfect())  # array of DETECTION, shape (1,)
    scan: tuple[int, float, float, float, float, float] = (0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Beams, first direction [rad], step [rad], reach [m], noise [m], share dropped."""
    turn_tolerance: float = 0.0  # of the last goal's heading [rad]
    solid: bool = False  # whether an obstacle in contact stops for good
    ends_on_contact: bool = False
    longest_rest: int = 0  # the case ends when the robot has not moved for so long [ns]; 0: it goes on
    within: tuple[float, float, float, float] = EVERYWHERE  # ... or its place leaves this box [m]
    plain: bool = True
    stream: int = 0  # state of the sensors' random stream

    def is_like(self, other: Scene | None) -> bool:
        """Whether both are plain and differ in their obstacles only."""
        return (
            other is not None and self.plain and other.plain and self.robot is other.robot and self.goals is other.goals
            and len(self.obstacles) == len(other.obstacles)
        )  # fmt: skip

    def sizes(self, most_track: int) -> tuple[int, ...]:
        """Return how many words each of PARTS takes."""
        n, past = len(self.obstacles), int(self.sensor["late"][0])
        return (6 * (n + MOST_FALSE), self.scan[0], n * _OBSTACLE, BODY.itemsize // 8, len(self.agents) * _AGENT,
                self.ways.size, len(self.ground), self.goals.size, self.corners.size,
                DETECTION.itemsize // 8, 6 * n * (past + 1 if past else 0), most_track * (ROW + 2 * n))  # fmt: skip


@dataclass(frozen=True, slots=True)
class Staged:
    """One case: its world at the beginning, its task but for the seed, and what the planner is shown all along."""

    number: int
    scene: Scene
    task: Task
    end: float  # when the case ends [s]
    first_command: float = 0.0  # forward speed that holds until the first answer [m/s]
    goals: tuple[Task, ...] = ()  # the tasks of further goals, in turn
    map: Map | None = None
    path: Floats | None = None


def _perfect() -> Record:
    sensor = np.zeros(1, DETECTION)
    sensor["perfect"] = 1
    return sensor


def size_of(scene: Scene, most_track: int) -> int:
    """Return how many words a case needs."""
    return AT_PARTS + sum(scene.sizes(most_track))


def lay(memory: Floats, number: int, limit: float, scene: Scene, most_track: int) -> None:
    """Write a scene into the memory of a case; a call of the planner may take `limit` [s]."""
    memory[CASE], memory[TIME], memory[LIMIT] = float(number), 0.0, limit
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)
    stage[:] = np.zeros(1, STAGE)
    at = AT_PARTS
    for part, size in zip(PARTS, scene.sizes(most_track), strict=True):
        stage[f"at_{part}"] = at
        at += size
    for name, value in (
        ("n", len(scene.obstacles)), ("n_agents", len(scene.agents)), ("n_ways", len(scene.ways)),
        ("n_ground", len(scene.ground)),
        ("n_goals", len(scene.goals)), ("n_corners", len(scene.corners)), ("n_beams", scene.scan[0]),
        ("n_past", int(scene.sensor["late"][0])), ("most_track", most_track), ("plain", scene.plain),
        ("ends_on_contact", scene.ends_on_contact), ("longest_rest", scene.longest_rest),
        ("within", scene.within), ("turn_tolerance", scene.turn_tolerance),
        ("scan_first", scene.scan[1]), ("scan_step", scene.scan[2]), ("scan_reach", scene.scan[3]),
        ("scan_noise", scene.scan[4]), ("scan_dropped", scene.scan[5]), ("stream", np.uint64(scene.stream)),
    ):  # fmt: skip
        stage[name] = value
    for part, content in (
        ("obstacles", scene.obstacles.view(np.float64)), ("body", scene.body.view(np.float64)),
        ("agents", scene.agents.view(np.float64)), ("ways", scene.ways.ravel()),
        ("ground", scene.ground), ("goals", scene.goals.ravel()), ("corners", scene.corners.ravel()),
        ("sensor", scene.sensor.view(np.float64)),
    ):  # fmt: skip
        first = int(stage[f"at_{part}"][0])
        memory[first : first + content.size] = content
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)
    world["solid"], world["goal_tolerance"] = scene.solid, scene.tolerance
    world["robot"] = scene.robot
    world["goal_x"], world["goal_y"] = scene.goals[0, 0], scene.goals[0, 1]


def lay_again(memory: Floats, number: int, limit: float, scene: Scene, head: Floats) -> None:
    """Do as `lay` for a plain scene that differs from the one laid before in its obstacles only.

    `head` is what that one had in AT_STAGE .. AT_PARTS.
    """
    memory[CASE], memory[TIME], memory[LIMIT] = float(number), 0.0, limit
    memory[AT_STAGE:AT_PARTS] = head
    first = int(memory[AT_STAGE:AT_WORLD].view(STAGE)["at_obstacles"][0])
    content = scene.obstacles.view(np.float64)
    memory[first : first + content.size] = content


def observed(memory: Floats) -> tuple[Floats, Floats, Floats]:
    """Return views of what a planner sees: the robot (5,), room for the others (n + MOST_FALSE, 6), the scan (n,)."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    seen, scan = int(stage["at_seen"]), int(stage["at_scan"])
    rows = memory[seen:scan].reshape(-1, 6)
    return memory[AT_ROBOT:AT_PARTS], rows, memory[scan : scan + int(stage["n_beams"])]


def recorded(memory: Floats) -> tuple[Floats, int]:
    """Return a view of the track, shape (n, ROW + 2 n_bodies): TRACK's fields, gap to the ground, x, y of each body."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    first, n, row = int(stage["at_track"]), int(stage["n_track"]), ROW + 2 * int(stage["n"])
    return memory[first : first + n * row].reshape(n, row), int(stage["n"])
