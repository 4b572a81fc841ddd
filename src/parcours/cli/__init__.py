"""The command line: one subcommand a stage, each imported only when it is called."""

from __future__ import annotations

import atexit
import gc
import importlib
import sys

import click

from parcours import __version__
from parcours.cli.extending import added
from parcours.cli.renaming import renamed
from parcours.errors import ParcoursError

COMMANDS = {
    "studies": "List the studies that are there.",
    "new": "Write a study of your own that passes at once.",
    "study": "Check a study of your own.",
    "example": "Copy a shipped example.",
    "model": "Check a model file, draw its machines.",
    "convert": "Models in other tools' formats, in and out.",
    "explore": "The state space of a model: deadlocks, lost messages, dead transitions.",
    "paths": "Internal test paths of a model by a coverage criterion.",
    "feasible": "Which requirements can be met, with which values, and why not.",
    "walk": "Walk a model online until a stop condition holds.",
    "abtc": "Abstract behavioural test cases of a model.",
    "data": "Test data: rows, covering arrays, coverage of tables, PICT.",
    "export": "A suite as test scripts of other tools.",
    "suite": "Write the executable cases of a study to a file.",
    "run": "Execute a study and keep its results.",
    "faults": "A study under faults on purpose: fault x outcome.",
    "mutate": "Small changes to the system under test: which do the tests notice?",
    "conform": "A trace against a model: first deviation, expected set, path.",
    "recording": "What a recording of a run holds; one format into the other.",
    "judge": "Recordings of runs, judged again.",
    "report": "Results of runs as tables, HTML and JUnit.",
    "results": "Ask the results of a run: by groups, conditions, SQL; as Parquet.",
    "coverage": "What campaigns cover together, and what is missing.",
    "compare": "Runs on the same cases, with paired tests.",
    "replay": "One case of a run, executed again and drawn.",
    "history": "A file with one line per run, to which CI appends: rates over time.",
    "reproduce": "Failing cases of a campaign, run again and compared to the byte.",
    "studio": "Edit, run and watch the studies of a folder in the browser.",
    "falsify": "Look for a failing case over the input domains of a study.",
    "rare": "How likely a case fails, where that is rare.",
    "shrink": "A failing case made small, and kept as a test.",
    "completion": "Print a script that completes commands in your shell.",
    "compile": "Compile all kernels now, on all processors.",
}
"""Subcommand -> its line in the help; the module of the same name holds it."""


class _Stages(click.Group):
    """A group that imports a subcommand's module when the subcommand is called, not before.

    A command that a package adds stands before one of ours of the same name.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(dict.fromkeys([*COMMANDS, *added()]))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in added():
            other: click.Command = added()[cmd_name].load()
            return other
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"parcours.cli.{cmd_name}").command
        return command

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except click.NoSuchOption as error:
            raise renamed(error) or error from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            lines = COMMANDS | {name: _line(entry.load()) for name, entry in added().items()}
            formatter.write_dl(list(lines.items()))


def _line(command: click.Command) -> str:
    return command.get_short_help_str(limit=72)


@click.command(cls=_Stages, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="parcours")
def parcours() -> None:
    """Turn a model of behaviour into executed, judged, replayable tests of systems that run in real time.

    Exit codes of all commands: 0 all passed, 1 something failed, 2 wrong usage, 3 inconclusive only, 130
    interrupted.

    Example: parcours new mine && parcours run mine --out out/mine
    """


def main() -> None:
    """Run the command line; what was given wrongly is one paragraph on standard error and exit code 2."""
    gc.set_threshold(300_000, 50, 50)  # loading makes 265 000 objects and no garbage: looking for it is 7 % of a start
    atexit.register(gc.freeze)  # memory goes back with the process: looking for garbage at the end is as much again
    try:
        # An Exit raised inside comes back as its code.
        sys.exit(parcours.main(complete_var="_PARCOURS_COMPLETE", standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except ParcoursError as error:
        click.echo(f"parcours: {error}", err=True)
        sys.exit(2)
    except (KeyboardInterrupt, click.Abort):
        click.echo("parcours: interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(141)
