"""`parcours run STUDY`: execute a study and keep its results in a folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from parcours.cli.options import FILE, LOCATION, PATH, as_json, baseline, count, fail_if, seed

if TYPE_CHECKING:
    from parcours.study import Study

_FRESH = (
    "run.json", "cases.jsonl", "components.json", "campaign.json", "shard-*", "live.jsonl", "recordings", "nodes",
    "results.json", "junit.xml", "stopped.json", "reproduced.json",
)  # fmt: skip
"""What runs leave in their folders."""

_BLAS_THREADS = "OPENBLAS_NUM_THREADS"

_COMMON = (
    count("--cases", "n_cases", most=1_000_000_000, help="How many, the first ones.  [default: the study's]"),
    click.option("--case", "chosen", multiple=True, metavar="ID", help="Run this case only; may be repeated."),
    click.option("--cases-from", type=PATH, metavar="FILE", help="Run the cases of this list only, one id per line."),
    click.option(
        "--until",
        multiple=True,
        metavar="RULE",
        help='End once enough is known: "stuck ± 0.5%", "contacts < 1e-4"; may be repeated. Or "pairwise = 100%".',
    ),
    count("--max-cases", most=100_000_000, help="With --until: how many at most.  [default: 1000000]"),
    click.option(
        "--max-time",
        type=click.FloatRange(0.0, min_open=True),
        metavar="SECONDS",
        help="End after so much time, with the cases that are finished.",
    ),
    click.option("--engine", type=click.Choice(["dask"]), help="Run campaigns on a cluster; --out is a shared folder."),
    click.option("--address", metavar="ADDRESS", help="Of its scheduler: tcp://host:8786."),
    seed,
    click.option(
        "--out",
        type=LOCATION,
        required=True,
        help="Folder or bucket (s3://...) for the results; resumed if it holds some.",
    ),
    click.option("--fresh", is_flag=True, help="Discard the results in that folder, and start again."),
    click.option("--junit", type=FILE, help="Write the verdicts as JUnit XML."),
    fail_if,
    baseline,
    as_json,
)


def _no_set(ctx: click.Context, option: click.Parameter, given: tuple[str, ...]) -> None:
    """Say which option is meant by `--set NAME=VALUE`, as other commands have it."""
    from parcours.errors import BadRequest, one_of

    if given:
        name, _, value = given[0].partition("=")
        wanted = "--" + name.strip().replace("_", "-")
        known = [text for one in ctx.command.params if one is not option for text in one.opts]
        remedy = f"write {wanted} {value}".rstrip() if wanted in known else one_of(wanted, known)
        rule = "a run has an option for each parameter, but --set is given"
        raise BadRequest("--set", rule, remedy, slug="option-study")


class _Studies(click.Group):
    """A group whose subcommands are studies, found when they are named."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [one.name for one in _registered()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        _load_numpy()
        from parcours.study.finding import find

        return study_command(find(cmd_name), cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Studies"):
            formatter.write_dl([
                *((one.name, f"of package {one.package}") for one in _registered()),
                ("FOLDER", "with a study.yaml, or that file"),
                ("file.py:NAME", "a study object in a file of yours"),
                ("module:NAME", "the same in a module"),
            ])  # fmt: skip


def _load_numpy() -> None:
    """Load NumPy without threads for its linear algebra, which would spin beside the work for a tenth of a second."""
    if _BLAS_THREADS in os.environ:
        return
    os.environ[_BLAS_THREADS] = "1"
    try:
        import numpy  # noqa: F401
    finally:
        del os.environ[_BLAS_THREADS]  # programs that are started have their own to say


def _registered() -> list[Any]:
    from parcours.study.finding import registered

    return list(registered())


@click.command(cls=_Studies, name="run", subcommand_metavar="STUDY [OPTIONS]")
def command() -> None:
    """Execute a study. Ctrl-C keeps the cases that are finished; the same command continues from there.

    `parcours run STUDY --help` shows the study's own parameters. Exit code 0 if all cases passed, 1 if one failed, 2 if
    the command was used wrongly, 3 if cases are inconclusive and none failed, 130 if interrupted.

    Example: parcours run examples/lift --out out/lift

    Example: parcours run examples/parking --until "failed +- 2%" --max-time 3600 --out out/parking

    Example: parcours run examples/lift --cases 905 --out out/lift --fail-if "failed > 1%" --baseline out/lift-last-week
    """


def study_command(study: Study, given: str) -> click.Command:
    """Return the subcommand of a study: common options, and its own parameters."""
    from parcours.cli.options import parameter_options

    @click.pass_context
    def callback(ctx: click.Context, /, **options: Any) -> None:
        names = [one.name for one in study.parameters]
        settings = {name: options.pop(name) for name in names}
        _run(study, settings, **options)

    help = f"{study.doc or study.name}\n\nExample: parcours run {given} --out out/{study.name}"
    made = click.Command(given, callback=callback, help=help)
    for option in _COMMON:
        made = option(made)
    made.params += parameter_options(study.parameters)
    if all("--set" not in one.opts for one in made.params):
        made.params.append(click.Option(["--set"], multiple=True, hidden=True, expose_value=False, callback=_no_set))
    return made


def _run(
    study: Study, settings: dict[str, Any], n_cases: int | None, chosen: tuple[str, ...], cases_from: Path | None,
    until: tuple[str, ...], max_cases: int | None, max_time: float | None, engine: str | None, address: str | None,
    seed: int, out: Path, fresh: bool, junit: Path | None, fail_if: tuple[str, ...], baseline: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    from parcours.cli.progress import progress, say_if_cold
    from parcours.cli.verdicts import conclude, tell
    from parcours.errors import BadRequest
    from parcours.run.campaign import terminable
    from parcours.run.hosts import isolate
    from parcours.study import Request
    from parcours.study.finding import require_results
    from parcours.study.gate import Naming, parse_condition, require_measures
    from parcours.study.journal import discard
    from parcours.study.selection import ids_of
    from parcours.study.stopping import pairs_wanted, parse_rule

    here = Path.cwd()
    target = out if study.kind == "components" else out.absolute()  # a guest may change the current folder
    conditions = [parse_condition(text) for text in fail_if]
    if conditions and isinstance(study, Naming) and (known := study.measure_names(settings)):
        require_measures(conditions, known)  # now, and not after hours
    if pairs_wanted(until) is None:
        until = tuple(parse_rule(text).text for text in until)
    ids = ids_of(chosen, cases_from)
    if ids and n_cases is not None:
        rule = "it counts the first cases, but some were chosen"
        raise BadRequest("--cases", rule, "leave it out", slug="option-study")
    if until:
        n_cases = _at_most(n_cases, max_cases, bool(ids))
    elif max_cases is not None:
        rule = "it is for runs that end by a rule, but there is none"
        raise BadRequest("--max-cases", rule, "write --cases, or give --until", slug="option-study")
    if (until or max_time) and not getattr(study, "stops", False):
        rule = f"it is for campaigns, but {study.name} is of kind {study.kind}"
        raise BadRequest("--until" if until else "--max-time", rule, "leave it out", slug="option-study")
    if bool(engine) != bool(address):
        rule = f"--engine and --address go together, but only {'--engine' if engine else '--address'} is given"
        raise BadRequest("--engine", rule, "--engine dask --address tcp://host:8786", slug="option-study")
    if engine and not getattr(study, "stops", False):
        rule = f"it is for campaigns, but {study.name} is of kind {study.kind}"
        raise BadRequest("--engine", rule, "leave it out", slug="option-study")
    if baseline is not None and baseline != out:
        require_results(baseline)  # now, and not after hours
    if fresh:
        discard(out, _FRESH)
    isolate(str(settings.get("host", "")), str(settings.get("graph", "")))  # before the progress bar starts a thread
    if getattr(study, "compiles", False):
        say_if_cold()
    with terminable(), progress() as report:
        request = Request(settings, seed, target, n_cases, ids, until, max_time, address or "")
        outcome = study.run(request, report)
    os.chdir(here)
    click.echo(outcome.text.replace(str(target), str(out)), err=as_json)
    if outcome.interrupted:
        raise click.exceptions.Exit(130)
    results = {str(out): study.read(out)}
    tell([(study, results)], as_json)
    conclude([(study, results)], conditions, baseline, junit)


def _at_most(n_cases: int | None, max_cases: int | None, chosen: bool) -> int:
    """Return how many cases a run that ends by a rule has at most. Raises BadRequest: the options contradict."""
    from parcours.errors import BadRequest
    from parcours.study.stopping import MOST_CASES

    if chosen:
        raise BadRequest("--until", "it speaks of all cases, but some were chosen", "leave it out", slug="option-study")
    if n_cases is not None and max_cases is not None:
        rule = f"either says how many cases there are at most, but both are given: {n_cases} and {max_cases}"
        raise BadRequest("--cases and --max-cases", rule, "leave one out", slug="option-study")
    return n_cases or max_cases or MOST_CASES
