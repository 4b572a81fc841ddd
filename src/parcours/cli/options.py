"""Options that several subcommands share."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from parcours.study import Parameter

    _Type = click.ParamType[Any]
else:
    _Type = click.ParamType  # not generic in older releases

F = TypeVar("F", bound=Callable[..., Any])

as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
seed = click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=1, show_default=True, help="Campaign seed.")


class StudyFile(_Type):
    """A file of a kind that studies have: its path, or a study that has one."""

    name = "file"

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> object:
        """Return the path: of the file, or of the study's."""
        from parcours.errors import BadRequest

        path = Path(str(value))
        if path.is_file() and path.name != "study.yaml":
            return path
        from parcours.study.finding import find

        try:
            files = getattr(find(str(value)), "files", {})
        except BadRequest as error:
            if error.slug == "unknown-study" or (error.slug == "unreadable-file" and path.suffix):
                return path  # whoever reads it says that it is not there
            raise
        if self._kind not in files:
            raise BadRequest(str(value), f"this study has no {self._kind} file", slug="study-file")
        return files[self._kind]


model_file = click.argument("file", type=StudyFile("model"))
data_file = click.argument("file", type=StudyFile("data"))
named_study = click.option("--study", default="", metavar="STUDY", help="Where the study is, if not where it was.")
set_parameters = click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE", help="A parameter of the study; may be repeated."
)
fail_if = click.option(
    "--fail-if", "fail_if", multiple=True, metavar="CONDITION",
    help='Exit 1 if it holds, such as "stuck > 1%"; may be repeated. Verdicts of cases then do not decide.',
)  # fmt: skip
baseline = click.option(
    "--baseline", type=click.Path(path_type=Path), metavar="FOLDER",
    help="Exit 1 if a rate got worse than in that run beyond chance. Verdicts of cases then do not decide.",
)  # fmt: skip


def workers(function: F) -> F:
    """Add --workers: by default one process a processor."""
    from parcours.study.parameters import workers_parameter

    option = click.option(
        "--workers",
        type=click.IntRange(1, 1024),
        default=workers_parameter().default,
        show_default="one a processor",
        help="Processes.",
    )
    return option(function)


def print_json(value: object) -> None:
    """Print a value as JSON."""
    click.echo(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False))


class _Value(_Type):
    """The value of a study's parameter."""

    def __init__(self, parameter: Parameter) -> None:
        self._parameter = parameter
        self.name = {"bool": "true|false", "int": "integer", "real": "number", "text": "text"}[parameter.kind]

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> object:
        return self._parameter.read(value)


def parameter_options(parameters: Sequence[Parameter]) -> list[click.Option]:
    """Return an option for each parameter of a study."""
    return [
        click.Option(
            [one.option, one.name], type=_Value(one), default=one.default, help=one.help(),
            show_default="one a processor" if one.name == "workers" else one.default != "",
            metavar="|".join(filter(None, one.choices)) or None,
        )
        for one in parameters
    ]  # fmt: skip
