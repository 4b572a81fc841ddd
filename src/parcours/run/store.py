"""Keeps results in a folder or bucket: each shard a Parquet file, written once, whole or not at all, with SHA-256.

A shard holds the results of consecutive cases, without padding and little-endian: the same rows on any machine
(`parcours.run.columns`). `campaign.json` says what the shards are results of. A shard is finished when its sum stands.
"""

from __future__ import annotations

import itertools
import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadResults, HostFailure
from parcours.run.atomic import sweep, unwritable, write_atomically
from parcours.run.columns import leaf_names, pack, unpack
from parcours.run.locations import is_bucket, names_in
from parcours.run.manifest import MANIFEST as MANIFEST
from parcours.run.manifest import Campaign as Campaign
from parcours.run.manifest import differences, packed_dtype, read_manifest, write_manifest
from parcours.run.stops import read_stop
from parcours.run.sums import damaged, sum_of, summed, summed_columns, sums

_PART = 4 << 20  # bytes of rows that are read together: few enough for a cache, enough for NumPy
_SUM = re.compile(r"shard-(\d{6,})\.parquet\.sha256", re.ASCII)

Rows = NDArray[np.void]
"""Results, one record per case, shape (n_cases,)."""


class Store:
    """The results of one campaign in one folder. Make it with `create` or `open_results`."""

    # campaign.json              what all shards are results of, and the SHA-256 of what it says
    #   shard-000000.parquet         cases 0..255, one record each
    #   shard-000000.parquet.sha256  its sum: this shard is finished
    #   shard-000001.parquet         without a sum: the writer was killed here, the shard is computed again
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
        return sum_of(self.path(shard)).exists()

    def discard(self, shards: Iterable[int]) -> None:
        """Remove shards."""
        for shard in shards:
            for path in (sum_of(self.path(shard)), self.path(shard)):
                path.unlink(missing_ok=True)

    def path(self, shard: int) -> Path:
        """Return where a shard's rows lie; their sum lies beside them, with .sha256 appended."""
        return self.folder / f"shard-{shard:06d}.parquet"

    def name(self, shard: int) -> str:
        """Return what to call a shard in a message."""
        cases = self.campaign.cases(shard)
        return f"shard {shard} (cases {cases.start}..{cases.stop - 1})"

    def finished(self) -> set[int]:
        """Return the shards that are finished, also those beyond a case at which a rule has ended the campaign."""
        return {int(found[1]) for one in names_in(self.folder) if (found := _SUM.fullmatch(one))}

    def in_order(self) -> list[int]:
        """Return the shards that are finished, of `shards`."""
        finished = self.finished()
        return [shard for shard in self.shards if shard in finished]

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
        if rows.shape != (len(cases),) or rows.dtype.names is None or packed_dtype(rows.dtype) != dtype:
            rule = f"must give {len(cases)} records of {dtype}, but gave shape {rows.shape} of {rows.dtype}"
            raise HostFailure(f"cases {cases.start}..{cases.stop - 1}", rule, slug="shard-shape")
        content = pack(rows.astype(dtype))  # field by field: padding of the given array is never copied
        path = self.path(shard)
        # The rows come first: a shard counts as finished when its sum is there: a kill in between costs one shard.
        write_atomically(path, content)
        write_atomically(sum_of(path), sums(content, path.name))

    def read(self, shard: int, names: Sequence[str] = ()) -> Rows:
        """Return the results of a finished shard, shape (len(cases),): all fields, or those of these names.

        `inner.x` is the field x of the record `inner`.

        Raises:
            BadResults: the shard is missing, cut short, changed since, or of another form.
        """
        return self._read((shard,), _chosen(self.campaign.dtype, names))

    def _read(self, shards: Sequence[int], dtype: np.dtype[np.void], columns: Sequence[str] = ()) -> Rows:
        rows = np.empty(sum(len(self.campaign.cases(shard)) for shard in shards), dtype)
        self._fill(rows, shards, columns)
        return rows

    def _fill(self, rows: Rows, shards: Sequence[int], columns: Sequence[str] = ()) -> None:
        at = 0
        for shard in shards:
            path, n = self.path(shard), len(self.campaign.cases(shard))
            content = summed_columns(path, columns) if columns else summed(path)
            try:
                unpack(content, self.campaign.dtype, rows[at : at + n])
            except ValueError as error:
                raise damaged(path, f"must hold {n} records of the manifest's dtype, but: {error}") from error
            at += n

    def damaged(self) -> tuple[int, ...]:
        """Return the finished shards that were cut short or changed since."""

        def is_damaged(shard: int) -> bool:
            try:
                self.read(shard, self.campaign.dtype.names[:1])  # type: ignore[index]
            except BadResults:
                return True
            return False

        finished = self.in_order()
        with ThreadPoolExecutor(2) as readers:
            return tuple(itertools.compress(finished, readers.map(is_damaged, finished)))

    def parts(self, names: Sequence[str] = ()) -> Iterator[Rows]:
        """Yield the results of the finished shards in their order, some thousand cases at a time.

        Two threads read ahead: reading is inflating and summing, which Python lets run beside it.

        Args:
            names: the only fields that are wanted, as for `read`; all if empty. Where they are few of a large shard,
                only their sums are looked at.

        Raises BadResults: a shard is damaged.
        """
        dtype = _chosen(self.campaign.dtype, names)
        columns = leaf_names(dtype) if names else ()
        finished, together = self.in_order(), max(1, _PART // (dtype.itemsize * self.campaign.shard_size))
        groups = [finished[k : k + together] for k in range(0, len(finished), together)]
        ahead = deque[Future[Rows]]()
        with ThreadPoolExecutor(2) as readers:
            try:
                for group in groups:
                    ahead.append(readers.submit(self._read, group, dtype, columns))
                    if len(ahead) > 3:
                        yield ahead.popleft().result()
                while ahead:
                    yield ahead.popleft().result()
            finally:
                readers.shutdown(wait=False, cancel_futures=True)

    def require_finished(self) -> None:
        """Raise BadResults if shards are missing."""
        if absent := self.missing():
            total = len(self.shards)
            rule = f"a finished campaign has {total} shards, but {len(absent)} are missing, from {absent[0]} on"
            raise BadResults(str(self.folder), rule, "resume the campaign", slug="results-unfinished")

    def load(self, *, partial: bool = False) -> Rows:
        """Return the results of all cases in order, shape (n_cases,).

        Args:
            partial: accept a campaign that is not finished, and return the finished shards' cases.

        Raises:
            BadResults: shards are missing (unless `partial`) or damaged.
        """
        if not partial:
            self.require_finished()
        shards = self.in_order()
        ends = np.cumsum([0, *(len(self.campaign.cases(shard)) for shard in shards)]).tolist()
        rows = np.empty(ends[-1], self.campaign.dtype)
        places = [rows[start:end] for start, end in itertools.pairwise(ends)]
        with ThreadPoolExecutor(2) as readers:  # each into its place: a million cases do not fit twice
            list(readers.map(self._fill, places, [[shard] for shard in shards]))
        return rows


def create(folder: Path, campaign: Campaign) -> Store:
    """Return the store of this campaign in `folder`: started there now, or earlier and to be resumed.

    Args:
        folder: is made if it does not exist; may hold nothing else. Or a bucket's, see
            `parcours.run.locations.location`.
        campaign: must be the one started there, if one was.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds another campaign, or results without a manifest.
    """
    try:
        if not is_bucket(folder):  # where there are no folders
            folder.mkdir(parents=True, exist_ok=True)
        there = names_in(folder)
        begun, orphan = MANIFEST in there, next((one for one in there if one.startswith("shard-")), None)
    except OSError as error:
        raise unwritable(folder, error) from error
    if not begun:
        if orphan is not None:
            rule = f"results need their {MANIFEST}, but there is only {orphan}"
            raise BadResults(str(folder), rule, "name an empty folder", slug="results-manifest")
        write_manifest(folder, campaign)
        return Store(folder, campaign)
    store = open_results(folder)
    asked = replace(campaign, units=store.campaign.units)  # they decide no result
    differing = differences(asked.manifest(), store.campaign.manifest())
    if differing:
        rule = f"holds another campaign: {'; '.join(differing[:5])}"
        remedy = "name another folder, or give --fresh to discard its results and start again"
        raise BadResults(str(folder), rule, remedy, slug="results-other")
    write_atomically(folder / ".writable", b"")
    (folder / ".writable").unlink(missing_ok=True)
    sweep(folder)
    return store


def open_results(folder: Path) -> Store:
    """Return the store that lies in `folder`, for reading.

    Raises:
        BadResults: there is no campaign, or its manifest is cut short, of another version or not a
            campaign's.
    """
    return Store(folder, read_manifest(folder))


def _chosen(dtype: np.dtype[np.void], names: Sequence[str]) -> np.dtype[np.void]:
    """Return a record of these fields only, in its order; of all if none is named.

    >>> _chosen(np.dtype([("n", "i8"), ("inner", [("x", "f8"), ("y", "f8")])]), ["inner.y"])
    dtype([('inner', [('y', '<f8')])])
    """
    if not names:
        return dtype
    fields: list[tuple[str, np.dtype[Any]]] = []
    for name in dtype.names or ():
        within = [one.partition(".")[2] for one in names if one.startswith(f"{name}.")]
        if name in names:
            fields.append((name, dtype[name]))
        elif within:
            fields.append((name, _chosen(dtype[name], within)))
    return np.dtype(fields)
