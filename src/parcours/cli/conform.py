"""`parcours conform`: the first event of a trace that its model does not allow."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import PATH, StudyFile, as_json, choice, count, print_json, read_model
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.verdict.conformance import Conformance, Expectation


@formerly({"--hidden": "--max-states", "--quiet": "--quiescence", "--until": "--duration"})
@click.command("conform")
@click.argument("trace", type=PATH)
@click.option("--model", type=StudyFile("model"), required=True, help="The model file, or a study that has one.")
@click.option(
    "--component", "components", multiple=True, help="Follow this component only; may be repeated. [default: all]"
)
@choice("--observes", "transitions", "messages", help="Whether the trace names transitions, or only messages.")
@click.option(
    "--quiescence", "quiet", multiple=True, metavar="CHANNEL=MS", help="How long an expected message may take."
)
@click.option(
    "--duration", "until", type=click.FloatRange(0.0), help="Length of the observation [ms]. [default: last event]"
)
@click.option("--unmodelled", multiple=True, metavar="CHANNEL", help="Sends there need no transition; may be repeated.")
@click.option("--conversations", is_flag=True, help="An answer counts for the latest question only.")
@count("--max-states", "hidden", default=2000, help="Most states to keep, followed through unobserved steps.")
@as_json
def command(
    trace: Path, model: Path, components: tuple[str, ...], observes: str, quiet: tuple[str, ...], until: str | None,
    unmodelled: tuple[str, ...], conversations: bool, hidden: int, as_json: bool,
) -> None:  # fmt: skip
    """Check a trace against a model: the first deviation, what was expected, the path that led there.

    Exit code 0 if the trace conforms, 1 if it deviates, 3 if that cannot be decided, 2 if the input is wrong.

    Example: parcours conform trace.jsonl --model model.yaml --quiescence reply=20 --json
    """
    from parcours.run.trace import read_trace
    from parcours.verdict.conformance import Allowance, check
    from parcours.verdict.judgement import Verdict

    found = check(
        read_trace(trace),
        read_model(model),
        component=components or None,
        observes=observes,  # type: ignore[arg-type]
        quiescence=dict(map(_timeout, quiet)),
        allowance=Allowance(frozenset(unmodelled), conversations),
        hidden=hidden,
        until=None if until is None else _nanoseconds("--duration", until),
    )
    if as_json:
        print_json(_record(found))
    else:
        _tell(found)
    if not found.judgement.passed:
        raise click.exceptions.Exit(1 if found.judgement.verdict is Verdict.FAIL else 3)


def _timeout(text: str) -> tuple[str, int]:
    channel, _, time = text.partition("=")
    return channel, _nanoseconds("--quiescence", time, text)


def _nanoseconds(option: str, text: str, whole: str = "") -> int:
    from parcours.errors import BadRequest

    try:
        return round(float(text) * 1e6)
    except (ValueError, OverflowError):
        form = "a channel and a timeout in milliseconds, as reply=20" if whole else "a time in milliseconds, as 250"
        rule = f"takes {form}, but {whole or text!r} was given"
        raise BadRequest(option, rule, "give a finite number", slug="quiet-timeout") from None


def _tell(found: Conformance) -> None:
    click.echo(f"{found.judgement.verdict}: {_reason(found)}")
    if found.deviation is not None:
        click.echo("expected: " + (", ".join(map(str, found.expected)) or "nothing more"))
        click.echo("path:     " + (" ".join(found.path) or "its start"))
        if found.deviation.doubt:
            click.echo("in doubt: " + found.deviation.doubt)
    if found.n_outside:
        click.echo(f"{found.n_outside} events on channels that the model does not name")


def _reason(found: Conformance) -> str:
    if found.deviation is None:
        return found.judgement.why
    at = found.deviation
    return f"event {at.position} at {at.time / 1e6:.3f} ms, {at.component}: {at.rule}"


def _record(found: Conformance) -> dict[str, object]:
    record: dict[str, object] = {
        "verdict": str(found.judgement.verdict), "why": _reason(found),
        "events": found.n_events, "outside": found.n_outside,
    }  # fmt: skip
    if found.deviation is not None:
        at = found.deviation
        record["deviation"] = {
            "position": at.position, "time": at.time, "component": at.component,
            "kind": at.event.kind if at.event else "silence",  # an owed message did not come, so there is no event
            "name": (at.event.transition or at.event.channel) if at.event else "", "rule": at.rule,
            "expected": [{"what": e.what, "name": e.name, "values": _values(e)} for e in at.expected],
            "path": list(at.path), "doubt": at.doubt,
        }  # fmt: skip
    return record


def _values(expectation: Expectation) -> dict[str, object]:
    # JSON has no infinity.
    return {
        name: str(value) if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in expectation.values
    }
