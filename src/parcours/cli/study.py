"""`parcours study check`: tell a study's author what is wrong."""

from __future__ import annotations

import click

from parcours.cli.options import as_json, counted, print_json


@click.group("study")
def command() -> None:
    """Check a study of your own for mistakes.

    Example: parcours study check examples/lift
    """


@command.command("check")
@click.argument("study")
@as_json
def check(study: str, as_json: bool) -> None:
    """Put STUDY to the battery for authors: what is wrong, where, what to do. Exit code 1 if there is an error.

    STUDY is a folder, a study.yaml, file.py:NAME, module:NAME or a registered name. A file that cannot be read as a
    study is exit code 2, with all findings.

    Example: parcours study check examples/lift
    """
    from dataclasses import asdict

    from parcours.cli.progress import progress
    from parcours.study.finding import find

    found = find(study)
    with progress() as report:
        findings = list(found.check(report))
    errors = sum(one.level == "error" for one in findings)
    warnings = sum(one.level == "warning" for one in findings)
    if as_json:
        print_json({"study": found.name, "passed": not errors, "findings": [asdict(one) for one in findings]})
    else:
        for one in findings:
            click.echo(str(one))
        click.echo(f"{found.name}: {counted(errors, 'error')}, {counted(warnings, 'warning')}")
    if errors:
        raise click.exceptions.Exit(1)
