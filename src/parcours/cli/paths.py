"""`parcours paths`: what a criterion requires of a model, few paths that meet it, and what recorded runs met."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, model_file, print_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from parcours.model.structure import Cefsm
    from parcours.paths.covering import MachineCover
    from parcours.paths.criteria import Criterion, Limits
    from parcours.paths.measuring import Tours
    from parcours.report.pieces import Table


@click.command("paths")
@model_file
@click.option(
    "--criterion",
    default="edge",
    show_default=True,
    help="node, edge, edge-pair, 2-switch, prime, simple-round-trip, complete-round-trip, complete:5, "
    "'specified:t1 t2, t3', all-defs, all-uses, all-du-paths, channel, message, rendezvous.",
)
@click.option("--component", default="", help="Only this component.")
@click.option("--machine", default="", help="Only this machine.")
@click.option("--composition", is_flag=True, help="Cover all components together; criteria over channels always do.")
@click.option("--walk", is_flag=True, help="One walk that ends anywhere, instead of tests that end in final states.")
@click.option("--max-length", type=click.IntRange(1), help="Most transitions of a path.")
@click.option("--requirements", "listed", is_flag=True, help="List what is required, and cover nothing.")
@click.option(
    "--measure", "runs", type=click.Path(path_type=Path), help="Measure the runs in this file, cover nothing."
)
@click.option(
    "--tours",
    type=click.Choice(["direct", "sidetrips", "detours"]),
    default="direct",
    show_default=True,
    help="How a run may tour what is required, for --measure.",
)
@click.option("--most", type=click.IntRange(1), default=1_000_000, show_default=True, help="Most requirements.")
@click.option(
    "--seconds",
    type=click.FloatRange(0.0, min_open=True),
    default=8.0,
    show_default=True,
    help="Longest search for the requirements of a machine [s].",
)
@as_json
def command(
    file: Path, criterion: str, component: str, machine: str, composition: bool, walk: bool, max_length: int | None,
    listed: bool, runs: Path | None, tours: Tours, most: int, seconds: float, as_json: bool,
) -> None:  # fmt: skip
    """Print few short paths through each machine that meet a criterion, and how far they are from the optimum.

    A file of runs has one sequence of transitions a line; what `parcours walk --out` writes is read, too.

    Example: parcours paths model.yaml --criterion prime --component Planner
    """
    from parcours.model.formats import read_any
    from parcours.paths.covering import machine_covers
    from parcours.paths.criteria import Limits, parse_criterion

    reading = read_any(file)
    for loss in reading.losses:
        click.echo(f"not kept: {loss}", err=True)
    chosen = parse_criterion(criterion)
    limits = Limits(most, 20 * most, seconds)
    together = composition or chosen.family == "communication"
    if composition and chosen.family != "communication" and (listed or runs is not None):
        raise click.UsageError("--requirements and --measure look at machines; leave --composition out")
    if (listed or runs is not None) and (walk or max_length is not None):
        raise click.UsageError("--walk and --max-length shape a cover; --requirements and --measure make none")
    if runs is None and tours != "direct":
        raise click.UsageError("--tours is for --measure: covers tour directly")
    if together and (component or machine):
        raise click.UsageError("--component and --machine choose among machines; a composition has all of them")
    if runs is not None:
        _measure(reading.cefsm, chosen, limits, runs, tours, component, machine, as_json)
    elif listed:
        _list(reading.cefsm, chosen, limits, component, machine, as_json)
    elif together:
        _cover_composition(reading.cefsm, chosen, limits, walk, max_length, as_json)
    else:
        _show(
            machine_covers(
                reading.cefsm, chosen, component=component, machine=machine,
                shape="open" if walk else "tests", max_length=max_length, limits=limits,
            ),
            chosen, as_json,
        )  # fmt: skip


def _show(covers: Sequence[MachineCover], criterion: Criterion, as_json: bool) -> None:
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    if as_json:
        print_json(
            [
                {
                    "component": each.component,
                    "machine": each.machine,
                    "requirements": each.required,
                    "fewest": each.fewest,
                    "length": each.length,
                    "shortest": each.shortest,
                    "paths": [{"name": path.name, "transitions": path.ids} for path in each.paths],
                }
                for each in covers
            ]
        )
        return
    rows = tuple((p.component, p.name, " ".join(p.ids), len(p.ids)) for each in covers for p in each.paths)
    columns = (Column("component"), Column("path"), Column("transitions"), Column("length"))
    print_table(Table(f"Internal test paths, {criterion} coverage", columns, rows))
    click.echo()
    print_table(
        _optimum(
            [
                (
                    f"{each.component}.{each.machine}",
                    each.required,
                    len(each.paths),
                    each.fewest,
                    each.length,
                    each.shortest,
                )
                for each in covers
            ]
        )
    )


def _optimum(rows: Sequence[tuple[str, int, int, int, int, int]]) -> Table:
    """Return the table of what was reached beside what is possible."""
    from parcours.report.pieces import Column, Table

    columns = ("machine", "requirements", "paths", "fewest", "length", "at least", "gap")
    return Table(
        "How far from the optimum",
        tuple(Column(name, format=".1%" if name == "gap" else "") for name in columns),
        tuple((*row, (row[4] - row[5]) / row[5] if row[5] else 0.0) for row in rows),
        note="No cover has fewer paths than fewest; none with so few paths has fewer transitions than at least. "
        "Where a requirement can be met in several ways, that is true of the shortest one.",
    )


def _cover_composition(
    cefsm: Cefsm, criterion: Criterion, limits: Limits, walk: bool, max_length: int | None, as_json: bool
) -> None:
    """Cover the composition, and say what no run of it can meet."""
    from parcours.cli.progress import progress
    from parcours.model.composition import explore
    from parcours.paths.covering import cover_demand
    from parcours.paths.criteria.composed import composition_demand
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    with progress() as report:
        space = explore(cefsm, progress=report)
    asked, unmet = composition_demand(space, criterion, limits)
    found = cover_demand(asked, shape="open" if walk else "tests", max_length=max_length)
    paths = [[asked.graph.edges[edge] for edge in path] for path in found.paths]
    if as_json:
        print_json(
            {
                "requirements": len(asked.goals) + len(unmet),
                "impossible": [str(each) for each in unmet] if space.exact else [],
                "unmet": [str(each) for each in unmet],
                "exact": space.exact,
                "fewest": found.fewest,
                "length": found.length,
                "shortest": found.shortest,
                "paths": paths,
            }
        )
        return
    rows = tuple((place, " ".join(path), len(path)) for place, path in enumerate(paths, start=1))
    columns = (Column("path"), Column("moves"), Column("length"))
    print_table(Table(f"Paths of the composition, {criterion} coverage", columns, rows))
    click.echo()
    reached = (cefsm.name, len(asked.goals), len(paths), found.fewest, found.length, found.shortest)
    print_table(_optimum([reached]))
    for each in unmet:
        click.echo(f"no run can meet: {each}" if space.exact else f"not met: {each}")
    if unmet and space.doubts:
        click.echo(f"not met for the values tried: {', '.join(space.doubts)}")


def _list(cefsm: Cefsm, criterion: Criterion, limits: Limits, component: str, machine: str, as_json: bool) -> None:
    from parcours.paths import requirements
    from parcours.paths.covering import only
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    needs = requirements(only(cefsm, component, machine), criterion, limits=limits)
    if as_json:
        print_json([dataclasses.asdict(need) for need in needs])
        return
    rows = tuple((need.machine or cefsm.name, need.kind, str(need)) for need in needs)
    columns = (Column("machine"), Column("kind"), Column("requirement"))
    print_table(Table(f"{len(needs)} requirements, {criterion} coverage", columns, rows))


def _measure(
    cefsm: Cefsm,
    criterion: Criterion,
    limits: Limits,
    runs: Path,
    tours: Tours,
    component: str,
    machine: str,
    as_json: bool,
) -> None:
    from parcours.paths import measure
    from parcours.paths.covering import only
    from parcours.paths.measuring.files import read_sequences
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    kept = {
        f"{owner.name}.{each.name}" for owner in only(cefsm, component, machine).components for each in owner.machines
    }
    coverage = measure(cefsm, criterion, *read_sequences(runs), tours=tours, limits=limits)
    met, missed = ([need for need in side if need.machine in {"", *kept}] for side in (coverage.met, coverage.missed))
    if as_json:
        print_json(
            {
                "criterion": coverage.criterion,
                "tours": tours,
                "ratio": len(met) / (len(met) + len(missed)) if met or missed else 1.0,
                "met": [dataclasses.asdict(need) for need in met],
                "missed": [dataclasses.asdict(need) for need in missed],
            }
        )
        return
    rows = tuple((need.machine or cefsm.name, need.kind, str(need)) for need in missed)
    columns = (Column("machine"), Column("kind"), Column("requirement"))
    print_table(Table(f"Missed, {criterion} coverage, {tours} tours", columns, rows))
    click.echo(f"met {len(met)} of {len(met) + len(missed)}")
