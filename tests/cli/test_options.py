"""One vocabulary of options over all commands: one name, one meaning; every command with an example."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import click
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.cli.renaming import former_names
from parcours.errors import BadRequest

PAGE = Path(__file__).parents[2] / "docs/cli.md"
NUMBERED = ("--case",)  # the ids of a world's cases are numbers


def commands(group: click.Group = parcours, path: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Yield all commands, and `run` once for each study that is installed."""
    context = click.Context(group)
    for name in group.list_commands(context):
        found = group.get_command(context, name)
        assert found is not None
        if isinstance(found, click.Group):
            yield from commands(found, (*path, name))
        else:
            yield " ".join((*path, name)), found


def kind(option: click.Option) -> str:
    """Return what an option takes; a choice, a formula and a name are texts."""
    if option.is_flag:
        return "flag"
    if isinstance(option.type, click.Path) or option.type.name in ("file", "path"):
        return "path"
    name = {"float": "number", "float range": "number", "integer range": "integer"}.get(option.type.name)
    return name or (option.type.name if option.type.name in ("number", "integer", "true|false") else "text")


def test_an_option_means_the_same_in_every_command_and_the_page_says_what() -> None:
    users: dict[str, dict[str, str]] = defaultdict(dict)
    for where, command in commands():
        for option in command.params:
            for name in option.opts if isinstance(option, click.Option) else ():
                assert isinstance(option, click.Option)
                users[name][where] = kind(option)
    assert len(users) > 100
    mixed = {name: of for name, of in users.items() if len(set(of.values())) > 1 and name not in NUMBERED}
    assert mixed == {}
    shared = {name for name, of in users.items() if len({where.split()[0] for where in of}) > 1}
    rows = re.findall(r"^\| (`--.*?`) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    told = [name for row in rows for name in re.findall(r"`(--[\w-]+)", row)]
    assert sorted(told) == sorted(shared), "docs/cli.md lists the options that several commands share"


def test_every_command_has_help_with_an_example() -> None:
    for where, command in commands():
        if not where.startswith("run "):  # whose example stands at the group
            assert re.search("Example: .*parcours", command.help or ""), where
    assert "Example: parcours run" in (parcours.get_command(click.Context(parcours), "run").help or "")  # type: ignore[union-attr]


def test_a_former_name_is_refused_with_todays() -> None:
    n_former = 0
    for where, command in commands():
        names = {name for option in command.params for name in option.opts}
        for former, now in former_names(command).items():
            n_former += 1
            assert former not in names and now in names, where
            for words in ([former, "3"], [f"{former}=3"], [former]):
                refused = CliRunner().invoke(parcours, [*where.split(), *words]).exception
                assert isinstance(refused, BadRequest), (where, words)
                assert refused.slug == "option-renamed" and f"write {now}" in str(refused)
    assert n_former > 100
    for line in ("falsify x --seconds 9", "feasible x --seconds=9", "rare x --budget 9", "run navigation --rows 9"):
        refused = CliRunner().invoke(parcours, line.split()).exception
        assert isinstance(refused, BadRequest) and refused.slug == "option-renamed", line
    unknown = CliRunner().invoke(parcours, ["paths", "--nonsense", "model.yaml"])
    assert unknown.exit_code == 2 and "No such option" in unknown.output


def test_one_error_of_a_model_is_not_called_errors(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").touch()
    said = CliRunner().invoke(parcours, ["model", "check", str(tmp_path / "model.yaml")]).stdout
    assert said.endswith("model.yaml: 1 error, 0 warnings\n")
