"""Writes a replay for other tools: as a GIF for a slide, as MCAP for Foxglove."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from parcours_navigation.study.replay import Replay

FRAMES, RATE = 300, 10
"""Most frames of a GIF, and frames a second, which shows twice real time where the frames suffice."""

_PIXELS = 480  # longer side of a GIF
_PAPER, _INK, _OTHERS, _GOAL = "#ffffff", "#1c2430", "#8d939b", "#00805c"
_FREE, _HALTED = "#0072b2", "#d55e00"
_HEIGHT = 0.6  # of the bodies in Foxglove [m]


def _object(**fields: object) -> dict[str, object]:
    return {"type": "object", "properties": fields, "required": [*fields]}


def _list(of: Mapping[str, object]) -> dict[str, object]:
    return {"type": "array", "items": of}


_NUMBER, _WHOLE, _FLAG, _WORD = ({"type": name} for name in ("number", "integer", "boolean", "string"))
_POINT = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_INK_OF = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_PLACED = _object(position=_POINT, orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER))
_MOMENT = _object(sec=_WHOLE, nsec=_WHOLE)
_ARROW = _object(pose=_PLACED, color=_INK_OF, shaft_length=_NUMBER, shaft_diameter=_NUMBER, head_length=_NUMBER,
                 head_diameter=_NUMBER)  # fmt: skip
_CYLINDER = _object(pose=_PLACED, size=_POINT, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_INK_OF)
_LINES = _object(type=_WHOLE, pose=_PLACED, thickness=_NUMBER, scale_invariant=_FLAG, points=_list(_POINT),
                 color=_INK_OF, colors=_list(_INK_OF), indices=_list(_WHOLE))  # fmt: skip
_ENTITY = _object(
    timestamp=_MOMENT, frame_id=_WORD, id=_WORD, lifetime=_MOMENT, frame_locked=_FLAG,
    metadata=_list(_object(key=_WORD, value=_WORD)), arrows=_list(_ARROW), cylinders=_list(_CYLINDER),
    lines=_list(_LINES), **{name: _list(_object()) for name in ("cubes", "spheres", "triangles", "texts", "models")},
)  # fmt: skip

SCHEMAS = {
    "/scene": ("foxglove.SceneUpdate", _object(deletions=_list(_object()), entities=_list(_ENTITY))),
    "/robot": ("Robot", _object(x=_NUMBER, y=_NUMBER, heading=_NUMBER, speed=_NUMBER, halted=_FLAG)),
    "/clearance": ("Clearance", _object(value=_NUMBER)),
}
"""Channels of an MCAP file, each with the name and the JSON schema of its messages: Foxglove plots fields that a
schema names. The scene is as Foxglove's own schemas have it; what a replay never holds has no fields here."""


def write_gif(replay: Replay, path: Path) -> None:
    """Write a film of the run: ground, others, goal, the robot and its way, time and clearance."""
    from PIL import Image, ImageDraw

    span = float(replay.times[-1] - replay.times[0])
    n = min(FRAMES, max(2, math.ceil(span * RATE / 2) + 1))
    at = np.searchsorted(replay.times, np.linspace(replay.times[0], replay.times[-1], n), "right") - 1
    width, height = replay.arena
    rim = 1.2 * max(replay.robot_radius, replay.goal_tolerance, *replay.obstacle_radii, 0.0)
    scale = _PIXELS / (max(width, height) + 2 * rim)
    size = (math.ceil((width + 2 * rim) * scale), math.ceil((height + 2 * rim) * scale) + 18)

    def place(x: float, y: float) -> tuple[float, float]:
        return (x + rim) * scale, (height + rim - y) * scale

    def disc(draw: Any, x: float, y: float, radius: float, ink: str, fill: str | None = None) -> None:
        (a, b), r = place(x, y), radius * scale
        draw.ellipse((a - r, b - r, a + r, b + r), outline=ink, fill=fill)

    clearance = replay.clearance()
    way = [place(x, y) for x, y in zip(replay.x, replay.y, strict=True)]
    frames = []
    for k in at.tolist():
        frame = Image.new("RGB", size, _PAPER)
        draw = ImageDraw.Draw(frame)
        draw.rectangle((*place(0.0, height), *place(width, 0.0)), outline=_OTHERS)
        disc(draw, *replay.goal, replay.goal_tolerance, _GOAL)
        if replay.ground is not None:
            for a, b, c, d in replay.ground.walls:
                draw.line((place(a, b), place(c, d)), fill=_INK, width=2)
            for x, y, radius in replay.ground.discs:
                disc(draw, x, y, radius, _INK, _OTHERS)
        for x, y, radius in zip(replay.obstacle_x[k], replay.obstacle_y[k], replay.obstacle_radii, strict=True):
            disc(draw, x, y, radius, _INK, _OTHERS)
        if k:
            draw.line(way[: k + 1], fill=_FREE)
        ink = _HALTED if replay.halted[k] else _FREE
        x, y, heading = replay.x[k], replay.y[k], replay.heading[k]
        disc(draw, x, y, replay.robot_radius, ink, ink)
        tip = place(x + replay.robot_radius * math.cos(heading), y + replay.robot_radius * math.sin(heading))
        draw.line((place(x, y), tip), fill=_PAPER, width=2)
        gap = f", clearance {clearance[k]:.2f} m" if math.isfinite(clearance[k]) else ""
        draw.text((4, size[1] - 16), f"{replay.times[k]:.1f} s{gap}", fill=_INK)
        frames.append(frame)
    pauses = [max(20, round(1000 * span / 2 / (n - 1)))] * (n - 1) + [1500]  # [ms]; the end stands still
    frames[0].save(path, format="GIF", save_all=True, append_images=frames[1:], duration=pauses, loop=0)


