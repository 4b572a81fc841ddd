"""Compiled kernels do what the same lines do in plain Python, and give back every array that they make."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.kernels import Record, heap_kernel, kernel

SHAPE = (3, 4, 5)
KINDS = ("f8", "i8", "i4", "?")


@kernel
def read_1(values: Record, i: int) -> Any:
    return values[i]


@kernel
def read_2(values: Record, i: int, j: int) -> Any:
    return values[i, j]


@kernel
def read_3(values: Record, i: int, j: int, k: int) -> Any:
    return values[i, j, k]


@kernel
def write_1(values: Record, i: int, one: Any) -> None:
    values[i] = one


@kernel
def write_2(values: Record, i: int, j: int, one: Any) -> None:
    values[i, j] = one


@kernel
def write_3(values: Record, i: int, j: int, k: int, one: Any) -> None:
    values[i, j, k] = one


READERS: tuple[Callable[..., Any], ...] = (read_1, read_2, read_3)
WRITERS: tuple[Callable[..., Any], ...] = (write_1, write_2, write_3)


def laid_out(values: np.ndarray[Any, Any], layout: str) -> np.ndarray[Any, Any]:
    """Return the same values in rows, in columns, or with gaps between them and the last axis backwards."""
    if layout == "F":
        return np.asfortranarray(values)
    if layout == "C":
        return np.ascontiguousarray(values)
    wide = np.zeros(tuple(2 * n for n in values.shape), values.dtype)
    strided = wide[tuple(slice(None, None, 2) for _ in values.shape)][..., ::-1]
    strided[...] = values
    return strided


entries = st.tuples(*(st.integers(-n, n - 1) for n in SHAPE))
kinds_of_index = st.lists(st.sampled_from([int, np.int32, np.uint64, np.uint8]), min_size=3, max_size=3)


@settings(max_examples=300, deadline=None)
@given(st.integers(1, 3), st.sampled_from("CFA"), st.sampled_from(KINDS), entries, kinds_of_index)
def test_entries_are_read_and_written_where_numpy_has_them(
    axes: int, layout: str, kind: str, at: tuple[int, ...], kinds: list[Any]
) -> None:
    shape = SHAPE[:axes]
    values = laid_out((np.arange(np.prod(shape)) * 3 - 7).reshape(shape).astype(kind), layout)
    where = tuple(make(i if make in (int, np.int32) else i % n) for i, n, make in zip(at, shape, kinds, strict=False))
    plain = tuple(map(int, where))
    assert READERS[axes - 1](values, *where) == values[plain]
    expected = values.copy()
    expected[plain] = 1
    WRITERS[axes - 1](values, *where, 1.0 if kind == "f8" else 1)
    assert np.array_equal(values, expected)


@kernel
def constant_places(values: Record, few: Record) -> float:
    values[-1] = values[0] + values[-2]
    few[1].x = few[0].x + few[-1].x
    return float(values[-1])


def test_constant_places_count_from_the_end_too_and_records_are_changed_in_place() -> None:
    values, few = np.array([1.0, 2.0, 3.0]), np.zeros(3, [("n", "i4"), ("x", "f8")])
    few["x"] = 1.0, 2.0, 4.0
    assert constant_places(values, few) == 3.0 and values.tolist() == [1.0, 2.0, 3.0]
    assert few["x"].tolist() == [1.0, 5.0, 4.0]


@kernel
def swapped(a: Record, b: Record, rounds: int) -> Any:
    total, last = 0.0, a
    for k in range(rounds):
        a, b = b, a
        for i in range(len(a) - 1, -1, -2):
            if a[i] < 0.0:
                break
            total += a[i] * k
        else:
            last = a
    return total + last[0]


def test_variables_change_from_round_to_round_as_in_python() -> None:
    a, b = np.array([1.0, 2.0, 3.0]), np.array([5.0, -1.0, 7.0])
    for first, second in ((a, b), (b, a), (a, -b), (-a, -b)):
        for rounds in range(5):
            assert swapped(first, second, rounds) == swapped.py_func(first, second, rounds)  # type: ignore[attr-defined]


@kernel
def _checked(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")
    if x > 9.0:
        raise OverflowError("too much")
    return x + 1.0


@kernel
def _summed(values: Record, out: Record) -> float:
    total = 0.0
    for i in range(len(values)):
        out[i] = _checked(values[i])
        total += out[i]
    return total


@kernel
def deep(values: Record, out: Record) -> float:
    return _summed(values, out) + _checked(1.0)


@pytest.mark.parametrize(("bad", "error"), [(-1.0, ValueError), (10.0, OverflowError)])
def test_an_error_deep_below_ends_every_loop_above_it_and_the_next_call_is_sound(
    bad: float, error: type[Exception]
) -> None:
    values, out = np.array([1.0, 2.0, bad, 3.0]), np.zeros(4)
    for _ in range(2):
        with pytest.raises(error, match=r"below zero|too much"):
            deep(values, out)
        assert out.tolist() == [2.0, 3.0, 0.0, 0.0]
        assert deep(values[:2], out) == 7.0
        out[:] = 0.0


def test_a_user_s_own_compiled_function_may_catch_what_a_kernel_raises() -> None:
    @numba.njit  # type: ignore[untyped-decorator]
    def caught(values: Any, out: Any) -> float:
        try:
            return deep(values, out)
        except Exception:
            return -1.0

    assert caught(np.array([1.0, -1.0]), np.zeros(2)) == -1.0
    assert caught(np.array([1.0, 2.0]), np.zeros(2)) == 7.0


@kernel
def catches(x: float) -> float:
    try:
        return _checked(x)
    except Exception:
        return 0.0


def test_a_kernel_that_would_catch_is_refused() -> None:
    with pytest.raises(numba.core.errors.NumbaError, match="a kernel cannot catch"):
        catches(-1.0)


@heap_kernel
def _made(n: int) -> Record:
    values = np.zeros(n)
    for i in range(n):
        values[i] = i
    return values


@heap_kernel
def _rest(values: Record) -> Record:
    return values[1:]


@kernel
def _least(values: Record) -> float:
    least = np.inf
    for i in range(len(values)):
        least = values[i] if values[i] < least else least
    return least


@heap_kernel
def makes_many(rounds: int) -> float:
    total, kept = 0.0, _made(2)
    for k in range(rounds):
        values = _made(k + 2)
        if k % 3 == 0:
            kept = _rest(values)
        values = _rest(_rest(values)) if k > 3 else values
        total += _least(values[: k + 1]) + _least(kept) if len(values) else 0.0
    return total


def test_every_array_that_kernels_make_is_given_back() -> None:
    from numba.core.runtime import _nrt_python, rtsys

    expected = makes_many.py_func(20)  # type: ignore[attr-defined]
    assert makes_many(20) == expected
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        assert makes_many(20) == expected
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    assert after.alloc - before.alloc >= 21, "this kernel makes none"
    assert after.free - before.free == after.alloc - before.alloc
