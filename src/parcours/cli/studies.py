"""`parcours studies`: the studies that are there."""

from __future__ import annotations

import click

from parcours.cli.options import as_json, print_json, print_rows


@click.command("studies")
@as_json
def command(as_json: bool) -> None:
    """List the studies that installed packages register; any folder with a study.yaml is one more.

    Example: parcours studies
    """
    from parcours.errors import ParcoursError
    from parcours.report.pieces import Column
    from parcours.study.finding import find, registered

    rows = []
    for one in registered():
        try:
            study = find(one.name)
            rows.append((one.name, study.kind, one.package, study.doc))
        except ParcoursError as error:  # a package that is broken must not hide the others
            rows.append((one.name, "broken", one.package, error.rule))
    if as_json:
        print_json([dict(zip(("name", "kind", "package", "doc"), row, strict=True)) for row in rows])
        return
    print_rows("Studies", (Column("study", code=True), "kind", "package", "what it tests"), rows)
    click.echo("One of your own: parcours new FOLDER")
