"""Kernels that only kernels call are translated, not optimised; what is on disk is used without a compiler."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

KERNELS = """
import gc, json, pickle, sys
from llvmlite.binding import Linkage
from numba.core.codegen import CPUCodeLibrary
from numba.core.dispatcher import _FunctionCompiler
import numpy as np
from parcours.kernels import heap_kernel, kernel

optimised, translated, shared, collected = [], [], [], []
optimise, translate = CPUCodeLibrary._optimize_final_module, _FunctionCompiler.compile

def noted(self):
    optimised.append(self.name)
    collected.append(gc.isenabled())
    optimise(self)
    functions = [one for one in self._final_module.functions if not one.is_declaration]
    shared.extend(one.name for one in functions if one.linkage == Linkage.linkonce_odr)

def noting(self, arguments, returned):
    translated.append(self.py_func.__name__)
    return translate(self, arguments, returned)

CPUCodeLibrary._optimize_final_module, _FunctionCompiler.compile = noted, noting

@kernel
def innermost(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x * 3.0

@kernel
def inner(x, more=1.0):
    return innermost(x) + more

@kernel
def outer(x):
    return inner(x) * 2.0

@kernel
def other(x):
    return inner(x, 4.0)

@kernel
def times(x, n, is_less):
    return x * n - is_less

@kernel
def thrice(x, n):
    return times(x, 1, True) + times(x, 2, False) + times(x, n, n > 0)

def made(factor):
    @kernel
    def within(x):
        return x * factor

    @kernel
    def around(x):
        return within(x) + 1.0

    return around

@heap_kernel
def doubled(values, out):
    out[:] = np.array([2.0 * one for one in values]) + 0.0 * values
    return out

@kernel
def total(values):
    if values.ndim == 1:
        return values.sum()
    return values[0, 0] + values[0, 1]

TABLE = np.arange(200_000.0)  # more than Numba copies into code on its own

@kernel
def shown(x):
    print(x)
    return x

@kernel
def shows(x):
    return 2.0 * shown(x)

@kernel
def doubles(values, out):
    return doubled(values, out)[0]

@kernel
def looked_up(i):
    return TABLE[i]

def tell(*results):
    names = [name for name in ("innermost", "inner", "outer", "other", "within", "around") if name in optimised]
    loaded = "numba.np.linalg" in sys.modules
    told = {"results": results, "optimised": names, "translated": translated, "shared": shared, "loaded": loaded}
    print(json.dumps(told))
"""


def ran(folder: Path, call: str) -> str:
    """Return what a process of its own prints that has these kernels."""
    if not (folder / "chain.py").exists():
        (folder / "chain.py").write_text(KERNELS)
    done = subprocess.run(
        [sys.executable, "-c", f"from chain import *\n{call}"], cwd=folder, capture_output=True, text=True, check=True,
        env={**os.environ, "PARCOURS_CACHE_DIR": str(folder / "kept")}, timeout=300,
    )  # fmt: skip
    return done.stdout


def told(folder: Path, call: str) -> dict[str, object]:
    """Return what a process of its own says of these kernels, once it has called some."""
    said: dict[str, object] = json.loads(ran(folder, call))
    return said


def test_only_what_python_calls_is_optimised_and_the_rest_is_translated_once(tmp_path: Path) -> None:
    first = told(tmp_path, "tell(outer(2.0))")
    assert first["results"] == [14.0] and first["optimised"] == ["outer"]
    assert sorted(first["translated"]) == ["inner", "innermost", "outer"]  # type: ignore[call-overload]
    assert first["shared"] == [], "machine code that the compiler must keep as others may call it"
    again = told(tmp_path, "tell(outer(2.0))")
    assert again == {"results": [14.0], "optimised": [], "translated": [], "shared": [], "loaded": False}
    assert again["loaded"] != first["loaded"], "what only compiling needs"
    third = told(tmp_path, "tell(other(2.0), inner(2.0, more=5.0))")
    assert third["results"] == [10.0, 11.0] and third["optimised"] == ["inner", "other"]
    assert "innermost" not in third["translated"]  # type: ignore[operator]


def test_compiling_takes_no_new_memory_for_frames_at_every_call_however_deep_its_caller_is(tmp_path: Path) -> None:
    call = """
import resource

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def taken(depth, function):
    if depth:
        return taken(depth - 1, function)
    before = faults()
    function(1.0)
    return faults() - before

made(-1.0)(1.0)
tell(*(taken(depth, made(float(depth))) for depth in range(0, 120, 3)))
"""
    faults: list[int] = told(tmp_path, call)["results"]  # type: ignore[assignment]
    assert sum(faults) < 2 * len(faults) * statistics.quantiles(faults, n=4)[0]


def test_garbage_is_not_collected_while_a_kernel_is_compiled_and_after_that_as_before(tmp_path: Path) -> None:
    call = """
gc.disable()
first, ran = outer(2.0), gc.isenabled()
gc.enable()
tell(first, other(2.0), ran, gc.isenabled(), any(collected), len(collected) > 1)
"""
    assert told(tmp_path, call)["results"] == [14.0, 10.0, False, True, False, True]


def test_constants_of_one_type_share_their_code(tmp_path: Path) -> None:
    said = told(tmp_path, "tell(thrice(2.0, 3))")
    assert said["results"] == [10.0] and sorted(said["translated"]) == ["thrice", "times"]  # type: ignore[call-overload]


def test_an_error_of_an_inner_kernel_and_its_pickles_are_those_of_any_function(tmp_path: Path) -> None:
    call = """
try:
    outer(-1.0)
except ValueError as error:
    tell(str(error), pickle.loads(pickle.dumps(inner)) is inner, inner.__doc__, outer.py_func(1.0))
"""
    for _ in range(2):
        assert told(tmp_path, call)["results"] == ["below zero", True, None, 8.0]


def test_arrays_are_assigned_to_slices_of_their_shape_and_no_words_about_shapes_are_compiled(tmp_path: Path) -> None:
    call = """
try:
    doubled(np.ones(3), np.ones(2))
except ValueError as error:
    tell(doubled(np.arange(3.0), np.ones(3)).tolist(), str(error))
"""
    for is_compiled in (True, False):
        said = told(tmp_path, call)
        assert said["results"] == [[0.0, 2.0, 4.0], "cannot assign an array to a slice of a different shape"]
        assert ("doubled" in said["translated"]) == is_compiled  # type: ignore[operator]
        assert "join_list" not in said["translated"]  # type: ignore[operator] # of Numba's own message


def test_a_kernel_may_branch_on_the_number_of_axes(tmp_path: Path) -> None:
    assert told(tmp_path, "tell(total(np.ones(3)), total(np.ones((1, 2))))")["results"] == [3.0, 2.0]


def test_kernels_that_a_function_makes_are_kept_by_what_they_close_over(tmp_path: Path) -> None:
    assert told(tmp_path, "tell(made(2.0)(3.0), made(5.0)(3.0))")["results"] == [7.0, 16.0]
    again = told(tmp_path, "tell(made(2.0)(3.0), made(5.0)(3.0), made(7.0)(3.0))")
    assert again["results"] == [7.0, 16.0, 22.0]


def test_a_large_constant_is_kept_with_the_code_not_its_address_in_this_process(tmp_path: Path) -> None:
    for is_compiled in (True, False):
        said = told(tmp_path, "tell(looked_up(199_999))")
        assert said["results"] == [199_999.0]
        assert ("looked_up" in said["translated"]) == is_compiled  # type: ignore[operator]


def test_compiling_adds_nothing_to_our_classes_for_which_a_planner_would_be_blamed(tmp_path: Path) -> None:
    call = """
from parcours import kernel_compiler, kernel_lowering
here = [*vars(kernel_compiler).values(), *vars(kernel_lowering).values()]
ours = [one for one in here if isinstance(one, type) and one.__module__.startswith("parcours")]
before = [set(vars(one)) for one in ours]
outer(2.0), doubled(np.ones(2), np.ones(2))
tell(len(ours), [sorted(set(vars(one)) - names) for one, names in zip(ours, before)])
"""
    n, added = told(tmp_path, call)["results"]  # type: ignore[misc]
    assert n > 5 and added == [[]] * n  # type: ignore[has-type]


def test_an_inner_kernel_may_print_which_needs_the_environment_that_is_kept_with_it(tmp_path: Path) -> None:
    for _ in range(2):
        assert ran(tmp_path, "print(shows(3.0))") == "3.0\n6.0\n"


def test_code_that_makes_no_arrays_is_loaded_without_what_arrays_need(tmp_path: Path) -> None:
    call = """
def needs():
    from numba.core.runtime import rtsys
    return ["numba.np.arrayobj" in sys.modules, rtsys._init]

tell(total(np.ones(3)), needs(), doubles(np.ones(2), np.ones(2)), doubled(np.ones(2), np.ones(2)).tolist(), needs()[1])
"""
    told(tmp_path, call)
    assert told(tmp_path, call)["results"] == [3.0, [False, False], 2.0, [2.0, 2.0], True]
