"""Shards are columns: every bit comes back, some fields as well as all; what an earlier version wrote is converted."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadResults
from parcours.run.columns import pack, unpack
from parcours.run.converting import convert
from parcours.run.manifest import Campaign, write_manifest
from parcours.run.stops import Stop, read_stop
from parcours.run.store import Rows, create, open_results
from parcours.study.campaign.running import KeptFacts

DTYPE = np.dtype([
    ("number", "<i8"), ("flag", "?"), ("word", "S5"), ("inner", [("x", "<f8"), ("ys", "<f4", (2, 3)), ("z", "<f8")]),
    ("list", [("a", "i1"), ("b", "<i2")], (2,)), ("values", "<f8", (4,)),
])  # fmt: skip


def rows(n: int, seed: int = 1) -> Rows:
    """Any bits: not a number with a payload, negative zero, subnormal numbers."""
    found = np.frombuffer(np.random.default_rng(seed).bytes(n * DTYPE.itemsize), DTYPE).copy()
    found["number"], found["flag"] = np.arange(n), found["number"] % 2 == 0
    return found


@pytest.mark.parametrize("n", [1, 7, 300])
def test_every_bit_of_every_field_comes_back_alone_and_with_the_others(n: int) -> None:
    given = rows(n)
    content = pack(given)
    for names in [DTYPE.names or (), *((name,) for name in DTYPE.names or ()), ("inner", "flag")]:
        found = np.empty(n, [(name, DTYPE[name]) for name in DTYPE.names or () if name in names])
        unpack(content, DTYPE, found)
        assert all(found[name].tobytes() == given[name].tobytes() for name in names)


@pytest.mark.parametrize("damage", [lambda b: b[:-1], lambda b: b + b"x", lambda b: b"x" + b, lambda b: b[:1]])
def test_what_is_not_so_many_rows_is_refused(damage: object) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        unpack(damage(pack(rows(9))), DTYPE, np.empty(9, DTYPE))  # type: ignore[operator]
    for n in (8, 10):
        with pytest.raises(ValueError, match="rows of"):
            unpack(pack(rows(9)), DTYPE, np.empty(n, DTYPE))


def former(folder: Path, campaign: Campaign, finished: list[int]) -> None:
    """Write results as versions up to `campaign/1` did."""
    folder.mkdir()
    write_manifest(folder, campaign)
    signed = json.loads((folder / "campaign.json").read_bytes()) | {"parcours": "campaign/1"}
    plain = json.dumps({key: value for key, value in signed.items() if key != "sha256"}, sort_keys=True)
    signed["sha256"] = hashlib.sha256(plain.encode()).hexdigest()
    (folder / "campaign.json").write_text(json.dumps(signed))
    for shard in finished:
        path, cases = folder / f"shard-{shard:06d}.npy", campaign.cases(shard)
        np.save(path, rows(campaign.n_cases)[cases.start : cases.stop])
        path.with_suffix(".npy.sha256").write_text(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n")


def test_a_part_has_the_fields_that_are_wanted_also_of_a_record_within(tmp_path: Path) -> None:
    campaign = Campaign("toy", "plain", 1, 23, DTYPE, shard_size=5)
    store = create(tmp_path, campaign)
    for shard in campaign.shards:
        cases = campaign.cases(shard)
        store.write(shard, rows(23)[cases.start : cases.stop])
    facts = KeptFacts(store)
    (part,) = facts.parts(lambda name: name not in ("flag", "list", "inner.ys", "inner.z"))
    assert part.dtype.names == ("number", "word", "inner", "values") and part["inner"].dtype.names == ("x",)
    for found, whole in ((part["word"], rows(23)["word"]), (part["inner"]["x"], rows(23)["inner"]["x"])):
        assert found.tobytes() == whole.tobytes()
    assert [one.tobytes() for one in facts.parts()] == [rows(23).tobytes()]


def test_an_earlier_versions_folder_is_refused_with_the_command_that_converts_it_and_killed_anywhere_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, folder = Campaign("toy", "plain", 1, 23, DTYPE, shard_size=5), tmp_path / "a b"
    former(folder, campaign, [0, 1, 2, 4])
    old = json.loads((folder / "campaign.json").read_bytes())["sha256"]
    Stop(("failed ± 1%",), 0, 15).write(folder, campaign)
    stopped = json.loads((folder / "stopped.json").read_bytes()) | {"campaign": old}
    (folder / "stopped.json").write_text(json.dumps(stopped))
    with pytest.raises(BadResults, match=r"parcours results '.*a b' --convert \[results-version\]"):
        open_results(folder)

    def killed(folder: Path, campaign: Campaign) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("parcours.run.converting.write_manifest", killed)
        convert(folder)
    store = convert(folder)
    assert store.campaign == campaign and store.in_order() == [0, 1, 2] and store.has(4)
    assert store.load().tobytes() == rows(23)[:15].tobytes()
    stop = read_stop(folder, campaign)
    assert stop is not None and stop.cases == 15
    assert not list(folder.glob("*.npy*")) and convert(folder).load().tobytes() == store.load().tobytes()


def test_a_damaged_former_shard_is_refused_and_left_where_it_is(tmp_path: Path) -> None:
    former(tmp_path / "f", Campaign("toy", "plain", 1, 10, DTYPE, shard_size=5), [0, 1])
    shard = tmp_path / "f" / "shard-000001.npy"
    shard.write_bytes(shard.read_bytes()[:-3])
    with pytest.raises(BadResults, match=r"shard-000001.npy.*\[shard-damaged\]"):
        convert(tmp_path / "f")
    assert shard.exists() and (tmp_path / "f" / "shard-000000.npy").exists()


def test_duckdb_and_pandas_alone_count_what_the_store_holds(tmp_path: Path) -> None:
    duckdb, pandas = pytest.importorskip("duckdb"), pytest.importorskip("pandas")
    campaign = Campaign("toy", "plain", 1, 23, DTYPE, shard_size=5)
    store = create(tmp_path / "f", campaign)
    for shard in campaign.shards:
        cases = campaign.cases(shard)
        store.write(shard, rows(23)[cases.start : cases.stop])
    shards = tmp_path / "f" / "shard-*.parquet"
    query = f"SELECT count(*), sum(flag::INT) FROM '{shards}'"
    n, flagged = duckdb.sql(query).fetchall()[0]
    assert (n, flagged) == (23, int(rows(23)["flag"].sum()))
    frame = pandas.concat(pandas.read_parquet(path) for path in sorted(shards.parent.glob(shards.name)))
    assert frame["number"].tolist() == list(range(23))
    assert frame["inner.x"].to_numpy().tobytes() == rows(23)["inner"]["x"].tobytes()
