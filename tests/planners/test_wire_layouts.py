"""Layouts of records: every word travels, once, and a fault planted in one of their parts is found."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from parcours_ramp.planner.flat import CountedPart, Given, Part, RecordLayout
from parcours_ramp.planner.forms import PATHS, PREDICTIONS, TRAJECTORIES
from parcours_ramp.planner.messages import (
    MAX_PIECES,
    PATH,
    PREDICTION,
    TRAJECTORY,
    many,
)


def filled(kind: Any, n: int, counts: dict[str, int]) -> Any:
    """Return records all of whose numbers differ."""
    records = many(kind, n)
    words = np.asarray(records).view(np.float64)
    words[:] = np.arange(1, len(words) + 1)
    for name in kind.names:
        if kind[name] == np.int64:
            records[name] = np.arange(1, n + 1) + 100 * kind.names.index(name)
    for name, count in counts.items():
        records[name] = count
    if "pieces" in kind.names:
        records.pieces.kind = np.arange(1, n * MAX_PIECES + 1).reshape(n, -1)
    return records


LAYOUTS = [
    (TRAJECTORIES, filled(TRAJECTORY, 3, {"n": 40, "n_pieces": 5, "n_legs": 9})),
    (PREDICTIONS, filled(PREDICTION, 2, {"n": 30})),
    (PATHS, filled(PATH, 4, {"n": 6})),
]


@pytest.mark.parametrize(("layout", "records"), LAYOUTS)
def test_a_part_that_is_lost_or_confused_in_restoring_is_found(
    layout: RecordLayout, records: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = layout.flatten("best_trajectory", records)
    sound = layout._parts

    def back() -> bytes:
        restored: bytes = layout.restore(Given("best_trajectory", layout.fields, values)).tobytes()
        return restored

    expected = back()
    planted = 0
    for k, part in enumerate(sound):
        faults: list[tuple[Part | CountedPart, ...]] = [()]
        if isinstance(part, Part) and len(part.columns) > 1:
            faults.append((dataclasses.replace(part, columns=part.columns[::-1]),))
        if isinstance(part, CountedPart):
            faults.append((dataclasses.replace(part, begin=part.begin - 1),))
        for fault in faults:
            monkeypatch.setattr(layout, "_parts", (*sound[:k], *fault, *sound[k + 1 :]))
            assert back() != expected, part.field.name
            planted += 1
    assert planted > len(sound)


@pytest.mark.parametrize(("layout", "records"), LAYOUTS)
def test_the_parts_of_a_layout_hold_every_word_of_a_record_once(layout: RecordLayout, records: Any) -> None:
    words = layout.restore(Given("best_trajectory", layout.fields, layout.flatten("best_trajectory", records)))
    sent = sum(value.size for value in layout.flatten("best_trajectory", records))
    values = words.view(np.ndarray).view(np.int64)
    assert np.count_nonzero(values) == sent
    given = records.view(np.ndarray).view(np.int64)
    assert np.array_equal(values[values != 0], given[values != 0])
    held = np.zeros(layout._words, np.int64)
    for part in layout._parts:
        if isinstance(part, Part):
            held[part.columns] += 1
        else:
            part.entries(held[None])[...] += 1
    assert held.tolist() == [1] * layout._words
