"""Keeps results in a folder: each shard a NumPy file, written once, whole or not at all, with SHA-256.

A shard holds the results of consecutive cases as a structured array without padding, little-endian: the same
bytes on any machine. `campaign.json` says what the shards are results of. A shard is finished when its
sum stands.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.lib.recfunctions import repack_fields
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults, HostFailure
from parcours.run.atomic import sweep, unwritable, write_atomically
from parcours.run.stops import read_stop

FORMAT = "campaign/1"
MANIFEST = "campaign.json"
_SUM = re.compile(r"shard-(\d{6,})\.npy\.sha256", re.ASCII)
_MOST_SHARDS = 1_000_000

Rows = NDArray[np.void]
"""Results, one record per case, shape (n_cases,)."""


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
        object.__setattr__(self, "dtype", repack_fields(self.dtype.newbyteorder("<"), recurse=True))
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
        }

    @property
    def digest(self) -> str:
        """The SHA-256 of the manifest."""
        return _manifest_sum(self.manifest())


class Store:
    """The results of one campaign in one folder. Make it with `create` or `open_results`."""

    # campaign.json              what all shards are results of, and the SHA-256 of what it says
    #   shard-000000.npy         cases 0..255, one record each
    #   shard-000000.npy.sha256  its sum: this shard is finished
    #   shard-000001.npy         without a sum: the writer was killed here, the shard is computed again
    # stopped.json               rules that may end it early, and at which case they did: results end there

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self.folder, self.campaign = folder, campaign

    @property
    def planned(self) -> int:
        """How many cases it has: those of the campaign, or up to where a rule has ended it.

        Raises BadResults: what says so is damaged, or of another campaign.
        """
        stop = read_stop(self.folder, self.campaign)
        return self.campaign.n_cases if stop is None or stop.cases is None else stop.cases

    @property
    def shards(self) -> range:
        """The numbers of the shards of these cases."""
        return range(-(-self.planned // self.campaign.shard_size))

    def has(self, shard: int) -> bool:
        """Return whether a shard is finished."""
        return _sum(self.path(shard)).exists()

    def discard(self, first: int) -> None:
        """Remove the shards from one on."""
        for shard in self.campaign.shards[first:]:
            for path in (_sum(self.path(shard)), self.path(shard)):
                path.unlink(missing_ok=True)

    def path(self, shard: int) -> Path:
        """Return where a shard's array lies; its sum lies beside it, with .sha256 appended."""
        return self.folder / f"shard-{shard:06d}.npy"

    def finished(self) -> set[int]:
        """Return the shards that are finished, also those beyond a case at which a rule has ended the campaign."""
        with contextlib.suppress(FileNotFoundError), os.scandir(self.folder) as files:
            return {int(found[1]) for one in files if (found := _SUM.fullmatch(one.name))}
        return set()

    def missing(self) -> tuple[int, ...]:
        """Return the shards that are still to be computed."""
        finished = self.finished()
        return tuple(shard for shard in self.shards if shard not in finished)

    def write(self, shard: int, rows: Rows) -> None:
        """Write the results of a shard's cases, shape (len(cases),).

        Raises:
            HostFailure: shape or dtype are not the campaign's.
            BadRequest: the folder cannot be written to.
        """
        cases, dtype = self.campaign.cases(shard), self.campaign.dtype
        if rows.shape != (len(cases),) or rows.dtype.names is None or _plain(rows.dtype) != dtype:
            rule = f"must give {len(cases)} records of {dtype}, but gave shape {rows.shape} of {rows.dtype}"
            raise HostFailure(f"cases {cases.start}..{cases.stop - 1}", rule, slug="shard-shape")
        buffer = io.BytesIO()
        packed = rows.astype(dtype)  # field by field: padding of the given array is never copied
        np.lib.format.write_array(buffer, packed, version=(1, 0), allow_pickle=False)
        content = buffer.getvalue()
        path = self.path(shard)
        # The array comes first: a shard counts as finished when its sum is there: a kill in between costs one shard.
        write_atomically(path, content)
        write_atomically(_sum(path), f"{hashlib.sha256(content).hexdigest()}  {path.name}\n".encode())

    def read(self, shard: int) -> Rows:
        """Return the results of a finished shard, shape (len(cases),).

        Raises:
            BadResults: the shard is missing, cut short, changed since, or of another form.
        """
        path = self.path(shard)
        try:
            content, noted = path.read_bytes(), _sum(path).read_text(encoding="ascii").split()
        except (OSError, UnicodeDecodeError) as error:
            raise _damaged(path, f"must be readable with its sum, but: {error}") from error
        found = hashlib.sha256(content).hexdigest()
        if not noted or noted[0] != found:
            given = f"its {len(content)} bytes have {found[:12]}...: it was cut short or changed"
            raise _damaged(path, f"must have the SHA-256 noted beside it, but {given}")
        try:
            rows: Rows = np.load(io.BytesIO(content), allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise _damaged(path, f"must be a NumPy array, but: {error}") from error
        expected = (len(self.campaign.cases(shard)),)
        if rows.shape != expected or rows.dtype != self.campaign.dtype:
            raise _damaged(path, f"must hold {expected[0]} records of the manifest's dtype, but holds {rows.shape}")
        return rows

    def verify(self) -> None:
        """Read every finished shard. Raises BadResults for the first damaged one."""
        for _ in self:
            pass

    def __iter__(self) -> Iterator[Rows]:
        absent = set(self.missing())
        return (self.read(shard) for shard in self.shards if shard not in absent)

    def load(self, *, partial: bool = False) -> Rows:
        """Return the results of all cases in order, shape (n_cases,).

        Args:
            partial: accept a campaign that is not finished, and return the finished shards' cases.

        Raises:
            BadResults: shards are missing (unless `partial`) or damaged.
        """
        absent = self.missing()
        if absent and not partial:
            total = len(self.shards)
            rule = f"a finished campaign has {total} shards, but {len(absent)} are missing, from {absent[0]} on"
            raise BadResults(str(self.folder), rule, "resume the campaign", slug="results-unfinished")
        there = [self.campaign.cases(shard) for shard in self.shards if shard not in set(absent)]
        rows, at = np.empty(sum(map(len, there)), self.campaign.dtype), 0
        for part in self:  # one after the other, into one array: a million cases do not fit twice
            rows[at : at + len(part)] = part
            at += len(part)
        return rows


def create(folder: Path, campaign: Campaign) -> Store:
    """Return the store of this campaign in `folder`: started there now, or earlier and to be resumed.

    Args:
        folder: is made if it does not exist; may hold nothing else.
        campaign: must be the one started there, if one was.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds another campaign, or results without a manifest, or damaged shards.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        begun = (folder / MANIFEST).exists()
        orphan = next(folder.glob("shard-*"), None)
    except OSError as error:
        raise unwritable(folder, error) from error
    if not begun:
        if orphan is not None:
            rule = f"results need their {MANIFEST}, but there is only {orphan.name}"
            raise BadResults(str(folder), rule, "name an empty folder", slug="results-manifest")
        signed = {**campaign.manifest(), "sha256": _manifest_sum(campaign.manifest())}
        content = json.dumps(signed, indent=1, sort_keys=True, allow_nan=False) + "\n"
        write_atomically(folder / MANIFEST, content.encode())
        return Store(folder, campaign)
    store = open_results(folder)
    differing = differences(campaign.manifest(), store.campaign.manifest())
    if differing:
        rule = f"holds another campaign: {'; '.join(differing[:5])}"
        remedy = "name another folder, or give --fresh to discard its results and start again"
        raise BadResults(str(folder), rule, remedy, slug="results-other")
    write_atomically(folder / ".writable", b"")
    (folder / ".writable").unlink(missing_ok=True)
    sweep(folder)
    store.verify()
    return store


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


def open_results(folder: Path) -> Store:
    """Return the store that lies in `folder`, for reading.

    Raises:
        BadResults: there is no campaign, or its manifest is cut short, of another version or not a
            campaign's.
    """
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
    if version != FORMAT:
        rule = f"this version reads {FORMAT!r}, but the file says {version!r}"
        raise BadResults(str(path), rule, "use the version of Parcours that wrote it", slug="results-version")
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
        )
    # A changed file may hold anything: NumPy parses the type codes, and raises whatever its parser does.
    except (ArithmeticError, AttributeError, LookupError, RecursionError, SyntaxError, TypeError, ValueError,
            BadRequest) as error:  # fmt: skip
        rule = f"must describe a campaign, but does not: {error}"
        raise BadResults(str(path), rule, "run the campaign into a new folder", slug="results-manifest") from error
    return Store(folder, campaign)


def _sum(path: Path) -> Path:
    return path.with_name(path.name + ".sha256")


def _damaged(path: Path, rule: str) -> BadResults:
    remedy = f"delete {path.name} and {path.name}.sha256, and resume the campaign"
    return BadResults(str(path), rule, remedy, slug="shard-damaged")


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _plain(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    plain: np.dtype[np.void] = repack_fields(dtype.newbyteorder("<"), recurse=True)
    return plain


def _tuples(descr: object) -> object:
    """Give back to a dtype description the tuples that JSON turned into lists: [name, type, shape]."""
    if not isinstance(descr, list):
        raise TypeError(f"dtype {descr!r} is no list of fields")
    made: list[tuple[object, ...]] = []
    for name, kind, *shape in descr:
        made.append((name, _tuples(kind) if isinstance(kind, list) else kind, *(tuple(part) for part in shape)))
    return made
