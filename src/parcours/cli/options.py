"""Options that several subcommands share."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from parcours.model import Cefsm
    from parcours.report.pieces import Cell, Column
    from parcours.study import Parameter

    _Type = click.ParamType[Any]
else:
    _Type = click.ParamType  # not generic in older releases

F = TypeVar("F", bound=Callable[..., Any])


class _LocalPath(click.Path):
    """A file or a folder of this machine."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path. Raises BadRequest: it is a URL."""
        from parcours.run.locations import require_folder

        require_folder(value)
        return super().convert(value, param, ctx)


PATH = _LocalPath(path_type=Path)
FILE = _LocalPath(path_type=Path, dir_okay=False)


def count(
    *names: str, help: str, default: int | None = None, least: int = 1, most: int | None = None
) -> Callable[[F], F]:
    """Return an option for a whole number."""
    range = click.IntRange(least, most)
    return click.option(*names, type=range, default=default, show_default=default is not None, help=help)


def choice(*names: str, help: str) -> Callable[[F], F]:
    """Return an option for one of the names that follow its own; the first is the default."""
    option, *values = names
    return click.option(option, type=click.Choice(values), default=values[0], show_default=True, help=help)


as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
seed = click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=1, show_default=True, help="Campaign seed.")


class _Location(_Type):
    """A folder of results, or the URL of a bucket that holds some."""

    name = "path"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> object:
        """Return the path, or what stands for one."""
        from parcours.run.locations import location

        return location(str(value))


LOCATION = _Location()


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
                return path  # what reads it will say that it is not there
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
    help='Exit 1 if it holds, such as "failed > 1%"; may be repeated. Verdicts of cases then do not decide.',
)  # fmt: skip
baseline = click.option(
    "--baseline", type=LOCATION, metavar="FOLDER",
    help="Exit 1 if a rate got significantly worse than in that run. Verdicts of cases then do not decide.",
)  # fmt: skip


def workers(function: F) -> F:
    """Add --workers: by default one process a processor."""
    from parcours.study.parameters import workers_parameter

    range, default = click.IntRange(1, 1024), workers_parameter().default
    return click.option("--workers", type=range, default=default, show_default="one per processor", help="Processes.")(
        function
    )


def counted(n: int, what: str) -> str:
    """Return a number with its noun.

    >>> counted(1, "error"), counted(2, "error")
    ('1 error', '2 errors')
    """
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def print_rows(
    title: str, columns: Iterable[str | tuple[str, str] | Column], rows: Iterable[tuple[Cell, ...]], note: str = ""
) -> None:
    """Print a table; a column is a name, a name with the format of its numbers, or a `Column`."""
    from parcours.report.pieces import Column, Table
    from parcours.report.terminal import print_table

    heads = (one if isinstance(one, Column) else Column(*((one,) if isinstance(one, str) else one)) for one in columns)
    print_table(Table(title, tuple(heads), tuple(rows), note))


def read_model(file: Path) -> Cefsm:
    """Return the model of a file of any format; what the file says beyond it is noted on standard error."""
    return read_altered(file)[0]


def read_altered(file: Path) -> tuple[Cefsm, str]:
    """Return the same, and why findings in the model need not be true of the file; empty if they are."""
    from parcours.model.formats import read_any

    reading = read_any(file)
    for loss in reading.losses:
        click.echo(f"not kept: {loss}", err=True)
    altering = [loss for loss in reading.losses if loss.alters]
    more = f", and {len(altering) - 1} more" if len(altering) > 1 else ""
    return reading.cefsm, f"runs may differ for what is not kept: {altering[0]}{more}" if altering else ""


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
            show_default="one per processor" if one.name == "workers" else one.default != "",
            metavar="|".join(filter(None, one.choices)) or None,
        )
        for one in parameters
    ]  # fmt: skip
