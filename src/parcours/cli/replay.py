"""`parcours replay`: one case of a run, executed again and drawn."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, named_study


@click.command("replay")
@click.argument("folder", type=PATH)
@click.argument("case")
@click.option("--html", type=PATH, help="Page to write; without it the case is printed.")
@named_study
def command(folder: Path, case: str, html: Path | None, study: str) -> None:
    """Run one CASE of a run again, by its id or number, and draw it, or print what happened.

    Example: parcours replay out/lift 17 --html out/case-17.html

    Example: parcours replay out/lift lift/ITP1-tp21.tp11.tp21-0.0.0/0
    """
    from parcours.study.finding import study_of

    page = study_of(folder, study).read(folder).replay(case)
    if html is None:
        from parcours.report.terminal import print_page

        print_page(page)
        return
    from parcours.report.page import to_html
    from parcours.report.writing import write_text

    write_text(html, to_html(page))
    click.echo(f"{page.subtitle}\nwrote {html}")
