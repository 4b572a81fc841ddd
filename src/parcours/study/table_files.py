"""Tables of results -> a Parquet or CSV file, written table by table: a million cases need little memory."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadRequest
from parcours.run.atomic import replacing, require_writable
from parcours.study.tabling import ResultTable, imported

if TYPE_CHECKING:
    import pyarrow

_ROW_GROUP = 122_880  # cases; what DuckDB reads best


def write_parquet(tables: Iterable[ResultTable], path: Path) -> None:
    """Write tables of the same columns as one Parquet file, in row groups of 122 880 cases.

    Raises BadRequest: no pyarrow, or no place.
    """
    parquet = imported("pyarrow.parquet")
    require_writable(path.parent)
    groups = _groups(one.arrow() for one in tables)
    first = next(groups)
    with replacing(path) as partial, parquet.ParquetWriter(partial, first.schema, compression="zstd") as writer:
        writer.write_table(first, row_group_size=_ROW_GROUP)
        for group in groups:
            writer.write_table(group, row_group_size=_ROW_GROUP)


def _groups(tables: Iterable[pyarrow.Table]) -> Iterator[pyarrow.Table]:
    """Yield tables joined and cut so that each but the last has as many rows as a row group."""
    pa = imported("pyarrow")
    waiting: list[pyarrow.Table] = []
    for table in tables:
        waiting.append(table)
        if sum(map(len, waiting)) >= _ROW_GROUP:
            joined = pa.concat_tables(waiting)
            yield joined.slice(0, _ROW_GROUP)
            waiting = [joined.slice(_ROW_GROUP)]
    yield pa.concat_tables(waiting)


def write_csv(tables: Iterable[ResultTable], path: Path) -> None:
    """Write tables of the same columns as CSV: their names, then one line per case. Raises BadRequest: no place."""
    require_writable(path.parent)
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for k, table in enumerate(tables):
            if k == 0:
                writer.writerow(table.columns)
            writer.writerows(zip(*(table[name].tolist() for name in table.columns), strict=True))


def sql(tables: Iterable[ResultTable], query: str) -> tuple[list[str], list[tuple[object, ...]]]:
    """Return the names of columns and the rows that a query gives; it reads the table `results`: all tables together.

    Raises BadRequest: duckdb is not installed, or it refuses the query.
    """
    duckdb = imported("duckdb")
    results = imported("pyarrow").concat_tables([one.arrow() for one in tables])
    # One thread adds in the order of the cases: the last digit of a sum is the same each time.
    with duckdb.connect(":memory:", config={"enable_external_access": "false", "threads": 1}) as connection:
        connection.register("results", results)
        try:
            found = connection.execute(query)
            return [one[0] for one in found.description], found.fetchall()
        except duckdb.Error as error:
            raise BadRequest("--sql", f"DuckDB refuses it: {error}", "the table is called results",
                             slug="results-sql") from error  # fmt: skip
