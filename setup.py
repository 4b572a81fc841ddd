"""Packs the folder `examples` into the wheel, as `parcours/examples`; everything else stands in pyproject.toml."""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).parent


def built(folder: str, names: list[str]) -> set[str]:
    """Return what was built, and what tools left behind: it does not belong into a wheel."""
    by_name = {name for name in names if name in ("build", "__pycache__", "out") or name.startswith(".")}
    files = (Path(folder, name) for name in names if Path(folder, name).is_file())
    return by_name | {one.name for one in files if one.suffix in (".o", ".pyc") or one.read_bytes()[:4] == b"\x7fELF"}


class WithExamples(build_py):
    """Builds the package, and the examples beside it."""

    def run(self) -> None:
        """Copy them, except where nothing is copied: an editable install uses the checkout's own."""
        super().run()
        if not self.editable_mode:
            target = Path(self.build_lib, "parcours", "examples")
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(HERE / "examples", target, ignore=built)


setup(cmdclass={"build_py": WithExamples})
