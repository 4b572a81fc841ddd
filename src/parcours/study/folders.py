"""A folder of results -> the study that wrote it, and its results."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from parcours.errors import BadRequest, BadResults
from parcours.study.components.results import FILE, read_components
from parcours.study.finding import find
from parcours.study.journal import RUN, read_question
from parcours.study.protocol import Results, Study


def study_of(folder: Path, given: str = "") -> Study:
    """Return the study that wrote a folder.

    Args:
        folder: of results.
        given: how the user names the study; what the folder says if empty.

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


def _where(folder: Path) -> str:
    if (folder / RUN).exists():
        return str(read_question(folder)["where"])
    try:  # results without run.json: of the demo, or of a Parcours that did not write it
        if (folder / "campaign.json").exists():
            return str(json.loads((folder / "campaign.json").read_bytes())["study"])
        if (folder / FILE).exists():
            return read_components(folder).results[0].id.partition("/")[0]
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise BadResults(str(folder), f"must say what was run, but: {error}", slug="results-manifest") from error
    rule = "a results folder holds what `parcours run` wrote, but this one does not"
    raise BadResults(str(folder), rule, "name a folder that was given as --out", slug="results-manifest")


def read_all(folders: Sequence[Path], given: str = "") -> list[tuple[Study, dict[str, Results]]]:
    """Return the results of folders, those of one family of studies together, with a study of that family."""
    families: dict[str, tuple[Study, dict[str, Results]]] = {}
    for folder in folders:
        study = study_of(folder, given)
        _, results = families.setdefault(study.family, (study, {}))
        results[str(folder)] = study.read(folder)
    return list(families.values())
