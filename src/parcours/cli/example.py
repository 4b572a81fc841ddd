"""`parcours example`: the shipped examples, and copies of them."""

from __future__ import annotations

from pathlib import Path

import click

from parcours.cli.options import PATH, as_json, print_json, print_rows


@click.command("example")
@click.argument("name", required=False)
@click.argument("folder", required=False, type=PATH)
@as_json
def command(name: str | None, folder: Path | None, as_json: bool) -> None:
    """List the shipped examples, or copy the one called NAME into FOLDER (by default, one of its name).

    Files that an example shares with others are copied, too. Nothing is overwritten.

    Example: parcours example

    Example: parcours example lift && parcours run lift --out out/lift
    """
    from parcours.errors import require_known
    from parcours.study.copying import runnable, write_new
    from parcours.study.examples import contents_of, examples

    if name is None:
        _list(as_json)
        return
    known = examples()
    require_known(name, list(known), "example", slug="unknown-example")
    contents = contents_of(known[name])
    folder = folder or Path(name)
    write_new(folder, contents, runnable(contents))
    written = [str(folder / place) for place in contents]
    if as_json:
        print_json(written)
        return
    for path in written:
        click.echo(f"wrote {path}")
    commands = _next(folder, {str(place) for place in contents})
    if commands:
        click.echo("Next:\n" + "\n".join(f"  {one}" for one in commands))


def _list(as_json: bool) -> None:
    """Print each example with a line about it."""
    from parcours.report.pieces import Column
    from parcours.study.examples import about, examples

    rows = tuple((name, about(one)) for name, one in examples().items())
    if as_json:
        print_json([{"name": name, "doc": doc} for name, doc in rows])
        return
    print_rows("Examples", (Column("example", code=True), "what it shows"), rows)
    click.echo("Copy one: parcours example NAME [FOLDER]")


def _next(folder: Path, places: set[str]) -> list[str]:
    """Return what to type next, by what an example holds."""
    import shlex

    from parcours.cli.new import next_commands
    from parcours.study.copying import study_name

    commands = [f"make -C {shlex.quote(str(folder))}"] if "Makefile" in places else []
    if "study.yaml" in places:
        commands += next_commands(folder, study_name(folder))
    elif "binding.yaml" in places:
        commands.append(f"parcours binding check {shlex.quote(str(folder / 'binding.yaml'))}")
    return commands
