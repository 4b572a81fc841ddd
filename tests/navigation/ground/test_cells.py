"""Cells to edges and back, maps of ROS, and what is refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours_navigation.ground.cells import FREE, OCCUPIED, UNKNOWN, edges
from parcours_navigation.ground.ground import ground_of, lay_ground
from parcours_navigation.ground.maps import read_map, write_map
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.ground.pictures import read_pgm
from parcours_navigation.protocol import Map


@st.composite
def maps(draw: st.DrawFn) -> Map:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    rows, columns = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    values = np.array([FREE, OCCUPIED, UNKNOWN], np.uint8)
    cells = rng.choice(values, (rows, columns), p=draw(st.sampled_from([(0.6, 0.3, 0.1), (0.1, 0.9, 0.0)])))
    origin = draw(st.sampled_from([(0.0, 0.0), (-3.7, 12.1)]))
    return Map(cells, draw(st.sampled_from([0.05, 0.1, 1.0, 0.3])), origin)


@given(maps())
def test_rasterising_the_ground_of_a_map_gives_its_cells_back(map_: Map) -> None:
    back = ground_of(map_).rasterise(map_.resolution)
    assert back.origin == map_.origin
    assert (back.cells == np.where(map_.cells == OCCUPIED, OCCUPIED, FREE)).all()
    solid = ground_of(map_, unknown_is_solid=True).rasterise(map_.resolution)
    assert (solid.cells == np.where(map_.cells == FREE, FREE, OCCUPIED)).all()


@given(maps())
def test_middles_of_cells_are_occupied_where_the_cells_are(map_: Map) -> None:
    rows, columns = np.indices(map_.cells.shape)
    middles = np.column_stack([columns.ravel() + 0.5, rows.ravel() + 0.5]) * map_.resolution + np.array(map_.origin)
    assert (ground_of(map_).occupied(middles) == (map_.cells == OCCUPIED).ravel()).all()


@given(maps())
def test_edges_are_as_long_as_the_border_and_no_two_of_them_could_be_one(map_: Map) -> None:
    occupied = map_.cells == OCCUPIED
    found = edges(occupied, 1.0, (0.0, 0.0))
    framed = np.pad(occupied, 1)
    border = sum(int((framed != np.roll(framed, 1, axis)).sum()) for axis in (0, 1))
    assert np.abs(found[:, 2:] - found[:, :2]).sum() == border
    begins, ends = ({tuple(row) for row in part.tolist()} for part in (found[:, :2], found[:, 2:]))
    assert begins == ends, "outlines are closed"
    directions = {(tuple(row[2:]), tuple(np.sign(row[2:] - row[:2]))) for row in found}
    assert not any((tuple(row[:2]), tuple(np.sign(row[2:] - row[:2]))) in directions for row in found)


def test_a_large_map_has_few_edges() -> None:
    occupied = np.ones((400, 400), bool)
    occupied[10:-10, 10:-10] = False
    assert len(edges(occupied, 0.05, (0.0, 0.0))) == 8


def test_bounds_leave_a_rim_of_occupied_cells_and_a_wall_marks_every_cell_it_passes() -> None:
    map_ = lay_ground([[0.1, 0.1, 0.9, 0.9]], bounds=[0.0, 0.0, 1.0, 1.0]).rasterise(0.25)
    assert map_.origin == (-0.25, -0.25)
    assert (map_.cells[1:-1, 1:-1] == 100 * np.eye(4)).all()
    assert (map_.cells[0] == 100).all() and (map_.cells[:, -1] == 100).all()


def test_a_ground_without_anything_is_a_free_map() -> None:
    assert not lay_ground().rasterise(0.5).cells.any()


@given(maps())
def test_a_written_map_is_read_back(tmp_path_factory: pytest.TempPathFactory, map_: Map) -> None:
    path = tmp_path_factory.mktemp("map") / "a.yaml"
    write_map(map_, path)
    back = read_map(path)
    assert (back.cells == map_.cells).all()
    assert (back.resolution, back.origin) == (map_.resolution, map_.origin)


HEAD = "image: a.pgm\nresolution: 0.1\norigin: [1.0, -2.0, 0.0]\n"
LEVELS = bytes([0, 100, 205, 254])


def written(folder: Path, text: str, picture: bytes = b"P5 2 2 255\n" + LEVELS) -> Path:
    (folder / "a.pgm").write_bytes(picture)
    (folder / "a.yaml").write_text(text, encoding="utf-8")
    return folder / "a.yaml"


@pytest.mark.parametrize(
    ("more", "cells"),
    [
        ("", [[UNKNOWN, FREE], [OCCUPIED, UNKNOWN]]),
        ("negate: 1\n", [[OCCUPIED, OCCUPIED], [FREE, UNKNOWN]]),
        ("mode: raw\n", [[UNKNOWN, UNKNOWN], [FREE, OCCUPIED]]),
        ("occupied_thresh: 0.6\nfree_thresh: 0.25\n", [[FREE, FREE], [OCCUPIED, OCCUPIED]]),
        ("mode: scale\n", [[UNKNOWN, FREE], [OCCUPIED, UNKNOWN]]),
    ],
)
def test_levels_are_cells_by_the_rules_of_ros_and_the_lowest_row_comes_first(
    tmp_path: Path, more: str, cells: list[list[int]]
) -> None:
    map_ = read_map(written(tmp_path, HEAD + more))
    assert map_.cells.tolist() == cells
    assert (map_.resolution, map_.origin) == (0.1, (1.0, -2.0))


@pytest.mark.parametrize(
    "picture",
    [
        b"P2\n# made by hand\n2 2\n255\n0 100\n205 254\n",
        b"P5\n2 2\n65535\n" + bytes([0, 0, 100, 100, 205, 205, 254, 254]),
        b"P5\r\n2 2\r\n255\r\n" + bytes([0, 100, 205, 254]),
        b"P5\n2 2\n255# the last comment\n" + bytes([0, 100, 205, 254]),
    ],
)
def test_plain_and_wide_pgm_say_the_same(tmp_path: Path, picture: bytes) -> None:
    assert read_map(written(tmp_path, HEAD, picture)).cells.tolist() == [[UNKNOWN, FREE], [OCCUPIED, UNKNOWN]]


def png(levels: np.ndarray, colour: int) -> bytes:
    """Return a PNG of 8 bits a channel; colour type 0 is grey, 4 grey and opacity, 2 RGB."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows, columns = levels.shape[:2]
    lines = b"".join(b"\0" + row.tobytes() for row in levels.astype(np.uint8))
    head = struct.pack(">IIBBBBB", columns, rows, 8, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")


def test_png_is_read_in_grey_colour_and_with_opacity(tmp_path: Path) -> None:
    grey = np.array([[0, 100], [205, 254]])
    wanted = [[UNKNOWN, FREE], [OCCUPIED, UNKNOWN]]
    assert read_map(written(tmp_path, HEAD, png(grey, 0))).cells.tolist() == wanted
    assert read_map(written(tmp_path, HEAD, png(np.stack([grey] * 3, axis=-1), 2))).cells.tolist() == wanted
    clear = np.stack([grey, np.array([[0, 255], [255, 255]])], axis=-1)
    scale = read_map(written(tmp_path, HEAD + "mode: scale\n", png(clear, 4)))
    assert scale.cells.tolist() == [[UNKNOWN, FREE], [UNKNOWN, UNKNOWN]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: a.pgm\nresolution: 0.1\n", r"a.yaml, line 1: a map must have the key 'origin'.*\[map-key\]"),
        (HEAD + "free_tresh: 0.1\n", r"line 4: 'free_tresh' is not a key.*did you mean 'free_thresh'.*\[map-key\]"),
        (HEAD.replace("0.1", "-0.1"), r"line 2: resolution must be a number from 0 to 100000, but is -0.1; give"),
        (HEAD.replace("0.1", "0"), r"line 2: the side of a cell must be above 0 m, but is 0; give metres \[map-res"),
        (HEAD.replace("0.1", ".nan"), r"\[map-resolution\]"),
        (HEAD.replace("0.0]", "0.5]"), r"line 3: .*its origin is turned by 0.5 rad; turn the picture.*\[map-turned\]"),
        (HEAD.replace("[1.0, -2.0, 0.0]", "7"), r"line 3: origin must be \[x, y, yaw\], but is not; write"),
        (HEAD.replace("1.0, ", "inf, "), r"line 3: origin must be a number from -100000 to 100000.*\[map-key\]"),
        (HEAD + "mode: ternary\n", r"line 4: a mode must be a known one, but is 'ternary'; did you mean 'trinary'"),
        (HEAD + "negate: 7\n", r"line 4: negate must be 0 or 1, but is '7'; write one of them"),
        (HEAD + "free_thresh: 0.7\n", r"line 4: free_thresh must be below occupied_thresh.*\[map-key\]"),
        (HEAD + "occupied_thresh: 65\n", r"line 4: occupied_thresh must be a number from 0 to 1, but is 65"),
        ("image: &a x\n", r"\[map-file\]"),
        ("- 1\n", r"it must be a mapping.*\[map-file\]"),
        (HEAD.replace("a.pgm", "b.pgm"), r"b.pgm: it must be a file that can be read.*\[map-image\]"),
        (HEAD.replace("a.pgm", "."), r"\[map-image\]"),
        (HEAD.replace("a.pgm", "a.yaml"), r"a.yaml: a picture must be PGM \(P2 or P5\) or PNG.*\[map-image\]"),
    ],
)  # fmt: skip
def test_a_bad_map_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(BadGround, match=message):
        read_map(written(tmp_path, text))


