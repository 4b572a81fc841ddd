"""Loads the object that `path/to/file.py:Name` or `package.module:Name` names."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from parcours.errors import BadRequest, one_of


def is_target(text: str) -> bool:
    """Return whether the text names something to load: `file.py:Name` or `module:Name`.

    >>> is_target("mine.py:STUDY"), is_target("package.module:STUDY"), is_target("lift"), is_target("a/b")
    (True, True, False, False)
    """
    where, colon, name = text.rpartition(":")
    return bool(colon and where and name) and all(part.isidentifier() for part in name.split("."))


def load(target: str, folder: Path | None = None) -> object:
    """Return the object that `file.py:Name` or `module:Name` names. What loading prints goes to standard error.

    Args:
        target: a relative file counts from `folder`; modules are looked for there, too.
        folder: by default the current one.

    Raises BadRequest: there is no such file, module or name, or loading raised.

    >>> load("math:hypot")(3.0, 4.0)
    5.0
    """
    where, _, name = target.rpartition(":")
    if not is_target(target):
        rule = f"must be file.py:Name or package.module:Name, but is {target!r}"
        raise BadRequest(target, rule, slug="target-form")
    with contextlib.redirect_stdout(sys.stderr):
        found: object = _module(target, where, folder or Path.cwd())
    for part in name.split("."):
        try:
            found = getattr(found, part)
        except AttributeError as error:
            known = [one for one in dir(found) if not one.startswith("_")]
            raise BadRequest(target, f"{name!r} must be defined there, but is not", one_of(part, known),
                             slug="target-missing") from error  # fmt: skip
    return found


def file_of(target: str, folder: Path) -> Path | None:
    """Return the file that a target names, whether it is there or not; None if it names a module."""
    where = target.rpartition(":")[0]
    return folder / where if where.endswith(".py") or "/" in where else None


def _module(target: str, where: str, folder: Path) -> ModuleType:
    path = file_of(target, folder)
    if path is None:
        with _importable(folder):
            return _guarded(target, lambda: importlib.import_module(where))
    path = path.absolute()
    if not path.is_file():
        rule = f"its file must exist, but there is no {path}"
        raise BadRequest(target, rule, "check the path", slug="target-missing")
    try:
        digest = hashlib.sha256(str(path.resolve()).encode() + b"\0" + path.read_bytes()).hexdigest()[:16]
    except OSError as error:
        raise BadRequest(target, f"its file must be readable, but: {error.strerror}", slug="target-missing") from error
    name = f"parcours_loaded_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise BadRequest(target, "its file must be Python source with the ending .py, but is not", slug="target-form")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    loader = spec.loader

    def execute() -> ModuleType:
        loader.exec_module(module)
        return module

    try:
        with _importable(path.resolve().parent):  # its neighbours are importable, as they are for `python file.py`
            return _guarded(target, execute)
    except BaseException:
        sys.modules.pop(name, None)
        raise


# Folder -> the modules in it that files there have imported: two studies may have a `helpers` each
NEIGHBOURS: dict[str, dict[str, ModuleType]] = {}


@contextlib.contextmanager
def _importable(folder: Path):  # type: ignore[no-untyped-def]
    """Make the modules in a folder importable for a while, and set them aside afterwards."""
    entry = str(folder.resolve())
    ours = NEIGHBOURS.setdefault(entry, {})
    sys.path.insert(0, entry)
    sys.modules.update(ours)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(entry)
        for name, module in list(sys.modules.items()):
            file = getattr(module, "__file__", None) or ""
            if Path(file).parent == Path(entry) and not name.startswith("parcours_loaded_") and name != "__main__":
                ours[name] = sys.modules.pop(name)


def _guarded(target: str, act) -> ModuleType:  # type: ignore[no-untyped-def]
    """Load what the user wrote; what it raises becomes one line with its place."""
    try:
        module: ModuleType = act()
        return module
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        place = _place(error)
        rule = f"loading it must not raise, but {type(error).__name__} was raised{place}: {error}"
        raise BadRequest(target, rule, "run it alone to see where", slug="target-raised") from error


def _place(error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename:
        return f" ({Path(error.filename).name}:{error.lineno})"
    frame = error.__traceback__
    last = ""
    while frame is not None:
        file = frame.tb_frame.f_code.co_filename
        if not file.startswith("<frozen") and "/parcours/" not in file:
            last = f" ({Path(file).name}:{frame.tb_lineno})"
        frame = frame.tb_next
    return last
