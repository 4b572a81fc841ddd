"""Whatever a world file says, it is a world or one of our errors; `make fuzz` has other readers."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from parcours.errors import ParcoursError
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import parse_world, shipped

TEXTS = [path.read_text(encoding="utf-8") for path in shipped().values()]
TOKENS = (
    "0", "-1", "1e308", "1e400", "inf", "nan", "[", "]", "{", "}", "'x'", "true", "none", "kind", "motion", "s",
    "people", "~", "!!python", "&a", "*a", "1000000", "abc", "[]", "{}", "[[0,0,1,1]]", "200", "201", "paper",
    "barn-300", "orca", "recorded", "x.csv", "map:", "2.5", "number:", "3,",
)  # fmt: skip


def _spoilt(text: str, by: random.Random) -> str:
    for _ in range(by.randint(1, 4)):
        words = text.split(" ")
        k = by.randrange(len(words))
        deed = by.randrange(4)
        if deed == 0:
            words[k] = by.choice(TOKENS) + ("," if words[k].endswith(",") else "")
        elif deed == 1:
            del words[k]
        elif deed == 2:
            words.insert(k, by.choice(TOKENS))
        else:
            words[k] = words[k][: by.randrange(len(words[k]) + 1)]
        text = " ".join(words)
    return text


@pytest.mark.parametrize("seed", range(8))
def test_a_spoilt_world_is_refused_in_our_words(seed: int) -> None:
    by = random.Random(seed)
    refused = 0
    for _ in range(15):
        text = _spoilt(by.choice(TEXTS), by)
        try:
            WorldCases(1, parse_world(text, "spoilt.yaml", Path("/nowhere"))).staged([0], 0.05)
        except ParcoursError as error:
            refused += 1
            assert str(error)
    assert refused
