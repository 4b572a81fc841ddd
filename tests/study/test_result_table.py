"""Results can be asked: by groups, under a condition, with SQL; and other tools read them with their units."""

from __future__ import annotations

import csv
import json
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.data import split
from parcours.data.inputs import InputModel
from parcours.errors import BadRequest
from parcours.study.finding import find
from parcours.study.gate import JudgedResults
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours.study.table_files import sql, write_csv, write_parquet
from parcours.study.tabling import ResultTable, TableColumn, grouped, input_columns, read_parts, read_table
from parcours_navigation.outcomes import Outcome

N = 96


@pytest.fixture(scope="module")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ramp")
    study = find("ramp_system")
    settings = settings_of(study.parameters, {"workers": 1})
    study.run(Request(settings, 1, folder, N), lambda what, done, total: None)
    return folder


@pytest.fixture(scope="module")
def table(ramp: Path) -> ResultTable:
    return read_table(ramp)


def asked(*words: str) -> Any:
    result = CliRunner().invoke(parcours, ["results", *words, "--json"])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return json.loads(result.stdout)


def test_groups_add_up_to_all_cases_and_their_rates_to_the_report(ramp: Path, table: ResultTable) -> None:
    (every,) = asked(str(ramp))
    by_start = asked(str(ramp), "--by", "start")
    assert len(by_start) == 9 and {one["start"] for one in by_start} >= {"0.0.0", "0.1.2", "0.2.4"}
    for name, of in every["rates"].items():
        assert of["cases"] == N == sum(one["rates"][name]["cases"] for one in by_start)
        assert of["count"] == sum(one["rates"][name]["count"] for one in by_start)
    (document,) = find("ramp_system").report({"x": find("ramp_system").read(ramp)}).documents.values()
    assert every["rates"]["stuck"]["count"] == document["outcomes"]["stuck"]  # type: ignore[index]
    blocks = table.by(["v1_block", "planner"])
    assert len(blocks) == 2 and all(planner == "original" for _, planner in blocks)


def test_a_condition_chooses_cases_and_its_words_are_those_of_the_column(table: ResultTable) -> None:
    chosen = table.where("outcome == reached && (travelled > 2.5 || !(v1 > 0.25))")
    reached, far, slow = table["outcome"] == "reached", table["travelled"] > 2.5, table["v1"] <= 0.25
    assert chosen["case"].tolist() == table["case"][reached & (far | slow)].tolist() and 0 < len(chosen) < N
    assert len(chosen.where("verdict == fail")) == 0 == len(table.where("outcome == nothing_of_the_kind"))
    assert len(table.where("stuck == 0")) == N - int(table["stuck"].sum())  # the rate, not the word


def test_pandas_alone_computes_the_reports_table_from_the_parquet(ramp: Path, tmp_path: Path) -> None:
    import pandas as pd

    path = tmp_path / "cases.parquet"
    CliRunner().invoke(parcours, ["results", str(ramp), "--parquet", str(path)], catch_exceptions=False)
    frame = pd.read_parquet(path)
    (document,) = find("ramp_system").report({"x": find("ramp_system").read(ramp)}).documents.values()
    assert isinstance(document, dict)
    counted = frame["outcome"].value_counts()
    assert {name: int(counted.get(name, 0)) for name in document["outcomes"]} == document["outcomes"]
    paper = {
        "reached": frame["to_goal"] < 0.2, "feasible": frame["feasible"] == 1,
        "imminent_collision": frame["n_halts"] > 0, "stuck": frame["halted"] == 1,
    }  # fmt: skip
    assert {name: int(yes.sum()) for name, yes in paper.items()} == {name: document[name] for name in paper}
    for name in ("path_length", "time_to_goal", "min_clearance"):  # quantities, missing values left out
        assert frame[name].median() == pytest.approx(document["measures"][name]["median"])
    duckdb = pytest.importorskip("duckdb")  # the README table: stuck, at the goal, collisions
    query = f"""SELECT sum(halted), count(*) FILTER (to_goal < 0.2), count(*) FILTER (outcome = 'collided'),
                       count(*) FILTER (n_robot_contacts + n_shared_contacts + n_contacts_after > 0) FROM '{path}'"""
    collided = document["outcomes"]["collided"]
    assert duckdb.sql(query).fetchall() == [(document["stuck"], document["reached"], collided, collided)]
    schema = parquet.read_schema(path)
    units = {name: schema.field(name).metadata[b"unit"] for name in ("travelled", "t_end", "heading", "v1")}
    assert units == {"travelled": b"m", "t_end": b"ns", "heading": b"rad", "v1": b"m/s"}
    assert schema.metadata[b"parcours"] == b"results/1"
    kept = json.loads((ramp / "campaign.json").read_bytes())["units"]
    shard = parquet.read_schema(ramp / "shard-000000.parquet")
    assert set(kept) <= set(shard.names) and (kept["t_end"], kept["measures.path_length"]) == ("ns", "m")
    table = read_table(ramp)
    assert table.frame().attrs["units"] == {name: one.unit for name, one in table.columns.items()}


