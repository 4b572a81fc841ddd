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
    finished = campaign.facts["number"]
    if number not in finished:
        rule = f"the campaign has cases 0 .. {campaign.planned - 1}, but case {number} was asked for"
        if number < campaign.planned:
            rule = f"{len(finished) or 'no'} of {campaign.planned} cases are finished, and case {number} is not yet"
        if not len(finished):
            rule = f"no case is finished yet, but case {number} was asked for"
        raise BadRequest("replay", rule, "run the campaign on, or name another case", slug="case-number")
    drawn = campaign.replay(number)
    section = Section("Replay", "Run again from the case number: the same bits as in the campaign.", (drawn,))
    write_text(
        html,
        to_html(Page(drawn.title, drawn.subtitle, (("folder", str(folder)), ("case", str(number))), (section,))),
    )
    click.echo(f"{drawn.subtitle}\nwrote {html}")