def write_mcap(replay: Replay, path: Path) -> None:
    """Write the run as MCAP: `/scene` in Foxglove's SceneUpdate for its 3D panel, `/robot` and `/clearance` to plot."""
    from mcap.writer import Writer

    speed = np.hypot(np.gradient(replay.x, replay.times), np.gradient(replay.y, replay.times)) \
        if len(replay.times) > 1 else np.zeros(1)  # fmt: skip
    clearance = replay.clearance()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels = {}
        for topic, (name, fields) in SCHEMAS.items():
            schema = writer.register_schema(name, "jsonschema", json.dumps({"title": name} | fields).encode())
            channels[topic] = writer.register_channel(topic, "json", schema)
        for k, time in enumerate(replay.times.tolist()):
            stamp = round(time * 1e9)
            robot = {"x": replay.x[k], "y": replay.y[k], "heading": replay.heading[k], "speed": speed[k]}
            said: dict[str, object] = {
                "/scene": {"deletions": [], "entities": _entities(replay, k, stamp)},
                "/robot": {name: float(value) for name, value in robot.items()} | {"halted": bool(replay.halted[k])},
            }
            if math.isfinite(clearance[k]):
                said["/clearance"] = {"value": float(clearance[k])}
            for topic, message in said.items():
                writer.add_message(channels[topic], stamp, json.dumps(message, allow_nan=False).encode(), stamp)
        writer.finish()  # type: ignore[no-untyped-call]


def _entities(replay: Replay, k: int, stamp: int) -> list[dict[str, object]]:
    """Return what stands and moves at a sample, as Foxglove's entities; what stands for good comes first, once."""
    red, blue, green, grey = (0.84, 0.37, 0.0), (0.0, 0.45, 0.7), (0.0, 0.5, 0.36), (0.4, 0.42, 0.46)
    others = zip(replay.obstacle_x[k], replay.obstacle_y[k], replay.obstacle_radii, strict=True)
    moving = [_cylinder(x, y, radius, _HEIGHT, grey) for x, y, radius in others]
    ink = red if replay.halted[k] else blue
    robot = _cylinder(replay.x[k], replay.y[k], replay.robot_radius, _HEIGHT / 2, ink)
    arrow = {
        "pose": _pose(replay.x[k], replay.y[k], _HEIGHT / 2, float(replay.heading[k])), "color": _colour(*ink),
        "shaft_length": replay.robot_radius, "shaft_diameter": 0.05, "head_length": 0.1, "head_diameter": 0.1,
    }  # fmt: skip
    found = [_entity("others", stamp, cylinders=moving), _entity("robot", stamp, cylinders=[robot], arrows=[arrow])]
    if k:
        return found
    goal = _cylinder(*replay.goal, replay.goal_tolerance, 0.02, green)
    discs, points = [], []
    if replay.ground is not None:
        discs = [_cylinder(x, y, r, _HEIGHT, grey) for x, y, r in replay.ground.discs]
        for a, b, c, d in replay.ground.walls:
            points += [{"x": a, "y": b, "z": 0.0}, {"x": c, "y": d, "z": 0.0}]
    width, height = replay.arena
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)]
    rim = [{"x": x, "y": y, "z": 0.0} for x, y in corners]
    lines = [_lines(2, points, (0.1, 0.14, 0.19)), _lines(0, rim, grey)]  # a list of pieces, a strip
    return [_entity("ground", stamp, cylinders=[goal, *discs], lines=lines), *found]


def _entity(id: str, stamp: int, **parts: object) -> dict[str, object]:
    names = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    empty: dict[str, object] = {name: [] for name in names}
    return {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}, "frame_id": "world", "id": id,
            "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": False, **empty, **parts}  # fmt: skip


def _cylinder(x: float, y: float, radius: float, tall: float, colour: tuple[float, float, float]) -> dict[str, object]:
    return {"pose": _pose(x, y, tall / 2, 0.0), "size": {"x": 2 * radius, "y": 2 * radius, "z": tall},
            "bottom_scale": 1.0, "top_scale": 1.0, "color": _colour(*colour)}  # fmt: skip


def _lines(kind: int, points: list[dict[str, float]], colour: tuple[float, float, float]) -> dict[str, object]:
    return {"type": kind, "pose": _pose(0.0, 0.0, 0.0, 0.0), "thickness": 2.0, "scale_invariant": True,
            "points": points, "color": _colour(*colour), "colors": [], "indices": []}  # fmt: skip


def _pose(x: float, y: float, z: float, heading: float) -> dict[str, object]:
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    return {"position": {"x": float(x), "y": float(y), "z": z}, "orientation": turned}


def _colour(r: float, g: float, b: float) -> dict[str, float]:
    return {"r": r, "g": g, "b": b, "a": 0.8}
