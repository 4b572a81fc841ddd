"""`parcours studio`: a page in the browser on the models, studies and runs of a folder."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

import click

from parcours.cli.options import PATH


@click.command("studio")
@click.argument("folder", default=".", type=PATH)
@click.option("--port", type=click.IntRange(0, 65535), default=8017, show_default=True, help="0 for any free one.")
@click.option("--no-open", is_flag=True, help="Do not open a browser.")
@click.option("--json", "as_json", is_flag=True, help="Print the address as a line of JSON.")
def command(folder: Path, port: int, no_open: bool, as_json: bool) -> None:
    """Edit, run and watch the studies of FOLDER in the browser, on this machine only. Ctrl-C ends it.

    The address that it prints holds a token: anyone with it can change files in the folder and run its studies.

    Example: parcours studio examples/lift

    Example: parcours studio --port 0 --no-open --json
    """
    import json
    import secrets

    from parcours.errors import BadRequest

    root = folder.resolve()
    if not root.is_dir():
        raise BadRequest(str(folder), "the studio's folder must exist, but does not", slug="studio-file")
    try:
        from parcours.studio.folder import Folder
        from parcours.studio.server import Studio, bound, serve
    except ModuleNotFoundError as error:
        rule = f"it needs the package {str(error.name).partition('.')[0]}, which is not installed"
        raise BadRequest("studio", rule, "pip install 'parcours[studio]'", slug="no-studio-extra") from error
    token = secrets.token_urlsafe(24)
    listener = bound(port)
    listener.listen(128)
    address = f"http://127.0.0.1:{listener.getsockname()[1]}/?token={token}"
    click.echo(json.dumps({"url": address}) if as_json else f"studio of {root}: {address}\nCtrl-C ends it.")
    sys.stdout.flush()
    with contextlib.nullcontext() if no_open else _opened(address):
        serve(Studio(Folder(root)), listener, token)


@contextlib.contextmanager
def _opened(address: str) -> Iterator[None]:
    """Open the address through a file that only this user can read: every user can see the browser's command line."""
    import tempfile
    import threading
    import webbrowser

    with tempfile.NamedTemporaryFile("w", prefix="parcours-studio-", suffix=".html") as file:
        file.write(
            f'<!doctype html><meta http-equiv="refresh" content="0; url={address}"><title>Parcours studio</title>'
        )
        file.flush()
        # Apart: a browser on the terminal returns when it is left.
        threading.Thread(target=webbrowser.open, args=(f"file://{file.name}",), daemon=True).start()
        yield
