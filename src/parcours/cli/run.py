"""`parcours run`: execute a study and keep its results in a folder."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, seed, workers

if TYPE_CHECKING:
    from parcours.studies.navigation.study import NavigationStudy
    from parcours.studies.ramp_system.study import SystemStudy


@click.command("run")
@click.argument("study")
@click.option("--schedule", default="original", show_default=True, help="original or guarded (ramp_system).")
@click.option("--planner", default="", help="navigation: a shipped planner's name, module:Name or file.py:Name.")
@click.option("--protocol", default="table-vii", show_default=True, help="table-vii or published (system cases).")
@click.option(
    "--cases",
    type=click.IntRange(1, 100_000_000),
    default=None,
    help="How many cases; by default the paper's.",
)
@click.option(
    "--added-sensing", type=float, default=0.0, show_default=True, help="ramp_system: obstacles seen later [s]"
)
@click.option("--added-planning", type=float, default=0.0, show_default=True, help="ramp_system: cycles longer [s]")
@click.option("--added-stop", type=float, default=0.0, show_default=True, help="ramp_system: halts later [s]")
@click.option("--robot-radius", type=float, default=0.125, show_default=True, help="[m]")
@click.option("--obstacle-radius", type=float, default=0.1, show_default=True, help="[m]")
@click.option("--period", type=float, default=0.05, show_default=True, help="navigation: between observations [s]")
@click.option("--command-delay", type=float, default=0.0, show_default=True, help="navigation: of answers [s]")
@click.option("--time-limit", type=float, default=20.0, show_default=True, help="navigation: of a case [s]")
@click.option("--watched-on", type=float, default=0.0, show_default=True, help="navigation: beyond its end [s]")
@click.option(
    "--call-timeout",
    type=float,
    default=10.0,
    show_default=True,
    help="navigation: an answer that takes longer is an error [s of wall clock].",
)
@click.option("--host", default="simulated", show_default=True, help="simulated, processes, ros1 or ros2 (RAMP).")
@click.option("--graph", default="", help="ros1: address of a running master; ros2: a domain. Else one of its own.")
@click.option("--repeats", type=click.IntRange(1, 100_000), default=60, show_default=True, help="of a timing case")
@click.option("--percent", type=float, default=95.0, show_default=True, help="of repeats that must keep a limit [%]")
@click.option(
    "--faults", default="", help="ramp_system in real time: a file of faults, or lines: 'Planner: crash at 3 s'."
)
@click.option("--record", type=click.Choice(["mcap", "bag"]), help="Keep a recording of every case run in real time.")
@seed
@workers
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder for the results; resumed if it holds some.",
)
@as_json
def command(
    study: str, schedule: str, planner: str, protocol: str, cases: int | None, added_sensing: float,
    added_planning: float, added_stop: float, robot_radius: float, obstacle_radius: float, period: float,
    command_delay: float, time_limit: float, watched_on: float, call_timeout: float, host: str, graph: str,
    repeats: int, percent: float, faults: str, record: str | None, seed: int, workers: int, out: Path, as_json: bool,
) -> None:  # fmt: skip
    """Execute a study. Ctrl-C keeps the system cases that were finished; the same command goes on from there.

    Example: parcours run ramp_system --schedule guarded --cases 905 --out out/guarded

    Example: parcours run ramp_system --schedule guarded --added-sensing 0.25 --out out/late

    Example: parcours run navigation --planner orca --cases 905 --out out/orca

    Example: parcours run ramp_components --host processes --record mcap --out out/components

    Example: parcours run ramp_system --host processes --faults "Planner: freeze at 3 s for 1 s" --out out/frozen
    """
    from parcours.cli.progress import progress, say_if_cold
    from parcours.studies import check_study

    check_study(study)
    _refuse_options_of_others(study)
    if host != "simulated":
        from parcours.studies.hosting import isolate

        isolate(host, graph)
    if study == "ramp_components":
        from parcours.cli.live import run_component_cases

        run_component_cases(host, graph, seed, cases, repeats, percent, record, out, as_json)
        return
    if host != "simulated":
        from parcours.cli.live import run_system_cases

        run_system_cases(host, graph, schedule, seed, protocol, cases or 20, time_limit, faults, record, out, as_json)
        return
    from parcours.run.campaign import run_campaign
    from parcours.studies.ramp_system.study import PUBLISHED_CASES, system_study

    campaign_study: SystemStudy | NavigationStudy
    folder = out.absolute()  # a planner may change the current folder
    say_if_cold()
    if study == "navigation":
        from parcours.studies.navigation.scenario import Scenario
        from parcours.studies.navigation.study import study_of
        from parcours.studies.ramp_system.cases import SystemCases

        label = _require_planner(planner)
        scenario = Scenario(
            period=period, command_delay=command_delay, time_limit=time_limit, watched_on=watched_on,
            call_timeout=call_timeout,
        )  # fmt: skip
        system_cases = SystemCases(seed, protocol, robot_radius, obstacle_radius)  # type: ignore[arg-type]
        campaign_study = study_of(label, system_cases, scenario)
    else:
        from parcours.planners.ramp.latency import Latencies

        label = schedule
        plain = system_study(
            schedule, seed=seed, protocol=protocol, radius=robot_radius, obstacle_radius=obstacle_radius  # type: ignore[arg-type]
        )  # fmt: skip
        added = Latencies(added_sensing=added_sensing, added_planning=added_planning, added_stop=added_stop)
        campaign_study = dataclasses.replace(plain, latencies=added)
    with progress() as report:
        outcome = run_campaign(
            campaign_study,
            campaign_study.campaign(PUBLISHED_CASES if cases is None else cases),
            folder,
            workers=workers,
            progress=lambda done, total: report(f"{study}, {label}", done, total),
        )
    click.echo(str(outcome), err=as_json)
    if outcome.interrupted:
        raise click.exceptions.Exit(130)
    from parcours.cli.report import summarise
    from parcours.studies.navigation.campaigns import load_results

    summarise({str(out): load_results(folder)}, as_json)


def _require_planner(planner: str) -> str:
    """Return the planner's name; raise BadRequest if none was given."""
    from parcours.errors import BadRequest
    from parcours.studies.navigation.planners import NAMES

    if not planner:
        known = f"name one of {', '.join(NAMES)}, or module:Name, or file.py:Name"
        raise BadRequest("--planner", "navigation needs to be told which planner to run", known, slug="planner-unknown")
    return planner


_SYSTEM = ("protocol", "robot_radius", "obstacle_radius", "workers")
_DELAYS = ("added_sensing", "added_planning", "added_stop")
_OPTIONS = {
    "ramp_components": ("host", "graph", "repeats", "percent", "record"),
    "ramp_system": (
        *_SYSTEM,
        "schedule",
        "host",
        "graph",
        "record",
        "time_limit",
        "faults",
        "added_sensing",
        "added_planning",
        "added_stop",
    ),
    "navigation": (*_SYSTEM, "planner", "period", "command_delay", "time_limit", "watched_on", "call_timeout"),
}
"""Study -> the options that not all studies have and it has."""


def _refuse_options_of_others(study: str) -> None:
    """Raise BadRequest if an option was given that the study does not have."""
    from parcours.errors import BadRequest

    context = click.get_current_context()
    for name in sorted({name for names in _OPTIONS.values() for name in names} - set(_OPTIONS[study])):
        if context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
            owners = " and ".join(owner for owner, names in _OPTIONS.items() if name in names)
            raise BadRequest(
                "--" + name.replace("_", "-"),
                f"it belongs to {owners}, but the study is {study}",
                "leave it out",
                slug="option-study",
            )
