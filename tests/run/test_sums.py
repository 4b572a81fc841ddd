"""Sums of columns: few columns of a large shard are read without the rest, and what was changed in them is found."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadResults
from parcours.run.store import Campaign, Store, create
from parcours.run.sums import sum_of, summed_columns

DTYPE = np.dtype([
    ("number", "<i8"), ("few", "<i8"), ("inner", [("x", "<f8"), ("ys", "<f8", (3,))]), ("more", "<f8", (60,)),
])  # fmt: skip


def rows(n: int) -> np.ndarray:
    rng = np.random.default_rng(1)
    found = np.zeros(n, DTYPE)
    found["number"], found["few"] = np.arange(n), rng.integers(0, 9, n)
    found["inner"]["x"], found["more"] = rng.random(n), rng.random((n, 60))
    found["inner"]["ys"] = rng.random((n, 3))
    return found


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setattr("parcours.run.sums._LARGE", 1)
    found = create(tmp_path, Campaign("toy", "plain", 1, 200, DTYPE, shard_size=100))
    for shard in (0, 1):
        found.write(shard, rows(200)[100 * shard : 100 * shard + 100])
    return found


def read(store: Store, names: list[str]) -> np.ndarray:
    return np.concatenate(list(store.parts(names)))


NAMES = ["number", "few", "inner.x", "inner.ys"]


def test_few_columns_are_read_without_the_rest(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = store.load()
    assert whole.tobytes() == rows(200).tobytes()
    monkeypatch.setattr("parcours.run.sums._whole", None)  # nothing sums the whole
    some = read(store, NAMES)
    assert some.dtype.names == ("number", "few", "inner")
    for name in ("number", "few"):
        assert some[name].tobytes() == whole[name].tobytes()
    assert some["inner"].tobytes() == whole["inner"].tobytes()


def test_the_first_line_is_the_sum_of_the_whole_as_ever(store: Store) -> None:
    path = store.path(1)
    first, *others = sum_of(path).read_text().splitlines()
    assert first == f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}"
    assert len(others) == len(NAMES) + 2  # the columns, and the end
    content, at = path.read_bytes(), 4
    for line in others:
        first_byte, size = map(int, line.split()[1].split("+"))
        assert first_byte == at and hashlib.sha256(content[at : at + size]).hexdigest() == line.split()[0]
        at += size
    assert at == len(content)


def test_a_change_is_found_by_whoever_reads_it_and_by_all_who_read_the_whole(store: Store) -> None:
    path, sound = store.path(1), store.path(1).read_bytes()
    places = {[*line.split(), "end"][2]: line.split()[1] for line in sum_of(path).read_text().splitlines()[1:]}
    for name, place in places.items():
        first, size = map(int, place.split("+"))
        for at in (first, first + size // 2, first + size - 1):
            path.write_bytes(sound[:at] + bytes([sound[at] ^ 1]) + sound[at + 1 :])
            if name == "more":
                assert len(read(store, NAMES)) == 200
            else:
                with pytest.raises(BadResults, match=r"shard-000001.*cut short or changed.*\[shard-damaged\]"):
                    read(store, NAMES)
            with pytest.raises(BadResults, match="shard-damaged"):
                read(store, [])
            assert store.damaged() == (1,)
    for wrong in (sound[:-1], sound[:1000], b""):
        path.write_bytes(wrong)
        with pytest.raises(BadResults, match="shard-damaged"):
            read(store, NAMES)


def test_a_shard_in_the_place_of_another_is_found(store: Store) -> None:
    for suffix in ("", ".sha256"):
        name = store.path(1).name + suffix
        store.path(1).with_name(name).write_bytes(store.path(0).with_name(store.path(0).name + suffix).read_bytes())
    with pytest.raises(BadResults, match=r"that is shard-000000\.parquet's"):
        read(store, NAMES)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda lines: lines[:1],  # as earlier versions wrote them
        lambda lines: [line for line in lines if not line.endswith(" few")],
        lambda lines: [lines[0], *(line[:60] for line in lines[1:])],
        lambda lines: [lines[0], "\u00e4\u00f6\u00fc", *lines[1:-1]],
    ],
)
def test_where_sums_of_columns_are_missing_the_whole_is_summed(store: Store, spoil: object) -> None:
    path = store.path(0)
    lines = sum_of(path).read_text().splitlines()
    sum_of(path).write_text("\n".join(spoil(lines)) + "\n")  # type: ignore[operator]
    assert bytes(summed_columns(path, NAMES)) == path.read_bytes()
    assert read(store, NAMES)["few"].tobytes() == rows(200)["few"].tobytes()


def test_sums_that_promise_more_than_there_is_cost_nothing(store: Store) -> None:
    path = store.path(0)
    lines = sum_of(path).read_text().splitlines()
    digest, _, name = lines[1].split()
    sum_of(path).write_text("\n".join([lines[0], f"{digest}  {10**14}+0 {name}", *lines[2:]]) + "\n")
    with pytest.raises(BadResults, match="shard-damaged"):
        read(store, NAMES)


def test_a_small_shard_has_the_sum_of_the_whole_alone(tmp_path: Path) -> None:
    found = create(tmp_path, Campaign("toy", "plain", 1, 100, DTYPE, shard_size=100))
    found.write(0, rows(100))
    assert len(sum_of(found.path(0)).read_text().splitlines()) == 1
    assert len(read(found, NAMES)) == 100
