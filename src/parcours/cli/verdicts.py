"""What `run` and `report` print of results, and the exit code that CI goes by."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from parcours.report.junit import CaseResult
    from parcours.study import Results, Study
    from parcours.study.comparing import Baseline
    from parcours.study.gate import GateCondition

    Families = Sequence[tuple[Study, dict[str, Results]]]


def tell(families: Families, as_json: bool) -> None:
    """Print the outcomes of results, family by family."""
    from parcours.cli.options import print_json
    from parcours.report.terminal import print_table

    reported = [study.report(results) for study, results in families]
    if as_json:
        print_json({folder: document for one in reported for folder, document in one.documents.items()})
        return
    for one in reported:
        for table in one.tables:
            print_table(table)


def conclude(
    families: Families, conditions: Sequence[GateCondition], baseline: Path | None, junit: Path | None = None
) -> None:
    """Write JUnit, check conditions and baseline, and exit with the code that follows.

    Conditions and a baseline decide alone where there are some; else the verdicts of the cases do.
    """
    from parcours.run.locations import location
    from parcours.study.comparing import compare_with_baseline, outline_of
    from parcours.study.gate import check_conditions, exit_code

    if junit is not None:
        from parcours.report.junit import to_junit
        from parcours.report.writing import write_text

        write_text(junit, to_junit("parcours", junit_rows(families)))
        click.echo(f"wrote {junit}", err=True)
    failed = False
    for study, runs in families:
        for folder, results in runs.items():
            for checked in check_conditions(conditions, results):
                failed |= checked.failed
                click.echo(f"{'FAILED' if checked.failed else 'ok'}: {checked.name}: {checked.why}", err=True)
            if baseline is not None:
                require_same_cases(location(folder), baseline)
                compared = compare_with_baseline(outline_of(results), outline_of(study.read(baseline)))
                failed |= _is_worse(compared, baseline)
    if conditions or baseline is not None:
        raise click.exceptions.Exit(1 if failed else 0)
    if code := exit_code(one for _, results in families for one in results.values()):
        raise click.exceptions.Exit(code)


def _is_worse(compared: Baseline, baseline: Path) -> bool:
    """Say how a run compares, and return whether it is worse; on standard error, as standard output may hold JSON."""
    from parcours.report.terminal import print_table

    print_table(compared.table(), sys.stderr)
    for line in compared.lines():
        click.echo(line, err=True)
    worse = [row.name for row in compared.rows if row.worse]
    text = f"significantly worse than {baseline}: {', '.join(worse)}" if worse else f"no worse than {baseline}"
    click.echo(f"{'FAILED' if worse else 'ok'}: {text}", err=True)
    return bool(worse)


def same_seed(ours: Path, theirs: Path) -> bool:
    """Return whether two folders say that they are of one seed; True where one does not say."""
    from parcours.study.journal import RUN, read_question

    if not ((ours / RUN).exists() and (theirs / RUN).exists()):
        return True
    one, other = (read_question(folder)["question"] for folder in (ours, theirs))
    assert isinstance(one, dict) and isinstance(other, dict)
    return one.get("seed") == other.get("seed")


def require_same_cases(ours: Path, theirs: Path) -> None:
    """Raise BadRequest if two folders say that their cases are of different seeds or studies."""
    from parcours.errors import BadRequest
    from parcours.study.journal import RUN, read_question

    if not ((ours / RUN).exists() and (theirs / RUN).exists()):
        return
    one, other = (read_question(folder)["question"] for folder in (ours, theirs))
    assert isinstance(one, dict) and isinstance(other, dict)
    for key in ("study", "seed"):
        if one.get(key) != other.get(key):
            rule = f"both runs must be of the same cases, but their {key} is {one.get(key)!r} and {other.get(key)!r}"
            raise BadRequest("--baseline", rule, "run the same study with the same seed", slug="baseline-cases")


def junit_rows(families: Families) -> list[CaseResult]:
    """Return the verdicts of all cases; of several runs each id begins with the run's label."""
    from dataclasses import replace

    runs = [one for _, results in families for one in results.values()]
    if len(runs) == 1:
        return list(runs[0].cases())
    labels: list[str] = []
    for run in runs:
        n = sum(label.partition("#")[0] == run.label for label in labels)
        labels.append(run.label if not n else f"{run.label}#{n + 1}")
    return [
        replace(case, id=f"{label}/{case.id}") for label, run in zip(labels, runs, strict=True) for case in run.cases()
    ]
