"""`parcours compile`: compile all kernels now, so that no later command waits for it."""

from __future__ import annotations

import click

from parcours.cli.options import workers


@click.command("compile")
@workers
def command(workers: int) -> None:
    """Compile all kernels for this machine, once, on all processors, for example in an image.

    Any command compiles the missing kernels that it needs. PARCOURS_CACHE_DIR says where machine code is kept.
    That of other versions is removed once nobody has used it for a week.

    Example: parcours compile
    """
    from parcours.cli.progress import progress, say_if_cold
    from parcours.compiling import compile_all
    from parcours.kernels import kernel_cache

    say_if_cold()
    with progress() as report:
        compile_all(workers, lambda part, done, total: report("compiled", done, total))
    click.echo(f"compiled kernels are in {kernel_cache()}")
