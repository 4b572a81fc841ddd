"""`parcours judge`: recordings of runs, judged again by what is recorded alone."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, named_study, print_json


@click.command("judge")
@click.argument("recordings", nargs=-1, required=True, type=PATH)
@named_study
@as_json
def command(recordings: tuple[Path, ...], study: str, as_json: bool) -> None:
    """Judge recordings (MCAP, ROS 1 bag) again; exit 1 if a verdict differs from the recorded one.

    A folder stands for the recordings in it.

    Example: parcours judge out/lift/recordings
    """
    from parcours.errors import BadResults
    from parcours.run.recording import read_recording
    from parcours.study.components.archive import not_ours
    from parcours.study.finding import find

    files = [one for path in recordings for one in (sorted(path.glob("*.[mb]*")) if path.is_dir() else [path])]
    if not files:
        raise BadResults(", ".join(map(str, recordings)), "at least one recording is needed, but there is none",
                         slug="recording-case")  # fmt: skip
    judged = []
    for path in files:
        about = read_recording(path).about
        where = study or about.get("where", "") or about.get("study", "")
        if not where:
            raise not_ours(path, "it names no study")
        judged.append(find(where).rejudge(path))
    if as_json:
        print_json([
            {"recording": str(one.path), "case": one.case, "recorded": one.recorded,
             "verdict": str(one.judgement.verdict), "why": one.judgement.why}
            for one in judged
        ])  # fmt: skip
    else:
        for one in judged:
            if not one.agrees or not one.judgement.passed:
                recorded = "" if one.agrees else f" (recorded: {one.recorded or 'none'})"
                click.echo(f"{one.path}: {one.judgement.verdict}{recorded}: {one.judgement.why}")
        agree = sum(one.agrees for one in judged)
        click.echo(f"{agree} of {len(judged)} recordings earn the verdict that was recorded")
    if not all(one.agrees for one in judged):
        raise click.exceptions.Exit(1)
