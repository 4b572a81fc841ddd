"""Notes in a folder of results at which case rules have ended a campaign, or that they may: `stopped.json`.

Results end there, whatever workers had computed beyond it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from parcours.errors import BadResults
from parcours.run.atomic import write_atomically

if TYPE_CHECKING:
    from parcours.run.store import Campaign

STOP = "stopped.json"


@dataclass(frozen=True, slots=True)
class Stop:
    """Where a campaign ends: `rules` in words, that may end it from shard `first` on; at case `cases` they did."""

    rules: tuple[str, ...]
    first: int = 0
    cases: int | None = None

    def write(self, folder: Path, campaign: Campaign) -> None:
        """Write it into a folder. Raises BadRequest if it cannot be written to."""
        document = {"campaign": campaign.digest, "rules": self.rules, "first": self.first, "cases": self.cases}
        content = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
        write_atomically(folder / STOP, content.encode())


def read_stop(folder: Path, campaign: Campaign) -> Stop | None:
    """Return what was noted; None if nothing was.

    Raises BadResults: it is damaged, or of another campaign.
    """
    path = folder / STOP
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_bytes())
        rules, first, cases = tuple(document["rules"]), document["first"], document["cases"]
        if document["campaign"] != campaign.digest:
            raise ValueError("it is of another campaign")
        if type(first) is not int or not 0 <= first <= len(campaign.shards) or not all(map(str.isprintable, rules)):
            raise ValueError(f"there is no shard {first}, or a rule is no text")
        if cases is not None and (type(cases) is not int or not 0 < cases <= campaign.n_cases):
            raise ValueError(f"there is no case {cases}")
        if cases is not None and campaign.cases((cases - 1) // campaign.shard_size).stop != cases:
            raise ValueError(f"no shard ends before case {cases}")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        rule = f"must say at which case the campaign was stopped, but: {error}"
        raise BadResults(str(path), rule, "delete it, and resume the campaign", slug="results-stopped") from error
    return Stop(rules, first, cases)
