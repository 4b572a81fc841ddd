"""`parcours abtc`: abstract behavioural test cases of a model."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import as_json, model_file, print_json


@click.command("abtc")
@model_file
@click.option("--policy", default=None, help="Point policy of the serialisation; by default the model's own.")
@click.option("--case", "wanted", help="Print one case: its notation and its serialised sequence.")
@click.option("--dropped", is_flag=True, help="Print the combinations that have no rendezvous, and why.")
@as_json
def command(file: Path, policy: str | None, wanted: str | None, dropped: bool, as_json: bool) -> None:
    """Print interactions, combinations and abstract test cases.

    Example: parcours abtc model.yaml --case ITP1-tp12.tp21.tp12-0.0.0
    """
    from parcours.abtc import abstract_cases, combinations, interaction_paths, notation, serialise
    from parcours.errors import BadRequest, one_of
    from parcours.model import read_model
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    cefsm = read_model(file)
    if dropped:
        for itp in interaction_paths(cefsm):
            for one in combinations(cefsm, itp).dropped:
                click.echo(str(one))
        return
    cases = {case.id: case for case in abstract_cases(cefsm, policy)}
    if wanted is not None:
        if wanted not in cases:
            raise BadRequest(
                "abtc",
                f"no case is called {wanted!r}",
                one_of(wanted, list(cases)[:20]),
                slug="unknown-abstract",
            )
        click.echo(notation(cases[wanted], wanted))
        for event in serialise(cases[wanted]):
            click.echo(str(event))
    elif as_json:
        print_json([
            {
                "id": c.id, "interaction": c.interaction.name,
                "combination": str(c.combination), "start_vector": c.start_vector,
            }
            for c in cases.values()
        ])  # fmt: skip
    else:
        rows = tuple((c.interaction.name, str(c.combination), c.id) for c in cases.values())
        columns = (Column("interaction"), Column("combination"), Column("case"))
        print_table(Table(f"{len(rows)} abstract test cases of {cefsm.name}", columns, rows))
