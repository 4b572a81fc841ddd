"""`parcours abtc`: abstract behavioural test cases of a model, and their serialised execution sequences."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, count, model_file, print_json, print_rows, read_model
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.abtc import AbstractCase, Order
    from parcours.model import Cefsm


@formerly({"--number": "--sample"})
@click.command("abtc")
@model_file
@click.option("--policy", default=None, help="Point policy of the serialisation; by default the model's own.")
@click.option("--policies", is_flag=True, help="Compare the policies: how many cases each one yields.")
@click.option("--count", "counted", is_flag=True, help="Print how many cases there are, without making them.")
@click.option("--case", "wanted", help="Print one case: its notation and its serialised sequence.")
@click.option("--dropped", is_flag=True, help="Print the combinations that have no rendezvous, and why.")
@click.option("--sequences", type=click.Choice(["count", "sample", "all"]),
              help="Serialised execution sequences (APSESCC) of each combination, or of --case.")  # fmt: skip
@count("--sample", "number", default=10, help="How many sequences to sample.")
@count("--seed", default=1, least=0, most=2**63 - 1, help="Seed of the sample.")
@as_json
def command(
    file: Path, policy: str | None, policies: bool, counted: bool, wanted: str | None, dropped: bool,
    sequences: str | None, number: int, seed: int, as_json: bool,
) -> None:  # fmt: skip
    """Print interactions, combinations and abstract test cases, one per line.

    A model without any case is an error: exit code 2, with the line of the model file that would give one.

    Example: parcours abtc model.yaml --case ITP1-tp12.tp21.tp12-0.0.0 --sequences count
    """
    from parcours.abtc import abstract_cases, combinations, find_case, interaction_paths, require_cases

    cefsm = read_model(file)
    if dropped:
        for itp in interaction_paths(cefsm):
            for one in combinations(cefsm, itp).dropped:
                click.echo(str(one))
    if wanted is None:
        require_cases(cefsm, str(file))
    if dropped:
        return
    if policies:
        _compare(cefsm, as_json)
    elif sequences is not None:
        _sequences(_orders(cefsm, wanted), sequences, number, seed, as_json)
    elif wanted is not None:
        _print_case(find_case(cefsm, wanted), as_json)
    elif counted:
        _count(cefsm, policy, as_json)
    else:
        _list(abstract_cases(cefsm, policy), as_json)


def _print_case(case: AbstractCase, as_json: bool) -> None:
    from parcours.abtc import notation, serialise

    events = [str(event) for event in serialise(case)]
    if as_json:
        print_json(_as_data(case) | {"notation": notation(case, case.id), "events": events})
    else:
        click.echo("\n".join([notation(case, case.id), *events]))


def _list(cases: Iterable[AbstractCase], as_json: bool) -> None:
    if as_json:
        _stream(map(_as_data, cases))
        return
    for case in cases:
        click.echo(f"{case.id}  {case.combination}")


def _as_data(case: AbstractCase) -> dict[str, object]:
    return {
        "id": case.id, "interaction": case.interaction.name,
        "combination": str(case.combination), "start_vector": case.start_vector,
    }  # fmt: skip


def _count(cefsm: Cefsm, policy: str | None, as_json: bool) -> None:
    from parcours.abtc import case_counts

    counts = case_counts(cefsm, policy)
    counts["total"] = sum(counts.values())
    if as_json:
        print_json(counts)
    else:
        click.echo("\n".join(f"{name}  {n}" for name, n in counts.items()))


def _compare(cefsm: Cefsm, as_json: bool) -> None:
    from parcours.abtc import POLICIES, case_counts
    from parcours.report.pieces import Cell

    counts = {name: case_counts(cefsm, name) for name in POLICIES}
    if as_json:
        print_json({name: found | {"total": sum(found.values())} for name, found in counts.items()})
        return
    interactions = list(next(iter(counts.values())))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (name, *(found[each] for each in interactions), sum(found.values()), POLICIES[name].doc)
        for name, found in counts.items()
    )
    columns = ("policy", *interactions, "total", "points of a path")
    print_rows(f"Abstract test cases of {cefsm.name} by policy", columns, rows)


def _orders(cefsm: Cefsm, wanted: str | None) -> Iterator[tuple[str, Order]]:
    from parcours.abtc import combinations, find_case, interaction_paths, order_of, order_of_case

    if wanted is not None:
        yield wanted, order_of_case(find_case(cefsm, wanted))
        return
    for itp in interaction_paths(cefsm):
        for combination in combinations(cefsm, itp).kept:
            yield f"{itp.name} {combination}", order_of(cefsm, combination)


def _sequences(orders: Iterator[tuple[str, Order]], mode: str, number: int, seed: int, as_json: bool) -> None:
    from parcours.abtc import count_sequences, sample_sequences, sequences

    if mode == "count":
        counts = ((title, count_sequences(order)) for title, order in orders)
        if as_json:
            _stream({"of": title, "sequences": n} for title, n in counts)
        for title, n in () if as_json else counts:
            click.echo(f"{title}  {n}")
        return
    found = (
        (title, order.spelled(each))
        for title, order in orders
        for each in (sequences(order) if mode == "all" else sample_sequences(order, number, seed))
    )
    if as_json:
        _stream({"of": title, "events": names} for title, names in found)
        return
    for title, names in found:
        click.echo(f"{title}: {', '.join(names)}")


def _stream(items: Iterable[dict[str, object]]) -> None:
    """Print a JSON list item by item: it may be longer than memory."""
    lead = "[\n"
    for item in items:
        click.echo(lead + " " + json.dumps(item, ensure_ascii=False), nl=False)
        lead = ",\n"
    click.echo("[]" if lead == "[\n" else "\n]")
