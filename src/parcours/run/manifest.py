"""What a campaign computes, and the manifest that says so in its folder: `campaign.json`, with its own SHA-256."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from parcours.errors import BadRequest, BadResults
from parcours.run.atomic import write_atomically

FORMAT, FORMER = "campaign/2", "campaign/1"
MANIFEST = "campaign.json"
_MOST_SHARDS = 1_000_000


def packed_dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the same fields without padding, the lowest byte of each number first.

    NumPy's `repack_fields` does as much, but loads masked arrays first, a hundredth of the start of a run.

    >>> packed_dtype(np.dtype({"names": ["a", "b"], "formats": [">i2", ("f8", (2,))], "offsets": [1, 8]}))
    dtype([('a', '<i2'), ('b', '<f8', (2,))])
    """
    if dtype.subdtype is not None:
        element, shape = dtype.subdtype
        return np.dtype((packed_dtype(element), shape))
    if dtype.names is None:
        return dtype.newbyteorder("<")
    return np.dtype([(name, packed_dtype(dtype[name])) for name in dtype.names])


@dataclass(frozen=True, slots=True)
class Campaign:
    """What is computed: everything that decides the bytes of the results.

    Args:
        study: e.g. ramp_system.
        schedule: which variant of the system under test, e.g. original.
        seed: of the whole campaign, not negative.
        n_cases: at least 1.
        dtype: the record of one case; padding and byte order are normalised.
        parameters: whatever else the study depends on; JSON values only.
        shard_size: cases a shard, at least 1.
        units: of columns of the shards, by name (`measures.duration`), for who reads them; the others are numbers.

    Raises:
        BadRequest: a count is out of range, or the dtype or parameters cannot be stored.

    >>> campaign = Campaign("demo", "original", 1, 10, np.dtype([("x", "f8")]), shard_size=4)
    >>> [campaign.cases(k) for k in campaign.shards]
    [range(0, 4), range(4, 8), range(8, 10)]
    """

    study: str
    schedule: str
    seed: int
    n_cases: int
    dtype: np.dtype[np.void]
    parameters: Mapping[str, object] = field(default_factory=dict)
    shard_size: int = 256
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("n_cases", 1), ("shard_size", 1)):
            count = getattr(self, name)
            if not isinstance(count, int) or count < least:
                rule = f"{name} is a whole number of at least {least}, but was given as {count!r}"
                raise BadRequest(f"campaign {self.study!r}", rule, slug="count-range")
        if len(self.shards) > _MOST_SHARDS:
            rule = f"a campaign has at most {_MOST_SHARDS} shards, but would have {len(self.shards)}"
            raise BadRequest(f"campaign {self.study!r}", rule, "give a larger shard_size", slug="shard-count")
        if self.dtype.names is None or self.dtype.hasobject:
            rule = f"results are records of numbers, but their dtype is {self.dtype}"
            raise BadRequest(f"campaign {self.study!r}", rule, "give a structured dtype", slug="results-dtype")
        object.__setattr__(self, "dtype", packed_dtype(self.dtype))
        try:
            text = json.dumps(dict(self.parameters), sort_keys=True, allow_nan=False)
        except (TypeError, ValueError) as error:
            rule = f"parameters are finite numbers, texts, lists and mappings, but: {error}"
            raise BadRequest(f"campaign {self.study!r}", rule, slug="results-parameters") from error
        object.__setattr__(self, "parameters", json.loads(text))

    @property
    def shards(self) -> range:
        """The numbers of all shards."""
        return range(-(-self.n_cases // self.shard_size))

    def cases(self, shard: int) -> range:
        """Return the case numbers of a shard."""
        return range(shard * self.shard_size, min((shard + 1) * self.shard_size, self.n_cases))

    def manifest(self) -> dict[str, object]:
        """Return the campaign as JSON values."""
        return {
            "parcours": FORMAT,
            "study": self.study,
            "schedule": self.schedule,
            "seed": self.seed,
            "parameters": self.parameters,
            "n_cases": self.n_cases,
            "shard_size": self.shard_size,
            "dtype": json.loads(json.dumps(np.lib.format.dtype_to_descr(self.dtype))),
            **({"units": dict(self.units)} if self.units else {}),
        }

    @property
    def digest(self) -> str:
        """The SHA-256 of the manifest."""
        return _manifest_sum(self.manifest())


def differences(ours: object, theirs: object, path: str = "") -> list[str]:
    """Return the leaves in which two JSON values differ, in words.

    >>> differences({"a": {"x": 1, "y": 2}, "b": 3}, {"a": {"x": 1, "y": 5}, "b": 3})
    ['a.y is 2, but was 5']
    """
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        keys = dict.fromkeys([*ours, *theirs])
        inner = [differences(ours.get(key), theirs.get(key), f"{path}.{key}" if path else str(key)) for key in keys]
        return [one for found in inner for one in found]
    if ours == theirs and type(ours) is type(theirs):
        return []
    return [f"{path} is {_brief(ours)}, but was {_brief(theirs)}"]


def _brief(value: object) -> str:
    text = "absent" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else text[:77] + "..."


def _manifest_sum(document: Mapping[str, object]) -> str:
    """Return the SHA-256 of a manifest's values, whatever their order and layout."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def read_manifest(folder: Path, form: str = FORMAT) -> Campaign:
    """Return the campaign that a folder's manifest of this form describes. Raises BadResults as `open_results`."""
    path = folder / MANIFEST
    try:
        document = json.loads(path.read_bytes())
    except OSError as error:
        rule = f"a results folder holds a {MANIFEST}, but: {error.strerror}"
        raise BadResults(str(folder), rule, "name a folder that a campaign wrote", slug="results-manifest") from error
    except (ValueError, RecursionError) as error:
        rule = f"must be JSON, but is cut short or changed: {error}"
        raise BadResults(str(path), rule, "run the campaign into a new folder", slug="results-manifest") from error
    version = document.get("parcours") if isinstance(document, dict) else None
    if version != form:
        rule = f"this version reads {FORMAT!r}, but the file says {version!r}"
        remedy = (
            f"parcours results {shlex.quote(str(folder))} --convert"
            if version == FORMER
            else "use the version that wrote it"
        )
        raise BadResults(str(path), rule, remedy, slug="results-version")
    noted = document.pop("sha256", None)
    if noted != _manifest_sum(document):
        rule = "must have the SHA-256 it notes, but was changed since it was written"
        raise BadResults(str(path), rule, "run the campaign into a new folder", slug="results-manifest")
    try:
        campaign = Campaign(
            study=_text(document["study"]),
            schedule=_text(document["schedule"]),
            seed=document["seed"],
            n_cases=document["n_cases"],
            dtype=np.lib.format.descr_to_dtype(_tuples(document["dtype"])),  # type: ignore[arg-type]
            parameters=document["parameters"],
            shard_size=document["shard_size"],
            units={_text(name): _text(unit) for name, unit in document.get("units", {}).items()},
        )
    # A changed file may hold anything: NumPy parses the type codes, and raises whatever its parser does.
    except (ArithmeticError, AttributeError, LookupError, RecursionError, SyntaxError, TypeError, ValueError,
            BadRequest) as error:  # fmt: skip
        rule = f"must describe a campaign, but does not: {error}"
        raise BadResults(str(path), rule, "run the campaign into a new folder", slug="results-manifest") from error
    return campaign


def write_manifest(folder: Path, campaign: Campaign) -> None:
    """Write what the shards are results of, with its sum. Raises BadRequest: the folder cannot be written to."""
    signed = {**campaign.manifest(), "sha256": campaign.digest}
    content = json.dumps(signed, indent=1, sort_keys=True, allow_nan=False) + "\n"
    write_atomically(folder / MANIFEST, content.encode())


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _tuples(descr: object) -> object:
    """Give back to a dtype description the tuples that JSON turned into lists: [name, type, shape]."""
    if not isinstance(descr, list):
        raise TypeError(f"dtype {descr!r} is no list of fields")
    made: list[tuple[object, ...]] = []
    for name, kind, *shape in descr:
        made.append((name, _tuples(kind) if isinstance(kind, list) else kind, *(tuple(part) for part in shape)))
    return made
