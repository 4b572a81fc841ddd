"""`parcours mutate STUDY`: small changes to the system under test, one at a time, and which the tests notice."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click

from parcours.cli.options import FILE, PATH, as_json, choice, count, fail_if, print_json, seed, set_parameters, workers
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.study.mutation.fork_server import Kind
    from parcours.study.mutation.results import MutationResults
    from parcours.study.mutation.running import MutationRequest
    from parcours.study.protocol import Study
    from parcours.study.reproducing import Reruns


@formerly({"--no-data": "--no-data-oracles", "--of": "--target", "--paths": "--criterion", "--twin": "--twin-cases"})
@click.command("mutate")
@click.argument("studies", nargs=-1, required=True, metavar="STUDY...")
@choice("--target", "code", "model", "channels", help="What is changed: Python, transitions, or messages on their way.")
@set_parameters
@count("--sample", least=0, default=200, help="How many mutants, drawn by the seed; 0 for all.")
@click.option("--operators", default="", metavar="NAME,...", help="Mutants of these operators only.")
@click.option("--only", default="", help="Only mutants whose id contains this: a module, a function, an id.")
@click.option(
    "--criterion", "paths", default="", help="Criterion of internal paths, instead of the study's; or random."
)
@click.option("--combine", default="", help="Criterion by which blocks are combined, instead of the study's.")
@click.option(
    "--no-data-oracles", "no_data", is_flag=True, help="Leave out formulas, reference implementations and relations."
)
@click.option("--compare", "comparing", is_flag=True, help="Compare criteria, data oracles off, and random tests.")
@count("--cases", help="How many cases of the study, the first ones.  [default: the study's]")
@count(
    "--twin-cases",
    "twin",
    least=0,
    default=200,
    help="In how many cases an effect is looked for, if the suite shows none.",
)
@click.option("--list", "listed", is_flag=True, help="Print the mutants as diffs and run nothing.")
@seed
@workers
@click.option("--out", type=PATH, help="Folder for the outcomes; resumed if it holds some.")
@click.option("--fresh", is_flag=True, help="Discard the outcomes in that folder, and start again.")
@click.option("--html", type=FILE, help="Write one self-contained page.")
@fail_if
@as_json
def command(
    studies: tuple[str, ...], target: Kind, settings: tuple[str, ...], sample: int, operators: str, only: str,
    paths: str, combine: str, no_data: bool, comparing: bool, cases: int | None, twin: int, listed: bool, seed: int,
    workers: int, out: Path | None, fresh: bool, html: Path | None, fail_if: tuple[str, ...], as_json: bool,
) -> None:  # fmt: skip
    """Change a study's Python components in small ways, one at a time, and see which changes its tests notice.

    The cases of further studies of the same components also run on the mutants.

    Exit code 0, or 1 if a condition of --fail-if holds.

    Example: parcours mutate examples/lift --out out/mutants --fail-if "score < 75%"
    """
    from parcours.cli.progress import progress
    from parcours.errors import BadRequest
    from parcours.report.terminal import print_table
    from parcours.study.finding import find
    from parcours.study.gate import check_condition, parse_condition
    from parcours.study.journal import discard
    from parcours.study.mutation.running import MutationRequest, mutants_of, mutate, repeat, sources_of
    from parcours.study.mutation.suites import COMPARED, WHOLE, Suite, with_suite
    from parcours.study.parameters import pairs_of, settings_of
    from parcours.study.reproducing import Reruns

    found = [find(one) for one in studies]
    suite = Suite(paths, combine, not no_data)
    with_suite(found[0], suite, seed)
    if comparing and (suite != WHOLE or len(found) > 1 or target != "code" or fail_if):
        rule = "one study's code is compared under suites of its own, but other options name a study, a suite or a gate"
        raise BadRequest("--compare", rule, "leave them out", slug="option-study")
    conditions = [parse_condition(text) for text in fail_if]
    pairs = pairs_of(settings)
    names_of = {study.name: {one.name for one in study.parameters} for study in found}
    known = set().union(*names_of.values())
    chosen = [  # what no study knows is refused by the first
        settings_of(
            study.parameters,
            {name: value for name, value in pairs.items() if name in names_of[study.name] or name not in known},
            study.name,
        )
        for study in found
    ]
    names = tuple(one.strip() for one in operators.split(",") if one.strip())
    request = MutationRequest(chosen, target, seed, suite, cases, twin, sample, names, only, workers)
    if listed:
        for mutant in mutants_of(found[0], sources_of(found[0], request.of), request):
            click.echo(f"{mutant.id}  {mutant.place}\n{mutant.diff or mutant.change}\n")
        return
    if out is None:
        raise BadRequest("--out", "outcomes are kept in a folder, but none is named", slug="option-study")
    if comparing and html is not None:
        raise BadRequest(
            "--html", "it is for one suite, but --compare runs several", "leave it out", slug="option-study"
        )
    inner = [one.name for one in COMPARED] if comparing else [one.name for one in found[1:]]
    for folder in (out, *(out / name for name in inner)) if fresh else ():
        discard(folder, ("run.json", "cases.jsonl", "kernels-*"))
    if comparing:
        _compare(found[0], request, out, as_json)
        return
    with progress() as report:
        results, interrupted = mutate(found, request, out, report)
    if as_json:
        print_json(results.document())
    else:
        for table in results.tables():
            print_table(table)
            click.echo()
        for mutant, outcome in results.survivors():
            also = f"; seen by the golden twin: {results.seen_by(outcome)}" if target != "model" else ""
            click.echo(f"survived: {mutant.id} {mutant.place}{also}\n{mutant.diff or mutant.change}\n")
    if html is not None:
        asked = ["parcours", "mutate", *studies, "--target", target, "--seed", str(seed)]
        asked += [word for given in settings for word in ("--set", given)]
        with progress() as report:
            repeated = Reruns("noticed mutants") if interrupted else repeat(found, request, out, report)
        _write_page(results, out, html, asked, repeated)
    if interrupted:
        _interrupted()
    failed = False
    for checked in (check_condition(condition, results) for condition in conditions):
        failed |= checked.failed
        click.echo(f"{'FAILED' if checked.failed else 'ok'}: {checked.name}: {checked.why}", err=True)
    if failed:
        raise click.exceptions.Exit(1)


def _write_page(results: MutationResults, out: Path, html: Path, asked: Sequence[str], repeated: Reruns) -> None:
    from parcours.report.page import to_html
    from parcours.report.writing import write_text
    from parcours.study.journal import read_question
    from parcours.study.mutation.results import mutation_page
    from parcours.study.provenance import texts

    document = read_question(out)
    seed = str(cast("dict[str, object]", document["question"])["seed"])
    made = texts(document.get("made")) | {"seed": seed}
    write_text(html, to_html(mutation_page(results, made, asked, repeated)))
    click.echo(f"wrote {html}", err=True)


def _compare(study: Study, request: MutationRequest, out: Path, as_json: bool) -> None:
    from parcours.cli.progress import progress
    from parcours.errors import BadRequest
    from parcours.report.terminal import print_table
    from parcours.study.components.study import ComponentStudy
    from parcours.study.mutation.comparing import compare

    if not isinstance(study, ComponentStudy):
        rule = f"criteria are for component studies, but {study.name} is another"
        raise BadRequest("--compare", rule, slug="option-study")
    with progress() as report:
        comparison, interrupted = compare(study, request, out, report)
    if as_json:
        print_json(comparison.document())
    else:
        print_table(comparison.table())
    if interrupted:
        _interrupted()


def _interrupted() -> None:
    click.echo("interrupted; run the same command again to judge the rest", err=True)
    raise click.exceptions.Exit(130)
