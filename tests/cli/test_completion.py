"""Shells complete commands, options and names of studies, by the script that `parcours completion` prints."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli import parcours


def test_bash_completes_by_the_script_that_is_printed(tmp_path: Path) -> None:
    script = CliRunner().invoke(parcours, ["completion", "bash"]).output
    program = tmp_path / "parcours"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m parcours "$@"\n')
    program.chmod(0o755)
    asked = 'COMP_WORDS=(parcours studio --no); COMP_CWORD=2; _parcours_completion parcours; echo "${COMPREPLY[@]}"'
    path = f"{tmp_path}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", f"{script}\n{asked}"], env=os.environ | {"PATH": path}, capture_output=True, text=True
    )
    assert done.stdout.split() == ["--no-open"]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_scripts_of_other_shells_ask_the_same(shell: str) -> None:
    assert f"_PARCOURS_COMPLETE={shell}_complete" in CliRunner().invoke(parcours, ["completion", shell]).output