def test_a_map_that_is_not_there_or_not_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadGround, match=r"no.yaml: it must be a file that can be read.*\[map-file\]"):
        read_map(tmp_path / "no.yaml")
    (tmp_path / "a.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(BadGround, match=r"a map must be UTF-8 text, but this is not \[map-file\]"):
        read_map(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    ("picture", "slug"),
    [
        (b"P5", "map-image"),
        (b"P5 2 2", "map-image"),
        (b"P5 2 2 255\n\0\0\0", "map-image"),
        (b"P5 0 2 255\n", "map-image"),
        (b"P5 2 2 99999\n", "map-image"),
        (b"P5 99999 99999 255\n", "map-size"),
        (b"P5 99999999999 1 255\n", "map-image"),
        (b"P5 2 2 9\n" + LEVELS, "map-image"),
        (b"P2 2 2 255\n1 2 3", "map-image"),
        (b"P2 2 2 255\n1 2 3 -4", "map-image"),
        (b"P2 2 2 255\n1 2 3 x", "map-image"),
    ],
)
def test_a_broken_pgm_is_refused(picture: bytes, slug: str) -> None:
    with pytest.raises(BadGround, match=rf"\[{slug}\]"):
        read_pgm(picture, "a.pgm")


@given(st.binary(max_size=60), st.sampled_from([b"P5 ", b"P2 ", b"P5 3 3 255\n", b""]))
def test_no_bytes_lead_the_pgm_parser_to_anything_but_a_refusal(rest: bytes, head: bytes) -> None:
    try:
        read_pgm(head + rest, "a.pgm")
    except BadGround:
        return


@given(st.integers(0, 2**32), st.sampled_from([HEAD, HEAD + "mode: scale\nnegate: 1\nfree_thresh: 0.2\n"]))
def test_no_change_of_a_map_leads_its_reader_to_anything_but_a_refusal(
    tmp_path_factory: pytest.TempPathFactory, seed: int, text: str
) -> None:
    rng = np.random.default_rng(seed)
    changed = list(text)
    for _ in range(rng.integers(1, 4)):
        changed[rng.integers(len(changed))] = str(rng.choice(list("0:-[]{}&*!x\n\0é9e,'\"")))
    good = png(np.zeros((2, 2)), 0)
    picture = bytearray(good if rng.random() < 0.5 else b"P5 2 2 255\n" + LEVELS)
    picture[rng.integers(len(picture))] = rng.integers(256)
    try:
        map_ = read_map(written(tmp_path_factory.mktemp("map"), "".join(changed), bytes(picture)))
    except BadGround:
        return
    assert np.isin(map_.cells, [FREE, OCCUPIED, UNKNOWN]).all() and map_.resolution > 0.0


def test_a_broken_or_huge_png_is_refused(tmp_path: Path) -> None:
    good = png(np.zeros((2, 2)), 0)
    for cut in range(8, len(good)):
        with pytest.raises(BadGround, match=r"\[map-image\]"):
            read_map(written(tmp_path, HEAD, good[:cut]))
    huge = bytearray(good)
    huge[16:24] = struct.pack(">II", 30000, 30000)
    huge[29:33] = struct.pack(">I", zlib.crc32(bytes(huge[12:29])))
    with pytest.raises(BadGround, match=r"30000 x 30000; .*\[map-size\]"):
        read_map(written(tmp_path, HEAD, bytes(huge)))


@pytest.mark.parametrize("resolution", [-0.1, 0.0, float("nan"), float("inf")])
def test_cells_need_a_side(resolution: float) -> None:
    with pytest.raises(BadGround, match=r"must be above 0 m.*\[map-resolution\]"):
        lay_ground(bounds=[0, 0, 1, 1]).rasterise(resolution)
    with pytest.raises(BadGround, match=r"\[map-resolution\]"):
        ground_of(Map(np.zeros((2, 2), np.uint8), resolution, (0.0, 0.0)))


def test_too_many_cells_are_refused() -> None:
    with pytest.raises(BadGround, match=r"at most 4000000 cells, but .*; take a coarser resolution.*\[map-size\]"):
        lay_ground(bounds=[0, 0, 100, 100]).rasterise(0.01)
    with pytest.raises(BadGround, match=r"\[map-size\]"):
        lay_ground(bounds=[0, 0, 100, 100]).rasterise(1e-300)
