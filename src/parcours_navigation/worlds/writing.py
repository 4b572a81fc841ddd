"""One case of a world, or of the paper's arena, as a world file that has this case only.

What is drawn stands there as numbers: values of inputs, and obstacles of closed form where they begin. Agents keep
their entry, since what they do is drawn along with the case's number; `only` says which of them are there.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from parcours.kernels import Record
from parcours_navigation.worlds.file import FORMAT, World, parse_world
from parcours_navigation.worlds.plan import WorldPlan

Data = dict[str, Any]


def case_data(plan: WorldPlan, folder: Path, closed: Record, time_limit: float) -> Data:
    """Return a case as data of a world file.

    Args:
        plan: what the world is made of in this case.
        folder: in which the files lie that it names.
        closed: its obstacles of closed form, array of OBSTACLE.
        time_limit: when the case ends [s].
    """
    data: Data = _plain(dataclasses.replace(plan, others=()))
    data.setdefault("task", {})["time_limit"] = time_limit
    data["others"] = [_obstacle(one) for one in closed]
    for entry in plan.others:
        if entry.get("motion") in ("stop-move-stop", "paper") or not entry.get("number", 1):
            continue
        entry = {name: _plain(value) for name, value in entry.items()}
        if "tracks" in entry:
            entry["tracks"] = str(folder / entry["tracks"])
        elif entry.get("number", 1) > 1:
            entry["only"] = [*range(int(entry["number"]))]
        data["others"].append(entry)
    if plan.ground.map:
        data["ground"]["map"] = str(folder / plan.ground.map)
    return data


def _obstacle(one: np.void) -> Data:
    found: Data = {
        "motion": "stop-move-stop", "number": 1, "radius": float(one["radius"]),
        "places": [[float(one["x0"]), float(one["y0"])]],
    }  # fmt: skip
    waits, moves = int(one["start"]) * 1e-9, (int(one["stop"]) - int(one["start"])) * 1e-9
    drawn = (("heading", one["heading0"]), ("speed", one["speed"]), ("turn", one["turn"]), ("waits", waits),
             ("moves", moves))  # fmt: skip
    found |= {name: float(value) for name, value in drawn}
    return found | ({"announced": int(one["announced"]) * 1e-9} if one["announced"] else {})


def _plain(value: Any) -> Any:
    """Return values as mappings, lists, numbers and texts, without fields that have their defaults."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = {}
        for one in dataclasses.fields(value):
            own = getattr(value, one.name)
            default = one.default if one.default_factory is dataclasses.MISSING else one.default_factory()
            if own != default:
                found[one.name] = _plain(own)
        return found
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


def world_text(name: str, doc: str, data: Data) -> str:
    """Return data as the text of a world file.

    >>> print(world_text("one", "a disc", {"task": {"start": [0, 0, 0.25]}, "others": [{"motion": "orca"}]}), end="")
    parcours: world/1
    name: one
    doc: "a disc"
    task: {start: [0, 0, 0.25]}
    others:
      - {motion: orca}
    """
    lines = [f"parcours: {FORMAT}", f"name: {name}", f"doc: {json.dumps(doc, ensure_ascii=False)}"]
    for key, value in data.items():
        if key == "others":
            lines += ["others:", *(f"  - {_flow(one)}" for one in value)] if value else []
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and np.isfinite(value):
        return np.format_float_positional(value, trim="-")
    if isinstance(value, int | float):
        return str(value)
    text = str(value)
    return text if text.replace("-", "").isalnum() else json.dumps(text, ensure_ascii=False)


def made_world(name: str, doc: str, data: Data, folder: Path) -> World:
    """Return the world that data describe. Raises BadWorld if they make none."""
    return parse_world(world_text(name, doc, data), f"{name}.yaml", folder)
