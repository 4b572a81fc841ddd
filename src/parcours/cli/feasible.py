"""`parcours feasible`: which requirements can be met, by which paths with which values, and why not the others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, count, model_file, print_json, read_altered, seed
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.model.structure import Cefsm
    from parcours.paths.solving import Executability
    from parcours.report.pieces import Table

Decided = tuple[str, str, "Executability"]
"""A component, its machine, and what was found."""


@formerly({"--budget": "--max-work"})
@click.command("feasible")
@model_file
@click.option("--criterion", default="edge", show_default=True, help="What to cover: node, edge, edge-pair, prime, ...")
@click.option("--component", default="", help="Only this component.")
@click.option("--machine", default="", help="Only this machine.")
@count("--max-work", "budget", default=10_000, help="Most work for all machines together; a unit takes about 1 ms.")
@click.option("--anywhere", is_flag=True, help="Let paths end anywhere, not only where a test may end.")
@seed
@as_json
def command(
    file: Path, criterion: str, component: str, machine: str, budget: int, anywhere: bool, seed: int, as_json: bool
) -> None:
    """Decide which requirements of each machine can be met: covered with values, proven infeasible, or undecided.

    A criterion must ask for states or for transitions one straight after the other: node, edge, edge-pair, N-switch,
    prime, complete-round-trip, complete:N, specified:WALKS and all-du-paths do. simple-round-trip, all-defs and
    all-uses are refused, because any of several paths meets them: ask for complete-round-trip or all-du-paths instead.

    Example: parcours feasible model.yaml --criterion edge-pair --component Planner --machine cycles --max-work 30000
    """
    from parcours.cli.progress import progress
    from parcours.errors import require_known
    from parcours.paths.solving import solve
    from parcours.report.terminal import print_table

    cefsm, altered = read_altered(file)
    if component:
        require_known(component, [each.name for each in cefsm.components], "component", slug="unknown-component")
    owners = [each for each in cefsm.components if component in ("", each.name)]
    pairs = [(owner.name, each.name) for owner in owners for each in owner.machines]
    if machine:
        require_known(machine, [name for _, name in pairs], "machine", slug="unknown-machine")
        pairs = [(owner, name) for owner, name in pairs if name == machine]
    found: list[Decided] = []
    left = float(budget)
    with progress() as report:
        for place, (owner, name) in enumerate(pairs):
            share = left / (len(pairs) - place)

            def tell(what: str, done: int, total: int, label: str = f"{owner}.{name}") -> None:
                report(f"{label}: {what}", done, total)

            decided = solve(
                cefsm, owner, name, criterion, share, seed, complete=not anywhere, report=None if as_json else tell
            )
            left = max(0.0, left - decided.spent)
            found.append((owner, name, decided))
    if as_json:
        print_json([_json(cefsm, *each) | {"altered": altered} for each in found])
        return
    for each in found:
        for table in _tables(cefsm, criterion, altered, *each):
            print_table(table)


def _windows(cefsm: Cefsm, owner: str, decided: Executability) -> list[tuple[str, list[tuple[float, float | None]]]]:
    """Return for each path what is wrong with its time, and from when to when each transition can be taken [s]."""
    from parcours.paths.timing import Contradiction, Schedule, is_timed, schedule

    found: list[tuple[str, list[tuple[float, float | None]]]] = []
    for path in decided.paths if is_timed(cefsm.component(owner)) else ():
        timing = schedule(cefsm, path.ids, inputs=path.inputs)
        if isinstance(timing, Schedule):
            ends = [(float(w.earliest), None if w.latest is None else float(w.latest)) for w in timing.windows]
            found.append(("", ends))
        else:
            found.append((str(timing) if isinstance(timing, Contradiction) else timing.reason, []))
    return found


def _json(cefsm: Cefsm, owner: str, machine: str, decided: Executability) -> dict[str, object]:
    number = {path: place for place, path in enumerate(decided.paths)}
    windows = _windows(cefsm, owner, decided)
    paths: list[dict[str, object]] = []
    for place, path in enumerate(decided.paths):
        moves = [{"transition": m.transition, "partner": m.partner, "inputs": dict(m.inputs)} for m in path.moves]
        paths.append({"transitions": path.ids, "ends": path.ends, "moves": moves})
        if windows:
            paths[-1] |= {"windows_s": windows[place][1], "timing": windows[place][0]}
    return {
        "component": owner,
        "machine": machine,
        "covered": [{"requirement": str(each.requirement), "path": number[each.path]} for each in decided.covered],
        "infeasible": [{"requirement": str(each.requirement), "proof": each.proof} for each in decided.infeasible],
        "undecided": [
            {"requirement": str(each.requirement), "reason": each.reason, "spent": each.spent}
            for each in decided.undecided
        ],
        "paths": paths,
    }


def _tables(
    cefsm: Cefsm, criterion: str, altered: str, owner: str, machine: str, decided: Executability
) -> list[Table]:
    from parcours.report.pieces import Cell, Column, Marked, Table

    number = {path: place for place, path in enumerate(decided.paths, start=1)}
    rows: list[tuple[Cell, ...]] = []
    rows += [
        (str(each.requirement), Marked("covered", "good"), f"path {number[each.path]}") for each in decided.covered
    ]
    rows += [(str(e.requirement), Marked("infeasible", "neutral"), "; ".join(e.proof)) for e in decided.infeasible]
    rows += [(str(each.requirement), Marked("undecided", "poor"), each.reason) for each in decided.undecided]
    counts = f"{len(decided.covered)} covered, {len(decided.infeasible)} infeasible, {len(decided.undecided)} undecided"
    columns = (Column("requirement", code=True), Column("verdict"), Column("path, conflict or reason"))
    tables = [Table(f"{owner}.{machine}, {criterion} coverage: {counts}", columns, tuple(rows), altered)]
    windows = _windows(cefsm, owner, decided)
    steps: list[tuple[Cell, ...]] = []
    for place, path in enumerate(decided.paths):
        what, times = windows[place] if windows else ("", [])
        for at, (id, inputs) in enumerate(zip(path.ids, path.inputs, strict=True)):
            values = ", ".join(f"{name.partition('.')[2]} = {_shown(value)}" for name, value in inputs)
            earliest, latest = times[at] if times else (None, None)
            steps.append((place + 1, at + 1, id, values or what, *((earliest, latest) if windows else ())))
    heads = [Column("path"), Column("step"), Column("transition", code=True), Column("values")]
    if windows:
        heads += [Column("earliest", format="g", unit="s"), Column("latest", format="g", unit="s")]
    if steps:
        unfinished = [str(number[path]) for path in decided.paths if not path.ends]
        note = f"Paths {', '.join(unfinished)} end where no test should." if unfinished else ""
        tables.append(Table(f"Paths of {owner}.{machine}", tuple(heads), tuple(steps), note))
    return tables


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else repr(value)
