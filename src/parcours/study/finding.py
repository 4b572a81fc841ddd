"""Finds the study that a user names, the study that wrote a folder of results, and judges a case of either."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, cast

from parcours.errors import BadRequest, BadResults, ParcoursError, one_of
from parcours.study.journal import RUN, read_question
from parcours.study.loading import NEIGHBOURS, is_target, load
from parcours.study.parameters import settings_of
from parcours.study.protocol import Described, Judged, Results, Study
from parcours.suite import Case

if TYPE_CHECKING:
    from parcours.study.components.study import ComponentStudy

# Entry points of this group name studies: `name = package.module:STUDY`, an object or a function that returns one
GROUP = "parcours.studies"
FILE = "study.yaml"
_NEEDED = ("name", "kind", "parameters", "suite", "run", "read", "report", "judge")


def registered() -> Sequence[Described]:
    """Return the studies that installed packages register, by name; none is loaded."""
    return [
        Described(point.name, point.dist.name if point.dist is not None else "", point.value)
        for point in sorted(entry_points(group=GROUP), key=lambda point: point.name)
    ]


def find(given: str) -> Study:
    """Return the study that a user names.

    Args:
        given: a registered name, a folder with a study.yaml, such a file, `file.py:STUDY` or `module:STUDY`.

    Raises:
        BadRequest: there is no such study, or what is found is not a study.
        BadModel: a study.yaml, or a file that it names, is wrong.
    """
    points = {point.name: point for point in entry_points(group=GROUP)}
    if given in points:
        return _loaded(points[given])
    if is_target(given):
        return checked(load(given), given)
    path = Path(given)
    if path.is_dir():
        path = path / FILE
    python = path.suffix == ".py" and path.is_file()
    if not python and (path.is_file() or os.sep in given or given.endswith((".yaml", ".yml"))):
        from parcours.study.study_file import read_study

        return read_study(path)
    rule = (
        f"must be a registered name, a folder with a {FILE}, such a file, file.py:NAME or module:NAME, but is {given!r}"
    )
    remedy = one_of(given, list(points))
    if python:
        remedy = f"name what the file defines: {given}:NAME; a planner: parcours run navigation --planner {given}:NAME"
    raise BadRequest("study", rule, remedy, slug="unknown-study")


def find_components(where: str) -> ComponentStudy:
    """Return a component study by where it is; for nodes, which make its components in processes of their own."""
    from parcours.study.components.study import ComponentStudy

    found = find(where) if where else None
    if not isinstance(found, ComponentStudy):
        rule = f"a node must find its study by name or file, but {where!r} names none"
        raise BadRequest("study", rule, "give the object its `where`: file.py:NAME", slug="unknown-study")
    return found


def checked(found: object, given: str) -> Study:
    """Return what was loaded if it is a study, or what it returns if it is a function.

    Raises BadRequest: it is not a study; what it lacks is named.
    """
    if callable(found) and not hasattr(found, "suite"):
        try:
            found = found()
        except ParcoursError:
            raise
        except Exception as error:
            rule = f"the function that returns the study must not raise, but raised {type(error).__name__}: {error}"
            raise BadRequest(given, rule, "run it alone to see where", slug="target-raised") from error
    absent = [name for name in _NEEDED if not hasattr(found, name)]
    if absent:
        rule = f"a study has {', '.join(_NEEDED)}, but {type(found).__name__} lacks {', '.join(absent)}"
        raise BadRequest(given, rule, "see docs/studies.md", slug="study-form")
    if not getattr(found, "where", "") and dataclasses.is_dataclass(found) and not isinstance(found, type):
        where, _, name = given.rpartition(":")
        full = f"{Path(where).absolute()}:{name}" if where.endswith(".py") else given
        found = dataclasses.replace(found, where=full)
    if is_target(given) and dataclasses.is_dataclass(found) and getattr(found, "digests", None) == {}:
        found = dataclasses.replace(found, digests=_digests(given))  # type: ignore[type-var]
    return cast(Study, found)


def _digests(given: str) -> dict[str, str]:
    """Return the digests of the files in the folder of a study's file that were loaded with it.

    Its results depend on these, whatever classes and functions of them it uses.
    """
    where = given.rpartition(":")[0]
    path = Path(where) if where.endswith(".py") else None
    if path is None:
        module = getattr(sys.modules.get(where), "__file__", None)
        path = Path(module) if module else None
    if path is None:
        return {}
    folder = path.resolve().parent
    loaded = [*sys.modules.values(), *NEIGHBOURS.get(str(folder), {}).values()]
    files = {Path(file).resolve() for one in loaded if (file := getattr(one, "__file__", None))}
    beside = sorted(one for one in files if one.is_relative_to(folder) and "site-packages" not in one.parts)
    return {str(one.relative_to(folder)): hashlib.sha256(one.read_bytes()).hexdigest()[:16] for one in beside}


def _loaded(point: EntryPoint) -> Study:
    try:
        found = point.load()
    except Exception as error:
        package = point.dist.name if point.dist is not None else "unknown"
        rule = (
            f"package {package} registers it as {point.value}, but loading that raised {type(error).__name__}: {error}"
        )
        raise BadRequest(f"study {point.name!r}", rule, "repair or remove the package", slug="study-broken") from error
    return checked(found, point.name)


def study_of(folder: Path, given: str = "") -> Study:
    """Return the study that wrote a folder.

    Raises:
        BadRequest: the study is not where the folder says.
        BadResults: the folder holds no results.
    """
    if given:
        return find(given)
    where = _where(folder)
    try:
        return find(where)
    except BadRequest as error:
        if error.slug not in ("unknown-study", "unreadable-file", "target-missing"):
            raise
        rule = f"its study must be found, but {where!r} names none here"
        raise BadRequest(str(folder), rule, "say where it is: --study FOLDER", slug="results-where") from error


def require_results(folder: Path) -> None:
    """Raise BadResults unless the folder holds results."""
    _where(folder)


def _where(folder: Path) -> str:
    if (folder / RUN).exists():
        return str(read_question(folder)["where"])
    from parcours.run.store import MANIFEST
    from parcours.study.components.results import FILE as COMPONENTS
    from parcours.study.components.results import read_components

    try:  # results without run.json: of the demo, or of a Parcours that did not write it
        if (folder / MANIFEST).exists():
            return str(json.loads((folder / MANIFEST).read_bytes())["study"])
        if (folder / COMPONENTS).exists():
            return read_components(folder).results[0].id.partition("/")[0]
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise BadResults(str(folder), f"must say what was run, but: {error}", slug="results-manifest") from error
    found = "this one does not" if folder.is_dir() else "there is no such folder"
    rule = f"a results folder holds what `parcours run` wrote, but {found}"
    raise BadResults(str(folder), rule, "name a folder that was given as --out", slug="results-manifest")


def read_all(folders: Sequence[Path], given: str = "") -> list[tuple[Study, dict[str, Results]]]:
    """Return the results of folders, those of one family of studies together, with a study of that family."""
    families: dict[str, tuple[Study, dict[str, Results]]] = {}
    for folder in folders:
        study = study_of(folder, given)
        _, results = families.setdefault(study.family, (study, {}))
        results[str(folder)] = study.read(folder)
    return list(families.values())


def judge_case(case: Case, study: str | Study = "", **settings: object) -> Judged:
    """Execute one case in simulated time and judge it.

    Args:
        case: of a study, as its plan or a suite file holds it.
        study: it, or how a command line names it, which reads its files again for each case; by default the name in
            the case, which must be registered.
        settings: of the study's parameters, where they differ from the defaults.

    Raises:
        BadRequest: the study or a parameter is unknown, or a value is not allowed.
        BadSuite: the study has no such case, or other values than its number and seed give.

    >>> case = next(find("examples/lift").suite({}, 1))
    >>> judged = judge_case(case, "examples/lift")
    >>> judged.verdict.value, judged.case.study
    ('pass', 'lift')
    """
    found = find(study or case.study) if isinstance(study, str) else study
    return found.judge(case, settings_of(found.parameters, settings, f"study {found.name}"))
