"""`parcours history`: a file with one line per run, to which CI appends; rates over time."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import FILE, PATH, as_json, named_study, print_json, print_rows


@click.command("history")
@click.argument("file", type=PATH)
@click.argument("folders", nargs=-1, type=PATH)
@click.option("--commit", metavar="TEXT", help="Of the system under test.  [default: of the current repository]")
@click.option(
    "--rate", "rates", multiple=True, default=("failed",), show_default=True, help="To show; may be repeated."
)
@click.option("--html", type=FILE, help="Write one self-contained page.")
@named_study
@as_json
def command(
    file: Path, folders: tuple[Path, ...], commit: str | None, rates: tuple[str, ...], html: Path | None, study: str,
    as_json: bool,
) -> None:  # fmt: skip
    """Append a line to the history in FILE for the results in each of FOLDERS, and show the rates over time.

    Example: parcours history history.jsonl out/now --rate stuck --rate contacts
    """
    from dataclasses import asdict
    from datetime import datetime

    from parcours.errors import BadRequest, one_of
    from parcours.report.pieces import Cell, Column
    from parcours.study.history import append, entry_of, read_history

    new = [entry_of(folder, datetime.now().astimezone(), commit, study) for folder in folders]
    entries = [*(read_history(file) if file.exists() or not new else []), *new]
    known = sorted({rate for one in entries for rate in one.rates})
    for rate in rates if known else ():
        if rate not in known:  # a misspelt one; before anything is appended
            rule = f"must be a rate that some run in the history has, but is {rate!r}"
            raise BadRequest("--rate", rule, one_of(rate, known), slug="history-rate")
    for one in new:
        append(file, one)
    if as_json:
        print_json([asdict(one) for one in entries])
        return
    rows: list[tuple[Cell, ...]] = []
    for one in entries:
        shown = ((rate, one.rate(rate)) for rate in rates)
        cells = (f"{of.share:.2%} [{of.low:.2%}, {of.high:.2%}]" if of is not None else None for _, of in shown)
        rows.append((one.date, one.commit, f"{one.study} {one.label}", one.cases, *cells))
    heads = [Column("date"), Column("commit"), Column("run"), Column("cases", ",d"), *map(Column, rates)]
    print_rows("History", heads, rows, "Shares of the cases, Wilson 95 % intervals.")
    if html is not None:
        from parcours.report.page import to_html
        from parcours.report.pieces import Page, Section, Table
        from parcours.report.rates import intervals
        from parcours.report.writing import write_text

        names = [f"{k}: {one.commit or one.date}" for k, one in enumerate(entries, start=1)]
        drawn = {name: [one.rate(name) for one in entries] for name in rates}
        figure = intervals("Rates over time", names, drawn, "share of the cases")
        section = Section("Rates over time", "", (Table("History", tuple(heads), tuple(rows)), figure))
        write_text(html, to_html(Page("History", str(file), (), (section,))))
        click.echo(f"wrote {html}", err=True)
