"""`parcours completion`: scripts that complete commands, options and names in a shell."""

from __future__ import annotations

import click


@click.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def command(shell: str) -> None:
    """Print a script that makes SHELL complete what is typed after `parcours`.

    To keep it, add the line below to ~/.bashrc (for zsh: to ~/.zshrc, with zsh). For fish: parcours completion fish >
    ~/.config/fish/completions/parcours.fish

    Example: eval "$(parcours completion bash)"
    """
    from click.shell_completion import get_completion_class

    from parcours.cli import parcours

    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(parcours, {}, "parcours", "_PARCOURS_COMPLETE").source())
