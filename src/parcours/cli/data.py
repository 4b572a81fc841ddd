"""`parcours data`: rows from an input model, the coverage of tables, where values land, PICT models in and out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from parcours.cli.options import PATH, as_json, count, data_file, print_json, print_rows, seed, set_parameters
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from parcours.data import InputModel
    from parcours.data.choosing import RowSelection
    from parcours.data.formats import DataReading
    from parcours.study.components.landing import Landing


@click.group("data")
def command() -> None:
    """Rows of test data from input models, and what any table of data covers.

    Example: parcours data draw domains.yaml --combine pairwise
    """


@formerly({"--budget": "--max-time", "--criterion": "--combine", "--must": "--include", "--rows": "--cases"})
@command.command("draw")
@data_file
@click.option("--combine", "criterion", default="each_choice", show_default=True, help="How blocks are combined.")
@count("--cases", "rows", most=1_000_000, help="How many, a row each; by default one set of the criterion.")
@click.option("--include", "must", type=PATH, help="Table of rows to include; they count towards the criterion.")
@click.option("--boundaries", is_flag=True, help="Values on, just inside and just outside the ends of the blocks.")
@click.option(
    "--max-time",
    "budget",
    type=click.FloatRange(0.0, 86_400.0),
    metavar="SECONDS",
    help="End the search after so much time; by default after a fixed effort.",
)
@seed
@as_json
def draw_rows(
    file: Path, criterion: str, rows: int | None, must: Path | None, boundaries: bool, budget: float | None, seed: int,
    as_json: bool,
) -> None:  # fmt: skip
    """Draw rows of values from the blocks of an input model, and say which blocks they hit.

    With --cases, further sets of the criterion follow the first one, or it is cut off. Exit code 3 if combinations were
    not decided in time.

    Example: parcours data draw domains.yaml --combine 3-wise --max-time 10
    """
    from parcours.cli.progress import progress, say_if_cold
    from parcours.data import cover
    from parcours.data.boundaries import at_boundaries
    from parcours.data.choosing import choose
    from parcours.data.tables import read_table

    reading = _read(file)
    model = at_boundaries(reading.model) if boundaries else reading.model
    if criterion.endswith("wise"):
        say_if_cold()
    with progress() as told:
        table = read_table(must, model, reading.titles) if must else None
        chosen = choose(model, criterion, must=table, budget=budget, seed=seed, progress=told)
    values = chosen.values(seed, rows)
    hit = cover(model, values)
    if as_json:
        print_json({
            "names": model.names, "units": [d.unit for d in model.domains], "rows": _cells(model, values),
            "blocks": hit.n_blocks, "hit": hit.n_hit, "uncovered": hit.uncovered, "criterion": criterion,
            "fewest": chosen.fewest, "negative": chosen.n_negative, "infeasible": chosen.infeasible,
            "undecided": chosen.undecided, "n_undecided": chosen.n_undecided,
            "stages": [{"name": s.name, "rows": s.n_rows} for s in chosen.stages],
        })  # fmt: skip
        raise Exit(3 if chosen.n_undecided else 0)
    _print_rows(chosen, values)
    click.echo(f"{hit.n_hit} of {hit.n_blocks} blocks hit" + "".join(f"\nnot hit: {block}" for block in hit.uncovered))
    raise Exit(3 if chosen.n_undecided else 0)


def _cells(model: InputModel, values: NDArray[np.float64]) -> list[list[float | int | str]]:
    """Return the values row by row, names in place of the numbers of an enumeration."""
    return [
        [
            d.shown(v) if d.kind == "enumeration" else int(v) if d.kind == "integer" else v
            for d, v in zip(model.domains, row, strict=True)
        ]
        for row in values.tolist()
    ]


def _print_rows(chosen: RowSelection, values: NDArray[np.float64]) -> None:
    from parcours.report.pieces import Column

    model = chosen.model
    formats = {"real": ".3f", "angle": ".3f"}
    columns = (Column(d.name, formats.get(d.kind, ""), unit=d.unit if d.unit != "1" else "") for d in model.domains)
    shown = ((number, *row) for number, row in enumerate(_cells(model, values)))
    print_rows(f"{model.name}, {chosen.criterion}", ("row", *columns), shown)
    positive = len(chosen.rows) - chosen.n_negative
    if chosen.n_undecided:
        click.echo(f"{positive} rows; {chosen.n_undecided} combinations not decided within the budget")
    else:
        click.echo(f"{positive} rows satisfy it; no set has fewer than {chosen.fewest}")
    if chosen.n_negative:
        click.echo(f"{chosen.n_negative} more rows are negative tests, each with one invalid value")
    for stage in chosen.stages:
        click.echo(f"  {stage.name}: {stage.n_rows} rows after {stage.seconds:.1f} s")
    for what, found, n in (
        ("forbidden by the rules", chosen.infeasible, len(chosen.infeasible)),
        ("undecided", chosen.undecided, chosen.n_undecided),
    ):
        for words in found[:20]:
            click.echo(f"{what}: {words}")
        if n > 20:
            click.echo(f"{what}: {n - 20} more")


@formerly({"--model": "--data"})
@command.command("measure")
@click.argument("table", type=PATH)
@click.option("--data", "file", required=True, type=PATH, help="Input model with the blocks and rules.")
@count("--strength", default=2, most=6, help="How many inputs are combined.")
@count("--show", default=20, least=0, most=1_000_000, help="How much to list.")
@as_json
def measure_table(table: Path, file: Path, strength: int, show: int, as_json: bool) -> None:
    """Say which combinations of blocks a table of values holds: CSV, JSON Lines, a suite, or `draw --json`.

    With a PICT model, what PICT prints is read too: tabs, its own names, ~ before negative values.

    Example: parcours data measure cases.csv --data domains.yaml --strength 3
    """
    from parcours.data.measuring import measure
    from parcours.data.tables import read_table

    reading = _read(file)
    model = reading.model
    found = measure(read_table(table, model, reading.titles), model, strength, most_shown=show)
    if as_json:
        print_json({
            "strength": found.strength, "rows": found.n_rows, "counted": found.n_counted, "wanted": found.n_wanted,
            "held": found.n_held, "share": found.share, "forbidden": found.n_forbidden,
            "missing": found.missing, "uncounted": [{"row": row, "reason": why} for row, why in found.uncounted],
        })  # fmt: skip
        return
    click.echo(
        f"{found.n_held} of {found.n_wanted} combinations of {strength} inputs held ({found.share:.2%}),"
        f" {found.n_forbidden} more are forbidden by the rules; {found.n_counted} of {found.n_rows} rows count"
    )
    for row, why in found.uncounted:
        click.echo(f"row {row} does not count: {why}")
    for words in found.missing:
        click.echo(f"missing: {words}")
    if found.n_missing > len(found.missing):
        click.echo(f"missing: {found.n_missing - len(found.missing)} more")


@command.command("criteria")
@data_file
@as_json
def compare_criteria(file: Path, as_json: bool) -> None:
    """Print how many rows each combination criterion takes, and the least possible number.

    Example: parcours data criteria domains.yaml
    """
    from parcours.cli.progress import say_if_cold
    from parcours.data.choosing import set_size

    model = _read(file).model
    say_if_cold()
    names = ["each_choice", "base_choice", "pairwise", "3-wise", "all_combinations"]
    if any(len(domain.bases) > 1 for domain in model.domains):
        names.insert(2, "multiple_base_choice")
    sizes = [(name, *set_size(model, name)) for name in names]
    if as_json:
        print_json([{"criterion": name, "rows": rows, "fewest": fewest} for name, rows, fewest in sizes])
        return
    title = f"{model.name}: {len(model.domains)} inputs, {sum(model.sizes)} blocks"
    print_rows(title, ("criterion", ("rows", ",d"), ("fewest", ",d")), sizes)


@command.command("landing")
@click.argument("study")
@count("--cases", most=1_000_000, help="How many; by default what the criterion needs.")
@set_parameters
@seed
@as_json
def find_landing(study: str, cases: int | None, settings: tuple[str, ...], seed: int, as_json: bool) -> None:
    """Say which blocks of a component study's test data change a message that a component receives.

    Each case is executed in simulated time, and again with one value replaced by one of another block. What changes
    nothing is listed by name, with the abstract cases that it does not affect, and further cases that it does.

    Example: parcours data landing examples/lift
    """
    from parcours.cli.progress import progress
    from parcours.study.components.landing import landing_of
    from parcours.study.finding import find_components
    from parcours.study.parameters import pairs_of, settings_of

    found = find_components(study)
    chosen = settings_of(found.parameters, pairs_of(settings), found.name)
    with progress() as report:
        landing = landing_of(found, found.plan(seed, cases), chosen, report)
    if as_json:
        print_json({
            "study": found.name,
            "blocks": [{"block": landing.name(spot), "abstract_cases": landing.abstracts(spot)}
                       for spot in landing.spots],
            "unreached": landing.unreached, "further": landing.further, "undecided": landing.undecided,
            "felt": [{"inputs": names, "rows": landing.rows(names), "abstract_cases": ids}
                     for names, ids in landing.groups.items()],
        })  # fmt: skip
        return
    _print_landing(found.name, landing)


def _print_landing(study: str, landing: Landing) -> None:
    n = len(landing.of)
    rows = [(landing.name(spot), sum(spot in one.held for one in landing.of.values()), len(landing.abstracts(spot)))
            for spot in landing.spots]  # fmt: skip
    print_rows(f"{study}: {n} abstract cases", ("block", ("drawn in", ",d"), ("lands in", ",d")), rows)
    groups = ((", ".join(names) or "no input", len(ids), landing.rows(names)) for names, ids in landing.groups.items())
    heads = ("inputs that are felt", ("by abstract cases", ",d"), ("rows they need", ",d"))
    print_rows("An input that no component feels need not be combined", heads, groups)
    hit = len(landing.spots) - len(landing.unreached)
    click.echo(
        f"{hit} of {len(landing.spots)} blocks change a message that a component receives;"
        f" of {n * len(landing.spots)} pairs of abstract case and block {landing.n_pairs} do"
    )
    for block in landing.unreached:
        click.echo(f"reaches nothing: {block}")
    for id in landing.further:
        click.echo(f"further case in which blocks land: {id}")
    for id, why in landing.undecided.items():
        click.echo(f"undecided: {id}: {why}")


@command.command("convert")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
def convert(source: Path, target: Path) -> None:
    """Turn a PICT model (.pict, .txt) into an input model (.yaml, .yml), or back, and report what is lost.

    Example: parcours data convert printer.pict printer.yaml
    """
    from parcours.data.formats import read_data, write_data
    from parcours.run.atomic import write_atomically

    reading = read_data(source)
    model, written = reading.model, write_data(reading.model, target)
    write_atomically(target, written.text.encode())
    counts = f"{len(model.domains)} inputs, {sum(model.sizes)} blocks, {len(model.constraints)} constraints"
    click.echo(f"{target}: {counts}")
    for loss in (*reading.losses, *written.losses):
        click.echo(f"lost: {loss}")


def _read(path: Path) -> DataReading:
    """Return the input model of a file; what it lacks of the file is reported on standard error."""
    from parcours.data.formats import read_data

    reading = read_data(path)
    for loss in reading.losses:
        click.echo(f"lost: {loss}", err=True)
    return reading
