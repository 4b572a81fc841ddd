"""`parcours new FOLDER`: a study of one's own that passes at once."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH
from parcours.study.copying import templates


@click.command("new")
@click.argument("folder", type=PATH)
@click.option("--kind", type=click.Choice(list(templates())), default="components", show_default=True,
              help="What the study tests.")  # fmt: skip
def command(folder: Path, kind: str) -> None:
    """Write a small study into FOLDER that passes at once, to be changed into your own. Its name is the folder's.

    Kind `components` tests Python classes against a model, `process` has one of them as a separate program in any
    language; packages that bring further kinds of study bring their templates, too. Nothing is overwritten.

    Example: parcours new mine && parcours run mine --out out/mine

    Example: parcours new theirs --kind process
    """
    from parcours.study.copying import from_template, runnable, study_name, write_new

    name = study_name(folder)
    contents = from_template(templates()[kind], name)
    write_new(folder, contents, runnable(contents))
    for place in contents:
        click.echo(f"wrote {folder / place}")
    click.echo("Next:\n" + "\n".join(f"  {one}" for one in next_commands(folder, name)))


def next_commands(folder: Path, name: str) -> list[str]:
    """Return what to type next for a study in a folder."""
    import shlex

    from parcours.study.finding import registered

    text = str(folder)
    is_taken = text in {one.name for one in registered()}  # a registered name goes before a folder's
    given = shlex.quote(f"./{text}" if is_taken else text)
    check, run = f"parcours study check {given}", f"parcours run {given} --out out/{name}"
    return [check, run, f"parcours report out/{name} --html out/{name}.html"]
