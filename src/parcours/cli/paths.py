"""`parcours paths`: what a criterion requires of a model, few paths that meet it, and what recorded runs met."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from parcours.cli.options import PATH, as_json, choice, count, model_file, print_json, print_rows, read_altered
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from collections.abc import Sequence

    from parcours.model.structure import Cefsm
    from parcours.paths.covering import MachineCover
    from parcours.paths.criteria import CoverageCriterion, RequirementLimits
    from parcours.paths.criteria.requirement import CoverageRequirement
    from parcours.paths.measuring import Tours
    from parcours.paths.visiting import Cover, Shape


@formerly(
    {
        "--measure": "--coverage-of",
        "--most": "--max-requirements",
        "--requirements": "--list",
        "--seconds": "--max-work",
        "--work": "--max-work",
    }
)
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
@click.option("--list", "listed", is_flag=True, help="List what is required, and cover nothing.")
@click.option("--coverage-of", "runs", type=PATH, help="Measure the runs in this file, cover nothing.")
@choice("--tours", "direct", "sidetrips", "detours", help="How a run may tour what is required, for --coverage-of.")
@count("--max-requirements", "most", default=1_000_000, help="Most requirements.")
@count(
    "--max-work",
    "work",
    default=16_000_000,
    help="Most steps of the search for the requirements of a machine; some 2 million take 1 s.",
)
@as_json
def command(
    file: Path, criterion: str, component: str, machine: str, composition: bool, walk: bool, max_length: int | None,
    listed: bool, runs: Path | None, tours: Tours, most: int, work: int, as_json: bool,
) -> None:  # fmt: skip
    """Print a small set of short paths through each machine that meets a criterion, and how far it is from the
    optimum.

    A file of runs has one sequence of transitions per line, as `parcours walk --out` writes it.

    Example: parcours paths model.yaml --criterion prime --component Planner
    """
    from parcours.paths.covering import machine_covers, only
    from parcours.paths.criteria import RequirementLimits, parse_criterion

    cefsm, altered = read_altered(file)
    chosen = parse_criterion(criterion)
    limits = RequirementLimits(most, 20 * most, work)
    together = composition or chosen.family == "communication"
    if composition and chosen.family != "communication" and (listed or runs is not None):
        raise click.UsageError("--list and --coverage-of look at machines; leave --composition out")
    if (listed or runs is not None) and (walk or max_length is not None):
        raise click.UsageError("--walk and --max-length shape a cover; --list and --coverage-of make none")
    if runs is None and tours != "direct":
        raise click.UsageError("--tours is for --coverage-of: covers tour directly")
    if together and (component or machine):
        raise click.UsageError("--component and --machine choose among machines; a composition has all of them")
    if runs is not None:
        _measure(cefsm, only(cefsm, component, machine), chosen, limits, runs, tours, as_json)
    elif listed:
        _list(cefsm, only(cefsm, component, machine), chosen, limits, as_json)
    elif together:
        _cover_composition(cefsm, altered, chosen, limits, walk, max_length, as_json)
    else:
        shape: Shape = "open" if walk else "tests"
        covers = machine_covers(
            cefsm, chosen, component=component, machine=machine, shape=shape, max_length=max_length, limits=limits
        )
        _show(covers, chosen, as_json)
        shown = only(cefsm, component, machine).components
        if any(each.guard is not None for owner in shown for each in owner.transitions()):
            note = "these paths follow the graphs; guards may forbid some: parcours feasible finds paths that run"
            click.echo(note, err=True)


def _show(covers: Sequence[MachineCover], criterion: CoverageCriterion, as_json: bool) -> None:
    if as_json:
        documents: list[dict[str, object]] = []
        for each in covers:
            paths = [{"name": path.name, "transitions": path.ids} for path in each.paths]
            whose = {"component": each.component, "machine": each.machine}
            documents.append({**whose, **_bounds(each.required, each), "paths": paths})
        print_json(documents)
        return
    rows = tuple((p.component, p.name, " ".join(p.ids), len(p.ids)) for each in covers for p in each.paths)
    columns = ("component", "path", "transitions", "length")
    print_rows(f"Internal test paths, {criterion} coverage", columns, rows)
    _print_optimum(*(_reached(f"{one.component}.{one.machine}", one.required, one) for one in covers))


def _bounds(required: int, found: MachineCover | Cover) -> dict[str, object]:
    return {"requirements": required, "fewest": found.fewest, "length": found.length, "shortest": found.shortest}


class _Reached(NamedTuple):
    """A cover beside what is possible."""

    machine: str
    requirements: int
    paths: int
    fewest: int
    length: int
    shortest: int


def _reached(name: str, required: int, found: MachineCover | Cover) -> _Reached:
    return _Reached(name, required, len(found.paths), found.fewest, found.length, found.shortest)


def _print_optimum(*rows: _Reached) -> None:
    columns = ("machine", "requirements", "paths", "fewest", "length", "at least", ("gap", ".1%"))
    gaps = ((*row, (row.length - row.shortest) / row.shortest if row.shortest else 0.0) for row in rows)
    note = (
        "No cover has fewer paths than fewest; none with so few paths has fewer transitions than at least. "
        "Where a requirement can be met in several ways, that is true of the shortest one."
    )
    click.echo()
    print_rows("How far from the optimum", columns, gaps, note)


def _cover_composition(
    cefsm: Cefsm,
    altered: str,
    criterion: CoverageCriterion,
    limits: RequirementLimits,
    walk: bool,
    max_length: int | None,
    as_json: bool,
) -> None:
    """Cover the composition, and say what no run of it can meet."""
    from parcours.cli.progress import progress
    from parcours.model.composition import explore
    from parcours.paths.covering import cover_demand
    from parcours.paths.criteria.composed import composition_demand

    with progress() as report:
        space = explore(cefsm, progress=report)
    asked, unmet = composition_demand(space, criterion, limits)
    is_exact = space.exact and not altered
    found = cover_demand(asked, shape="open" if walk else "tests", max_length=max_length)
    paths = [[asked.graph.edges[edge] for edge in path] for path in found.paths]
    if as_json:
        missed = [str(each) for each in unmet]
        known = {"impossible": missed if is_exact else [], "unmet": missed, "exact": is_exact}
        print_json({**_bounds(len(asked.goals) + len(unmet), found), **known, "paths": paths})
        return
    rows = tuple((place, " ".join(path), len(path)) for place, path in enumerate(paths, start=1))
    print_rows(f"Paths of the composition, {criterion} coverage", ("path", "moves", "length"), rows)
    _print_optimum(_reached(cefsm.name, len(asked.goals), found))
    for each in unmet:
        click.echo(f"no run can meet: {each}" if is_exact else f"not met: {each}")
    if unmet and altered:
        click.echo(altered)
    if unmet and space.doubts:
        click.echo(f"not met for the values tried: {', '.join(space.doubts)}")


def _list(cefsm: Cefsm, part: Cefsm, criterion: CoverageCriterion, limits: RequirementLimits, as_json: bool) -> None:
    from parcours.paths import requirements

    needs = requirements(part, criterion, limits=limits)
    if as_json:
        print_json([dataclasses.asdict(need) for need in needs])
        return
    _print_needs(f"{len(needs)} requirements, {criterion} coverage", cefsm, needs)


def _print_needs(title: str, cefsm: Cefsm, needs: Sequence[CoverageRequirement]) -> None:
    rows = ((need.machine or cefsm.name, need.kind, str(need)) for need in needs)
    print_rows(title, ("machine", "kind", "requirement"), rows)


def _measure(
    cefsm: Cefsm,
    part: Cefsm,
    criterion: CoverageCriterion,
    limits: RequirementLimits,
    runs: Path,
    tours: Tours,
    as_json: bool,
) -> None:
    from parcours.paths import measure
    from parcours.paths.measuring.files import read_sequences

    kept = {f"{owner.name}.{one.name}" for owner in part.components for one in owner.machines}
    coverage = measure(cefsm, criterion, *read_sequences(runs), tours=tours, limits=limits)
    met, missed = ([need for need in side if need.machine in {"", *kept}] for side in (coverage.met, coverage.missed))
    if as_json:
        ratio = len(met) / (len(met) + len(missed)) if met or missed else 1.0
        sides = {"met": list(map(dataclasses.asdict, met)), "missed": list(map(dataclasses.asdict, missed))}
        print_json({"criterion": coverage.criterion, "tours": tours, "ratio": ratio, **sides})
        return
    _print_needs(f"Missed, {criterion} coverage, {tours} tours", cefsm, missed)
    click.echo(f"met {len(met)} of {len(met) + len(missed)}")
