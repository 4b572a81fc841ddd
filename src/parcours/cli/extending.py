"""Commands that other packages add to a group (entry points `parcours.commands`: `name`, or `group.name`)."""

from __future__ import annotations

import functools
from importlib.metadata import EntryPoint, entry_points

import click

GROUP = "parcours.commands"


@functools.cache
def added(group: str = "") -> dict[str, EntryPoint]:
    """Return the commands that packages add to a group, by name; to the whole program if no group is named."""
    found = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        where, _, name = entry.name.rpartition(".")
        if where == group:
            found[name] = entry
    return found


class Extensible(click.Group):
    """A group that packages can add commands to; their modules are imported when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return our own names, then the added ones."""
        return [*super().list_commands(ctx), *added(self.name or "")]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of a name."""
        entry = added(self.name or "").get(cmd_name)
        return super().get_command(ctx, cmd_name) if entry is None else entry.load()
