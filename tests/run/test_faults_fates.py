"""What befalls messages: by the seed alone, at the rates of the plan; and how their content is changed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.run.faults import HOWS, UNTOUCHED, Effects, How, corrupted, corrupted_bytes, parse_plan

MS = 1_000_000

GOLD: list[tuple[tuple[int, ...], int | None]] = [
    ((563464,), None),
    ((996192,), None),
    ((707551,), 8447438099673314469),
    ((864520, 864520), None),
    ((), None),
    ((216389,), None),
]
"""Delays of the copies [ns], and the seed of the corruption, of the first six messages."""


def test_the_effect_of_a_message_depends_on_seed_channel_and_number_only() -> None:
    text = "a: drop 30 %; a: jitter 40 ms; a: corrupt 10 %; b: drop 30 %"
    one = Effects(parse_plan("seed: 5\n" + text))
    forth = [one.effect("a", k, k * MS) for k in range(200)]
    again = Effects(parse_plan("seed: 5\n" + text))
    back = [again.effect("a", k, 17 * k) for k in reversed(range(200))]
    assert forth == back[::-1]
    alone = Effects(parse_plan("seed: 5\na: drop 30 %"))
    assert [bool(effect.copies) for effect in forth] == [bool(alone.effect("a", k, 0).copies) for k in range(200)]
    assert [bool(effect.copies) for effect in forth] != [bool(one.effect("b", k, 0).copies) for k in range(200)]
    other = Effects(parse_plan("seed: 6\n" + text))
    assert forth != [other.effect("a", k, 0) for k in range(200)]


def test_the_effects_of_a_plan_are_these_on_every_machine_and_version() -> None:
    effects = Effects(parse_plan("seed: 7\na: drop 20 %; a: jitter 1 ms; a: duplicate 20 %; a: corrupt 20 %"))
    told = [effects.effect("a", k, 0) for k in range(6)]
    assert [(effect.copies, effect.corrupt) for effect in told] == GOLD


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9])
def test_messages_are_struck_at_the_rate_of_the_plan(share: float) -> None:
    effects = Effects(parse_plan(f"a: drop {share * 100:g} %"))
    n = 20_000
    lost = sum(not effects.effect("a", k, 0).copies for k in range(n))
    assert abs(lost - n * share) < 5.0 * math.sqrt(n * share * (1.0 - share))


def test_jitter_is_spread_over_all_of_its_time() -> None:
    effects = Effects(parse_plan("a: jitter 100 ms"))
    late = np.array([effects.effect("a", k, 0).copies[0] for k in range(5000)])
    assert late.min() >= 0
    assert late.max() <= 100 * MS
    assert late.mean() == pytest.approx(50 * MS, rel=0.05)
    assert len(np.unique(late)) > 4990


def test_delays_of_several_faults_add_up_and_a_copy_comes_later() -> None:
    effects = Effects(parse_plan("a: delay 5 ms; a: duplicate 3 ms; a: reorder 20 ms from 1 s"))
    early, late = effects.effect("a", 0, 0), effects.effect("a", 1, 1000 * MS)
    assert (early.copies, early.reorder) == ((5 * MS, 8 * MS), False)
    assert (late.copies, late.reorder) == ((25 * MS, 28 * MS), True)
    assert early.why == "delayed by 5 ms, doubled, again after 3 ms"


def test_a_fault_reaches_messages_within_its_window_only() -> None:
    effects = Effects(parse_plan("a: drop from 2 s to 5 s; b: drop messages 3 to 4"))
    assert [bool(effects.effect("a", 0, t * 1000 * MS).copies) for t in (1, 2, 4, 5)] == [True, False, False, True]
    assert [bool(effects.effect("b", k, 0).copies) for k in (2, 3, 4, 5)] == [True, False, False, True]
    assert effects.effect("c", 0, 0) is UNTOUCHED
    assert effects.concerns("a")
    assert not effects.concerns("c")


_FIELDS = st.one_of(
    st.floats(),
    st.integers(-(2**62), 2**62),
    st.booleans(),
    st.text(max_size=3),
    st.lists(st.floats(), max_size=4),
    st.lists(st.integers(-(2**40), 2**40), max_size=4).map(lambda values: np.array(values, np.int64)),
    st.lists(st.floats(), max_size=4).map(np.array),
)


@given(st.lists(_FIELDS, max_size=5), st.integers(0, 2**63 - 1), st.sampled_from(HOWS))
def test_a_corruption_changes_one_field_keeps_its_type_and_leaves_the_original(
    values: list[object], seed: int, how: How
) -> None:
    before = [repr(value) for value in values]
    changed, said = corrupted(values, seed, how)
    assert [repr(value) for value in values] == before
    assert repr(corrupted(values, seed, how)) == repr((changed, said))
    assert len(changed) == len(values)
    differ = [k for k, (a, b) in enumerate(zip(values, changed, strict=True)) if a is not b]
    assert len(differ) <= 1
    assert differ or said == "nothing that can be changed"
    for k in differ:
        assert type(changed[k]) is type(values[k])
        assert said.startswith(f"field {k}")
        old, new = values[k], changed[k]
        if isinstance(old, np.ndarray) and isinstance(new, np.ndarray):
            assert old.dtype == new.dtype
            assert (len(old) != len(new)) == ("one" in said)


def test_every_way_of_corruption_does_what_it_says() -> None:
    values = (1.5, np.array([2, 3]), True)
    seen = {how: [corrupted(values, seed, how)[0] for seed in range(60)] for how in HOWS}
    assert {float(v[0]) for v in seen["sign"]} == {1.5, -1.5}  # type: ignore[arg-type]
    assert {float(v[0]) for v in seen["scale"]} == {1.5, 15.0, 150.0, 1500.0}  # type: ignore[arg-type]
    assert all(not math.isfinite(v[0]) for v in seen["nan"])  # type: ignore[arg-type]
    assert {len(v[1]) for v in seen["length"]} == {1, 3}  # type: ignore[arg-type]
    assert len({repr(v) for v in seen["bit"]}) > 20
    assert {v[2] for v in seen["bit"]} == {True, False}
    assert len({repr(v) for v in seen["any"]}) > 20


@given(st.binary(max_size=20), st.integers(0, 2**63 - 1))
def test_corrupt_bytes_differ_by_a_bit_or_by_a_byte_in_length(data: bytes, seed: int) -> None:
    bit, length = corrupted_bytes(data, seed, "bit"), corrupted_bytes(data, seed, "length")
    assert len(bit) == len(data)
    assert sum((a ^ b).bit_count() for a, b in zip(bit, data, strict=True)) == (1 if data else 0)
    assert abs(len(length) - len(data)) == 1
    assert length.startswith(data[:-1])
    assert corrupted_bytes(data, seed) == corrupted_bytes(data, seed)
