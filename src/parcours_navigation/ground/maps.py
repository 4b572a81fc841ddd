"""Reads and writes occupancy grids in the format of ROS's map_server: a YAML file, and a picture that it names.

A level x of the picture is an occupancy p = (255 - x) / 255, or x / 255 where `negate` is 1. Then by `mode`:

    trinary    p > occupied_thresh: occupied;  p < free_thresh: free;  else unknown
    scale      the same, but unknown where the picture is transparent, and from 1 to 99 in between
    raw        x itself: 0 free .. 100 occupied, more is unknown

A map here knows free, occupied and unknown cells. What `scale` and `raw` put in between counts as unknown: neither
certainly free nor certainly occupied. The picture's lowest row becomes row 0.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.errors import one_of
from parcours.model.documents import Mapping, Node, Scalar, Sequence, read_document
from parcours_navigation.ground.cells import FREE, OCCUPIED, UNKNOWN
from parcours_navigation.ground.outlines import FARTHEST, BadGround
from parcours_navigation.ground.pictures import Grey, read_bytes, read_picture
from parcours_navigation.protocol import Map

MODES = ("trinary", "scale", "raw")

_REQUIRED = ("image", "resolution", "origin")
_OPTIONAL = ("negate", "occupied_thresh", "free_thresh", "mode")


def read_map(path: Path | str) -> Map:
    """Return the map that a file describes.

    Args:
        path: of the YAML file. The picture is looked for beside it.

    Raises:
        BadGround: the file or its picture is missing or not as ROS has it; the message says where and why.
    """
    path = Path(path)
    try:
        text = read_bytes(path, "map-file", 1_000_000).decode()
    except UnicodeDecodeError:
        raise BadGround(str(path), "a map must be UTF-8 text, but this is not", slug="map-file") from None
    root, findings = read_document(text, str(path))
    if findings or not isinstance(root, Mapping):
        said = str(findings[0]) if findings else "it must be a mapping of keys to values"
        raise BadGround(str(path), said, "see docs/ground.md for an example", slug="map-file")
    keys = _keys(root, path)
    resolution = _number(keys, "resolution", path, 0.0, FARTHEST)
    if resolution == 0.0:
        raise _bad(
            keys["resolution"], path, "the side of a cell must be above 0 m, but is 0", "map-resolution", "give metres"
        )
    origin = _origin(keys["origin"], path)
    occupied = _number(keys, "occupied_thresh", path, 0.0, 1.0, 0.65)
    free = _number(keys, "free_thresh", path, 0.0, 1.0, 0.196)
    if free >= occupied:
        rule = f"free_thresh must be below occupied_thresh, but is {free:g}, and the other {occupied:g}"
        raise _bad(keys.get("free_thresh", root), path, rule, "map-key", "exchange them")
    mode = keys.get("mode")
    kind = "trinary" if mode is None else _text(mode, "mode", path)
    if kind not in MODES:
        raise _bad(mode or root, path, f"a mode must be a known one, but is {kind!r}", "map-key", one_of(kind, MODES))
    negate = _negate(keys.get("negate"), path)
    grey, opaque = read_picture(path.parent / _text(keys["image"], "image", path))
    cells = _cells(grey, opaque, kind, negate, occupied, free)
    return Map(np.ascontiguousarray(cells[::-1]), resolution, origin)


def _cells(grey: Grey, opaque: Grey, mode: str, negate: bool, occupied: float, free: float) -> NDArray[np.uint8]:
    """Return what each cell of a picture says."""
    cells = np.full(grey.shape, UNKNOWN, np.uint8)
    if mode == "raw":
        cells[grey == FREE] = FREE
        cells[grey == OCCUPIED] = OCCUPIED
        return cells
    p = (grey if negate else 255 - grey) / 255.0
    cells[p < free] = FREE
    cells[p > occupied] = OCCUPIED
    if mode == "scale":
        cells[opaque < 255] = UNKNOWN
    return cells


def write_map(map_: Map, path: Path | str) -> None:
    """Write a map as a YAML file and, beside it, a raw PGM of the same name; `read_map` gives the same map back.

    Args:
        map_: the map.
        path: of the YAML file; its name ends in .yaml.

    Raises:
        BadGround: the name ends in something else.
    """
    path = Path(path)
    if path.suffix != ".yaml":
        raise BadGround(str(path), f"the file of a map ends in .yaml, but this in {path.suffix!r}", slug="map-file")
    levels = np.full(map_.cells.shape, 205, np.uint8)  # the grey of unknown cells in ROS: 0.196 < p < 0.65
    levels[map_.cells == FREE], levels[map_.cells == OCCUPIED] = 254, 0
    rows, columns = map_.cells.shape
    picture = path.with_suffix(".pgm")
    picture.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + levels[::-1].tobytes())
    x, y = (float(value) for value in map_.origin)
    path.write_text(
        f"image: {picture.name!r}\nresolution: {float(map_.resolution)!r}\norigin: [{x!r}, {y!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )


def _bad(node: Node, path: Path, rule: str, slug: str, remedy: str = "") -> BadGround:
    return BadGround(f"{path}, line {node.line}", rule, remedy, slug=slug)


def _keys(root: Mapping, path: Path) -> dict[str, Node]:
    """Return the nodes of all keys; each must be known, and required ones there."""
    known = (*_REQUIRED, *_OPTIONAL)
    for key, _ in root.items:
        if key.text not in known:
            raise _bad(key, path, f"{key.text!r} is not a key of a map", "map-key", one_of(key.text, known))
    keys = {key.text: node for key, node in root.items}
    for name in _REQUIRED:
        if name not in keys:
            raise _bad(root, path, f"a map must have the key {name!r}, but has not", "map-key", "add it")
    return keys


def _text(node: Node, name: str, path: Path) -> str:
    if not isinstance(node, Scalar) or not node.text or "\0" in node.text:
        raise _bad(node, path, f"{name} must be a word or a number, but is neither", "map-key", "write one")
    return node.text


def _float(node: Node, name: str, path: Path, low: float, high: float) -> float:
    """Return the number that a node is."""
    given = _text(node, name, path)
    try:
        number = float(given)
    except ValueError:
        number = np.nan
    if not low <= number <= high:
        rule = f"{name} must be a number from {low:g} to {high:g}, but is {given[:40]}"
        raise _bad(
            node,
            path,
            rule,
            "map-resolution" if name == "resolution" else "map-key",
            "give a number alone, in SI units",
        )
    return number


def _number(keys: dict[str, Node], name: str, path: Path, low: float, high: float, default: float = 0.0) -> float:
    return _float(keys[name], name, path, low, high) if name in keys else default


def _negate(node: Node | None, path: Path) -> bool:
    if node is None:
        return False
    given = _text(node, "negate", path)
    if given not in ("0", "1", "false", "true"):
        raise _bad(node, path, f"negate must be 0 or 1, but is {given[:40]!r}", "map-key", "write one of them")
    return given in ("1", "true")


def _origin(node: Node, path: Path) -> tuple[float, float]:
    """Return the lower left corner [m]; a map that is turned is refused."""
    if not isinstance(node, Sequence) or len(node.items) not in (2, 3):
        raise _bad(node, path, "origin must be [x, y, yaw], but is not", "map-key", "write three numbers [m, m, rad]")
    given = [_float(item, "origin", path, -FARTHEST, FARTHEST) for item in node.items]
    if given[2:] not in ([], [0.0]):
        rule = f"a map's axes must be those of the world, but its origin is turned by {given[2]:g} rad"
        raise _bad(node, path, rule, "map-turned", "turn the picture, and give yaw 0")
    return given[0], given[1]
