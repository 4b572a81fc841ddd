"""Options that several subcommands share."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

as_json = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
seed = click.option("--seed", type=click.IntRange(0, 2**63 - 1), default=1, show_default=True, help="Campaign seed.")
model_file = click.argument("file", type=click.Path(path_type=Path))


def workers(function: F) -> F:
    """Add --workers: by default one process a processor."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    option = click.option(
        "--workers",
        type=click.IntRange(1, 1024),
        default=cores,
        show_default="one a processor",
        help="Processes.",
    )
    return option(function)


def print_json(value: object) -> None:
    """Print a value as JSON."""
    click.echo(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False))
