"""`parcours results`: ask the results of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from parcours.cli.options import LOCATION, PATH, as_json, named_study, print_json, print_rows

if TYPE_CHECKING:
    from parcours.study.tabling import ResultTable


@click.command("results")
@click.argument("folder", type=LOCATION)
@click.option("--by", "keys", multiple=True, metavar="KEY", help="Rates of each value of a column; may be repeated.")
@click.option("--where", metavar="CONDITION", help='Of these cases only: "outcome == stuck && travelled > 2".')
@click.option("--sql", metavar="QUERY", help="What a query of the table `results` gives (DuckDB).")
@click.option("--parquet", type=PATH, metavar="FILE", help="Write the cases as Parquet.")
@click.option("--csv", type=PATH, metavar="FILE", help="Write the cases as CSV.")
@click.option("--convert", is_flag=True, help="First rewrite a campaign that an earlier version kept, in its folder.")
@click.option("--merge", type=LOCATION, metavar="FOLDER", help="Write the campaign there, in few large shards.")
@click.option("--columns", is_flag=True, help="List the columns, with their units.")
@named_study
@as_json
def command(
    folder: Path, keys: tuple[str, ...], where: str | None, sql: str | None, parquet: Path | None, csv: Path | None,
    convert: bool, merge: Path | None, columns: bool, study: str, as_json: bool,
) -> None:  # fmt: skip
    """Ask the results in FOLDER: rates by start vector, block, planner or any other column, or SQL over all cases.

    Example: parcours results out/now --by start

    Example: parcours results out/now --sql "SELECT outcome, count(*), avg(travelled) FROM results GROUP BY ALL"

    Example: parcours results out/now --where "verdict == fail" --parquet failures.parquet
    """
    from parcours.study.table_files import sql as asked
    from parcours.study.table_files import write_csv, write_parquet
    from parcours.study.tabling import read_parts

    if convert:
        from parcours.run.converting import convert as converted

        store = converted(folder)
        click.echo(f"{len(store.in_order())} shards in {folder} are as this version keeps them", err=True)

    if merge is not None:
        from parcours.run.merging import merge as merged

        store = merged(folder, merge)
        click.echo(f"wrote {len(store.shards)} shards of {store.campaign.shard_size} cases to {merge}", err=True)

    def tables() -> Iterator[ResultTable]:
        parts = read_parts(folder, study)
        return (part.where(where) for part in parts) if where else parts

    for file, write in ((parquet, write_parquet), (csv, write_csv)):
        if file is not None:
            write(tables(), file)
            click.echo(f"wrote {file}", err=True)
    if columns:
        table = next(tables())
        listed = [(name, column.unit, name in table.rates) for name, column in table.columns.items()]
        if as_json:
            print_json([dict(zip(("column", "unit", "rate"), one, strict=True)) for one in listed])
        else:
            print_rows("Columns", ("column", "unit", ""), [(*one[:2], "rate" if one[2] else "") for one in listed])
    elif sql:
        names, rows = asked(tables(), sql)
        if as_json:
            print_json([dict(zip(names, map(_json, row), strict=True)) for row in rows])
        else:
            print_rows("Results", names, [tuple(map(_cell, row)) for row in rows])
    elif keys or not (parquet or csv):
        _print_groups(tables(), keys, as_json)


def _print_groups(tables: Iterator[ResultTable], keys: tuple[str, ...], as_json: bool) -> None:
    from parcours.study.tabling import grouped

    groups = grouped(tables, keys)
    if as_json:
        print_json([
            {**dict(zip(keys, map(_json, head), strict=True)),
             "rates": {name: {"count": of.count, "cases": of.n, "share": _json(of.share), "low": of.low,
                              "high": of.high} for name, of in rates.items()}}
            for head, rates in groups.items()
        ])  # fmt: skip
        return
    rows = [
        (*map(_cell, head), max((of.n for of in rates.values()), default=0),
         *(f"{of.share:.1%} [{of.low:.1%}, {of.high:.1%}]" if of.n else None for of in rates.values()))
        for head, rates in groups.items()
    ]  # fmt: skip
    print_rows(
        "Results",
        (*keys, ("cases", ",d"), *next(iter(groups.values()), {})),
        rows,
        "Shares of the cases, Wilson 95 % intervals.",
    )


def _json(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if value is None or isinstance(value, int | float | str) else str(value)
