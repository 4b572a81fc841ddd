"""`parcours data`: input domains, their blocks and drawn rows."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import as_json, print_json, seed


@click.command("data")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--criterion", default="each_choice", show_default=True, help="How blocks are combined.")
@click.option(
    "--rows",
    type=click.IntRange(1, 1_000_000),
    help="How many rows; by default one repetition of the criterion.",
)
@seed
@as_json
def command(file: Path, criterion: str, rows: int | None, seed: int, as_json: bool) -> None:
    """Draw rows of values from the blocks of an input model, and say which blocks they hit.

    Example: parcours data src/parcours/studies/ramp_system/domains.yaml --rows 6
    """
    import numpy as np

    from parcours.data import count, cover, draw, read_input_model, select
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    model = read_input_model(file)
    numbers = np.arange(rows if rows is not None else count(criterion, model.sizes))
    values = draw(model, select(criterion, model.sizes, numbers, seed=seed), numbers, seed=seed)
    hit = cover(model, values)
    if as_json:
        print_json({
            "names": model.names, "units": [d.unit for d in model.domains], "rows": values.tolist(),
            "blocks": hit.n_blocks, "hit": hit.n_hit, "uncovered": hit.uncovered,
        })  # fmt: skip
        return
    columns = (Column("row"), *(Column(d.name, ".3f", unit=d.unit) for d in model.domains))
    print_table(Table(f"{model.name}, {criterion}", columns, tuple((k, *row) for k, row in enumerate(values.tolist()))))
    click.echo(f"{hit.n_hit} of {hit.n_blocks} blocks hit" + "".join(f"\nnot hit: {block}" for block in hit.uncovered))