def test_sql_answers_as_the_groups_do_and_reads_no_file(ramp: Path, table: ResultTable, tmp_path: Path) -> None:
    rows = asked(str(ramp), "--sql", "SELECT start, sum(stuck) AS stuck FROM results GROUP BY start ORDER BY start")
    assert {row["start"]: row["stuck"] for row in rows} == {
        start: rates["stuck"].count for (start,), rates in table.by(["start"]).items()
    }
    (tmp_path / "secret.csv").write_text("a\n1\n")
    for query in ("SELECT nothing FROM results", f"SELECT * FROM read_csv('{tmp_path}/secret.csv')"):
        with pytest.raises(BadRequest, match="results-sql"):
            sql([table], query)


def test_parts_give_what_one_table_gives(ramp: Path, table: ResultTable, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("parcours.run.store._PART", 1)  # a shard at a time
    monkeypatch.setattr("parcours.study.table_files._ROW_GROUP", 40)
    rows = np.arange(len(table))
    parts = [replace(table, chosen=rows[k : k + 70]) for k in range(0, len(rows), 70)]
    for keys in ([], ["start"], ["outcome", "v1_block"], ["n_switches"]):
        assert grouped(parts, keys) == table.by(keys)
    write_csv(parts, tmp_path / "parts.csv")
    write_csv([table], tmp_path / "whole.csv")
    assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    write_parquet(parts, tmp_path / "parts.parquet")
    file = parquet.ParquetFile(tmp_path / "parts.parquet")
    assert [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)] == [40, 40, N - 80]
    assert file.read().to_pandas().equals(table.arrow().to_pandas())
    assert sql(parts, "SELECT sum(travelled) FROM results") == sql([table], "SELECT sum(travelled) FROM results")
    assert sum(len(part) for part in read_parts(ramp)) == N


def test_cases_without_a_value_are_one_group() -> None:
    tables = [
        ResultTable(
            {"x": TableColumn(lambda: np.array([2.0, np.nan])), "f": TableColumn(lambda: np.array([1.0, 0.0]))}, ("f",)
        )
        for _ in range(2)
    ]
    (two, of_two), (none, of_none) = grouped(tables, ["x"]).items()
    assert (two, of_two["f"].n, np.isnan(none[0]), of_none["f"].n) == ((2.0,), 2, True, 2)


def test_csv_has_a_line_a_case(ramp: Path, table: ResultTable, tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    where = ["--where", "verdict == fail"]
    CliRunner().invoke(parcours, ["results", str(ramp), *where, "--csv", str(path)], catch_exceptions=False)
    rows = list(csv.DictReader(path.open()))
    failed = table.where("verdict == fail")
    assert [row["case"] for row in rows] == failed["case"].tolist()
    assert [float(row["travelled"]) for row in rows] == failed["travelled"].tolist()


def test_what_cannot_be_asked_is_refused(ramp: Path, table: ResultTable, monkeypatch: pytest.MonkeyPatch) -> None:
    for words, slug in ((["--by", "strat"], "results-column"), (["--by", "travelled"], ""),
                        (["--where", "travelled + 1"], "results-where-form")):  # fmt: skip
        if slug:
            with pytest.raises(BadRequest, match=slug):
                asked(str(ramp), *words)
        else:
            assert len(asked(str(ramp), *words)) <= N
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(BadRequest, match=r"pip install 'parcours\[results\]' \[no-results-extra\]"):
        sql([table], "SELECT 1")


def test_every_study_has_a_table(tmp_path: Path) -> None:
    study = find("examples/lift")
    study.run(Request(settings_of(study.parameters, {}), 1, tmp_path, 12), lambda what, done, total: None)
    found = read_table(tmp_path)
    assert len(found) == 12 and found.by(["verdict"])[("pass",)]["passed"].count == 12


def test_blocks_of_inputs_stand_beside_their_values() -> None:
    inputs = InputModel("inputs", (split("x", "m", [0.0, 1.0, 2.0]), split("n", "1", [0, 4, 9], kind="integer")))
    values = np.array([[0.5, 2.0], [1.5, 8.0], [7.0, 4.0]])
    columns = input_columns(inputs, lambda: values, ["x"])
    assert list(columns) == ["input_x", "input_x_block", "n", "n_block"] and columns["input_x"].unit == "m"
    assert columns["input_x_block"].make().tolist() == ["[0, 1]", "(1, 2]", "outside"]
    assert columns["n"].make().dtype.kind == "i" and set(Outcome)


def test_verdicts_without_reasons_are_those_of_the_cases(ramp: Path) -> None:
    results = find("ramp_system").read(ramp)
    assert isinstance(results, JudgedResults)
    assert results.verdict_counts() == Counter(one.verdict for one in results.cases())
