"""`parcours replay`: one case of a campaign, run again and drawn."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("replay")
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("number", type=click.IntRange(0))
@click.option("--html", type=click.Path(path_type=Path), required=True, help="Page to write.")
def command(folder: Path, number: int, html: Path) -> None:
    """Run one case of a campaign again from its number, and draw it.

    Example: parcours replay out/original 17 --html out/case-17.html
    """
    from parcours.errors import BadRequest
    from parcours.report.page import to_html
    from parcours.report.pieces import Page, Section
    from parcours.report.writing import write_text
    from parcours.studies.navigation.campaigns import load_results

    campaign = load_results(folder)
    if number >= len(campaign.facts):
        last = len(campaign.facts) - 1
        raise BadRequest(
            "replay",
            f"the campaign has cases 0 .. {last}, but case {number} was asked for",
            slug="case-number",
        )
    drawn = campaign.replay(number)
    section = Section("Replay", "Run again from the case number: the same bits as in the campaign.", (drawn,))
    write_text(
        html,
        to_html(Page(drawn.title, drawn.subtitle, (("folder", str(folder)), ("case", str(number))), (section,))),
    )
    click.echo(f"{drawn.subtitle}\nwrote {html}")
