"""`parcours completion`: what makes a shell complete commands, options and names."""

from __future__ import annotations

import click


@click.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def command(shell: str) -> None:
    """Print a script that makes SHELL complete what is typed after `parcours`.

    For good: a line in ~/.bashrc or ~/.zshrc, eval "$(parcours completion bash)"; of fish, parcours completion fish >
    ~/.config/fish/completions/parcours.fish

    Example: eval "$(parcours completion bash)"
    """
    from click.shell_completion import get_completion_class

    from parcours.cli import parcours

    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(parcours, {}, "parcours", "_PARCOURS_COMPLETE").source())
