"""One agent: what it is, what it wants, how it moves; its place lies in its OBSTACLE record."""

from __future__ import annotations

import numpy as np

CONSTANT, WAYPOINTS, WALK, TRACK, FORCE, ORCA = range(6)
"""Kinds: constant velocity, waypoints, random walk, recorded track; people by social force and by ORCA."""

STAND, GO_ON = 0, 1
"""What comes after the end: after the last waypoint (GO_ON: the first one again), before the first and after the last
row of a track (GO_ON: its velocity there), at a wall (constant velocity only; GO_ON: thrown back)."""

CLOSE = 6
"""As many of the others can a body touch at once, if all are of one size."""

AGENT = np.dtype(
    [
        ("kind", "i8"),
        ("obstacle", "i8"),  # number of its OBSTACLE record
        ("group", "i8"),  # who walks together has the same number; -1: alone
        ("ends", "i8"),  # STAND or GO_ON
        ("first", "i8"),  # its rows of `ways`: waypoints (pause, x, y) [s, m, m], or a track (t, x, y)
        ("count", "i8"),  # how many
        ("start", "i8"),  # it stands until then [ns]; a track is as much later
        ("seed", "u8"),  # where its stream starts
        ("speed", "f8"),  # it wants to move at [m/s]
        ("top", "f8"),  # greatest speed [m/s]
        ("heading", "f8"),  # at first [rad]
        ("yields", "f8"),  # how much of the avoiding of the robot it does, 0 .. 1
        # where it is allowed (constant velocity, random walk) [m]
        ("x_low", "f8"),
        ("y_low", "f8"),
        ("x_high", "f8"),
        ("y_high", "f8"),
        # random walk
        ("slowest", "f8"),  # speeds are drawn between slowest and fastest [m/s]
        ("fastest", "f8"),
        ("least", "f8"),  # time between changes is drawn between least and most [s]
        ("most", "f8"),
        ("turn", "f8"),  # heading changes by at most so much [rad]
        ("turn_rate", "f8"),  # at this rate [rad/s]
        # people
        ("arrive", "f8"),  # as near to a waypoint as this counts as reached [m]
        ("reach", "f8"),  # who is farther away is not looked at [m]
        ("nearest", "i8"),  # how many of the others are looked at
        ("relax", "f8"),  # time to take on the wanted velocity [s]
        # by social force
        ("strength", "f8"),  # of the interaction (A) [m/s2]
        ("range", "f8"),  # of the interaction (gamma) [m per unit of relative motion]
        ("ahead", "f8"),  # weight of relative velocity (lambda) [s/m]
        ("slowing", "f8"),  # how soon slowing down fades with the angle (n')
        ("turning", "f8"),  # ... turning aside (n)
        ("side", "f8"),  # preference of a side (epsilon) [rad/m]; above 0: pass on the right
        ("wall_strength", "f8"),  # (a) [m/s2]
        ("wall_range", "f8"),  # (b) [m]
        ("stiffness", "f8"),  # of bodies that overlap [1/s2]
        ("cohesion", "f8"),  # pull towards the middle of the group (beta 2) [m/s2]
        # by ORCA
        ("horizon", "f8"),  # free of collision with others for so long (tau) [s]
        ("wall_horizon", "f8"),  # ... with walls [s]
        ("margin", "f8"),  # its radius is enlarged by it [m]
        ("tilt", "f8"),  # the wanted velocity is turned by it, to break symmetry [rad]
        ("acceleration", "f8"),  # greatest change of velocity [m/s2]; infinite: at once
        # state
        ("vx", "f8"),  # [m/s]
        ("vy", "f8"),
        ("ax", "f8"),  # acceleration until the next decision [m/s2]
        ("ay", "f8"),
        ("push_x", "f8"),  # acceleration by bodies in contact, at this tick [m/s2]
        ("push_y", "f8"),
        ("n_close", "i8"),  # bodies that it may touch before the next decision
        ("close", "i8", (CLOSE,)),  # which: numbers of OBSTACLE records
        ("at", "i8"),  # row of `ways` it goes to; of a track, the row before now
        ("until", "i8"),  # when it moves on from a waypoint; when a random walk changes [ns]
        ("want", "f8"),  # heading that a random walk turns to [rad]
        ("pace", "f8"),  # speed of a random walk until it changes [m/s]
        ("room", "f8"),  # it can go as far as this and touch no wall [m]
        ("stream", "u8", (1,)),
    ]
)
"""One agent. Fields down to `acceleration` say what it is and stay; the others are its state, set by `begin_agents`."""

DECISION = 50_000_000
"""People decide at whole multiples of this time [ns]; places are integrated at every tick."""

FOREVER = 2**62
"""A time that never comes [ns]."""
