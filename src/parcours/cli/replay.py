"""`parcours replay`: one case of a run, executed again and drawn."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import FILE, LOCATION, PATH, named_study


@click.command("replay")
@click.argument("folder", type=LOCATION)
@click.argument("case")
@click.option("--html", type=FILE, help="Page to write; without it the case is printed.")
@click.option("--export", "exports", multiple=True, type=PATH, metavar="FILE",
              help="Write the replay as .svg, .gif or .mcap (Foxglove); may be repeated.")  # fmt: skip
@click.option("--beside", multiple=True, type=LOCATION, metavar="FOLDER",
              help="Show the same case of this run beside it, at the same time; may be repeated.")  # fmt: skip
@named_study
def command(
    folder: Path, case: str, html: Path | None, exports: tuple[Path, ...], beside: tuple[Path, ...], study: str
) -> None:
    """Run one CASE of a run again, by its id or number, and draw it, or print what happened.

    Example: parcours replay out/mine 17 --html out/case-17.html --export out/case-17.gif

    Example: parcours replay out/monday 17 --beside out/tuesday --html out/case-17.html

    Example: parcours replay out/lift lift/ITP1-tp21.tp11.tp21-0.0.0/0
    """
    from parcours.study.finding import study_of

    page = study_of(folder, study).read(folder).replay(case)
    others = [study_of(each, study).read(each).replay(case) for each in beside]
    if exports:
        from parcours.report.exporting import export

        for path in exports:
            export(page, path)
            click.echo(f"wrote {path}", err=True)
    if others:
        from parcours.report.exporting import together

        page = together([page, *others])
    if html is None and exports:
        return
    if html is None:
        from parcours.report.terminal import print_page

        print_page(page)
        return
    from parcours.report.page import to_html
    from parcours.report.writing import write_text

    write_text(html, to_html(page))
    click.echo(f"{page.subtitle}\nwrote {html}")
