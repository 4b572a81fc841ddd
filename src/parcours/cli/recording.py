"""`parcours recording`: what a recording holds; the same in the other format, or as a trace without payloads."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH
from parcours.cli.renaming import formerly


@formerly({"--to": "--out"})
@click.command("recording")
@click.argument("file", type=PATH)
@click.option("--out", "target", type=PATH, help="Write it as this *.mcap or *.bag.")
@click.option("--trace", "trace_file", type=PATH, help="Write its events as JSON Lines.")
def command(file: Path, target: Path | None, trace_file: Path | None) -> None:
    """Show what a recording (MCAP, ROS 1 bag) of a run holds, and whether it is complete.

    Example: parcours recording out/case-17.bag --out out/case-17.mcap
    """
    from collections import Counter

    from parcours.run.recording import convert, read_recording
    from parcours.run.trace import write_trace

    recording = read_recording(file)
    trace = recording.trace
    click.echo(f"case {trace.case or '-'} on {trace.host or '-'}, {trace.clock} clock")
    for kind, n in Counter(event.kind for event in trace.events).most_common():
        click.echo(f"{n:8} {kind}")
    if trace.events:
        click.echo(f"{(trace.events[-1].time - trace.events[0].time) / 1e9:.3f} s from the first event to the last")
    for key, value in recording.about.items():
        click.echo(f"{key}: {value}")
    if recording.left_out:
        click.echo(f"without payloads: {', '.join(recording.left_out)}")
    click.echo(f"incomplete: {recording.missing}" if recording.missing else "complete")
    if target is not None:
        click.echo(f"wrote {target}, {convert(file, target)} messages")
    if trace_file is not None:
        write_trace(trace_file, trace)
        click.echo(f"wrote {trace_file}")
