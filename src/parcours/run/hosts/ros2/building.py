"""Builds packages of ROS 2 interfaces from their files of definitions, as rosidl does, once for each content.

    turtle_msgs/action/Turn.action -> .idl -> C and C++ -> turtle_msgs/*.py, three libraries, an extension module

No CMake, no workspace: the generators are called as their own command line calls them. The packages are importable from
the folder that `built` returns.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from parcours.errors import BadRequest
from parcours.run.binding.message_types import MAX_DEFINITIONS

KINDS = ("msg", "srv", "action")
"""What can be defined: the names of folders, and of the endings of files in them."""

_MOST_BYTES = 1_000_000
_PATIENCE = 600.0
_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
_PARTS = ("rosidl_generator_c", "rosidl_typesupport_c", "rosidl_generator_py", *_SUPPORTS)
_OF_ALL_ACTIONS = ("action_msgs", "unique_identifier_msgs", "builtin_interfaces", "service_msgs")
_NAME = re.compile(r"[a-z][a-z0-9_]{0,99}", re.ASCII)
_INCLUDE = re.compile(r'#include "([a-z][a-z0-9_]*)/')

Definitions = Mapping[str, Mapping[str, str]]
"""The text of each file, by its path in its package, such as `action/Turn.action`; by the name of the package."""


def built(folders: Iterable[Path]) -> Path | None:
    """Return the folder from which the packages defined in some folders can be imported; None if all are installed.

    It lies under PARCOURS_CACHE_DIR if that is set, else under XDG_CACHE_HOME or ~/.cache.

    Raises BadRequest if a file is no definition, or rosidl or a compiler is not there.
    """
    home = os.environ.get("PARCOURS_CACHE_DIR")
    base = Path(home) if home else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parcours"
    cache = base.absolute() / "ros2"
    wanted = {name: files for name, files in definitions(folders).items() if not _is_installed(name, cache)}
    if not wanted:
        return None
    place = cache / _digest(wanted)
    if not place.is_dir():
        _require_tools(wanted)
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="building-", dir=cache) as folder:
            made = Path(folder, "made")
            _write(wanted, made)
            _build(made)
            if not place.is_dir():  # else another process was faster
                made.replace(place)
    return place


def definitions(folders: Iterable[Path]) -> Definitions:
    """Return what some folders define: files lie in `PACKAGE/msg`, `PACKAGE/srv` and `PACKAGE/action`, at any depth.

    Raises BadRequest if a file cannot be read, or its package cannot be called so.
    """
    found: dict[str, dict[str, str]] = {}
    for folder in folders:
        for path in sorted(one for kind in KINDS for one in folder.rglob(f"{kind}/*.{kind}")):
            package = path.resolve().parent.parent.name
            try:
                text = path.read_text(encoding="utf-8") if path.stat().st_size <= _MOST_BYTES else ""
            except (OSError, UnicodeDecodeError):
                text = ""
            if not text or not _NAME.fullmatch(package):
                rule = f"a definition is a readable text of at most 1 MB in PACKAGE/{path.parent.name}, but this is not"
                raise BadRequest(str(path), rule, slug="message-definition")
            found.setdefault(package, {})[f"{path.parent.name}/{path.name}"] = text
            if sum(map(len, found.values())) > MAX_DEFINITIONS:
                rule = f"at most {MAX_DEFINITIONS} definitions are read, but there are more"
                raise BadRequest(str(folder), rule, "name the folders of the packages", slug="message-definition")
    return found


def _is_installed(package: str, cache: Path) -> bool:
    """Return whether a package can be imported, and was not built here; a mere folder of its name is none."""
    found = importlib.util.find_spec(package)
    return found is not None and found.origin is not None and not Path(found.origin).is_relative_to(cache)


def _digest(wanted: Definitions) -> str:
    """Return what tells builds apart: the definitions, the interpreter, where ROS is, and when it was installed."""
    whole = [sys.prefix, os.environ.get("AMENT_PREFIX_PATH", ""), str(sysconfig.get_config_var("EXT_SUFFIX"))]
    generator = importlib.util.find_spec("rosidl_generator_c")
    if generator is not None and generator.origin is not None:
        whole.append(str(Path(generator.origin).stat().st_mtime_ns))
    whole += [f"{package}/{file}\0{text}" for package, files in wanted.items() for file, text in files.items()]
    return hashlib.sha256("\0".join(sorted(whole)).encode()).hexdigest()[:32]


def _require_tools(wanted: Definitions) -> None:
    modules = ("rosidl_adapter", "rosidl_generator_c", "rosidl_generator_py", *_SUPPORTS)
    missing = [one for one in modules if importlib.util.find_spec(one) is None]
    missing += [one for one in ("cc", "c++") if shutil.which(one) is None]
    if missing:
        rule = f"must be built, which takes rosidl and a compiler, but missing are {', '.join(missing)}"
        remedy = "install ros-DISTRO-rosidl-default-generators and g++, or the packages themselves"
        raise BadRequest(f"interfaces {', '.join(wanted)}", rule, remedy, slug="message-definition")


def _write(wanted: Definitions, root: Path) -> None:
    for package, files in wanted.items():
        for file, text in files.items():
            path = root / package / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")


def _build(root: Path) -> None:
    """Build all packages of a folder in a process of its own: the generators write to its output. Raises BadRequest."""
    environment = {**os.environ, "AMENT_PREFIX_PATH": os.environ.get("AMENT_PREFIX_PATH") or sys.prefix}
    command = [sys.executable, "-m", "parcours.run.hosts.ros2.building", str(root)]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired as error:
        rule = f"must be built within {_PATIENCE:g} s, but are not"
        raise BadRequest("interfaces", rule, slug="message-definition") from error
    if done.returncode:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()] or ["without a word"]
        said = next((line for line in reversed(lines) if "error" in line.lower()), lines[-1])
        rule = f"must be built, but rosidl or the compiler failed: {said:.300}"
        raise BadRequest("interfaces", rule, "correct the definitions", slug="message-definition")


# What follows runs in a process of its own.


def build(root: Path) -> None:
    """Build the packages of a folder, whose definitions lie in it, those first that others use."""
    packages = {path.name: _idl(root, path) for path in sorted(root.iterdir()) if path.is_dir()}
    uses = {
        name: {one for file in files for one in _INCLUDE.findall(Path(root, name, file).read_text(encoding="utf-8"))}
        for name, files in packages.items()
    }
    while packages:
        name = min(packages, key=lambda one: (len(uses[one] & (packages.keys() - {one})), one))
        _package(root, name, packages.pop(name), uses[name] - {name})
    for path in [*root.rglob("*.o"), *root.rglob("*.c"), *root.rglob("*.cpp")]:
        path.unlink()


def _idl(root: Path, package: Path) -> list[str]:
    """Return the paths in its package of the .idl files that are made of its definitions."""
    import rosidl_adapter.action
    import rosidl_adapter.msg
    import rosidl_adapter.srv

    made = []
    for path in sorted(one for kind in KINDS for one in package.glob(f"{kind}/*.{kind}")):
        kind = path.parent.name
        convert = getattr(getattr(rosidl_adapter, kind), f"convert_{kind}_to_idl")
        convert(package, package.name, path.relative_to(package), path.parent)
        made.append(f"{kind}/{path.stem}.idl")
    return made


def _package(root: Path, name: str, files: Sequence[str], used: Iterable[str]) -> None:
    import numpy
    from ament_index_python import get_packages_with_prefixes

    prefixes = {Path(prefix) for prefix in get_packages_with_prefixes().values()}
    package, apart = root / name, root / ".introspection" / name
    shares = [str(root), *(str(prefix / "share") for prefix in prefixes)]

    def generate(group: str, generator: str, place: Path, **given: Any) -> None:
        found = next(iter(entry_points(group=f"rosidl_cli.command.generate.{group}_extensions", name=generator)))
        found.load()(generator, **given).generate(name, [f"{package}:{file}" for file in files], shares, place)

    generate("type", "c", package)
    generate("type", "py", package, typesupport_implementations=["rosidl_typesupport_c"])
    generate("typesupport", "c", package, typesupport_implementations=list(_SUPPORTS))
    generate("typesupport", "fastrtps_c", package)
    generate("typesupport", "introspection_c", apart)

    headers = [root, apart.parent, Path(sysconfig.get_path("include")), Path(numpy.get_include())]
    for prefix in prefixes:
        headers += [prefix / "include", *(one for one in (prefix / "include").glob("*") if one.is_dir())]
    options = ["-O1", "-w", "-fPIC", *(f"-I{one}" for one in headers)]
    ours = set(package.rglob("*.c*")) - set(package.rglob("*.o"))
    fast = {one for one in ours if one.name.endswith("__type_support_c.cpp")}
    plain = {one for one in ours - fast if one.parent.name == "detail"}
    parts = {
        f"lib{name}__rosidl_generator_c.so": plain,
        f"lib{name}__{_SUPPORTS[0]}.so": fast,
        f"lib{name}__{_SUPPORTS[1]}.so": set(apart.rglob("*.c")),
        f"{name}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}": ours - fast - plain,
    }
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = {one: pool.submit(_compiled, one, options) for part in parts.values() for one in sorted(part)}
    libraries = _libraries(prefixes, {*used, *_OF_ALL_ACTIONS})
    libraries += [str(one) for other in used for one in Path(root, other).glob("*.so")]
    places = ["-Wl,--no-as-needed", "-Wl,-rpath,$ORIGIN", *(f"-Wl,-rpath,$ORIGIN/../{other}" for other in sorted(used))]
    made: list[str] = []
    for file, part in parts.items():
        inputs = [objects[one].result() for one in sorted(part)]
        _run("c++", "-shared", "-o", str(package / file), f"-Wl,-soname,{file}", *places, *inputs, *made,
              *libraries)  # fmt: skip
        made.append(str(package / file))
    Path(package, "__init__.py").touch()


def _libraries(prefixes: Iterable[Path], used: Iterable[str]) -> list[str]:
    """Return what the code is linked with: the libraries of the packages that it uses, and those of rosidl."""
    names = [f"lib{one}__{part}.so" for one in used for part in _PARTS]
    names += [f"lib{one}.so" for one in ("rosidl_runtime_c", "rosidl_typesupport_c", *_SUPPORTS, "fastcdr")]
    names += ["librosidl_typesupport_fastrtps_cpp.so", "librcutils.so"]
    return [str(prefix / "lib" / name) for prefix in prefixes for name in names if (prefix / "lib" / name).exists()]


def _compiled(source: Path, options: Sequence[str]) -> str:
    compiler = ["cc"] if source.suffix == ".c" else ["c++", "-std=c++17"]
    target = f"{source}.o"
    _run(*compiler, *options, "-c", str(source), "-o", target)
    return target


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
