"""The kernel computes the robustness that the definition gives, and that rtamt gives, bit for bit."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import parcours
from parcours_navigation.requirements.kernel import evaluate
from parcours_navigation.requirements.parsing import parse
from parcours_navigation.requirements.programs import OUT, compile_formulas
from parcours_navigation.requirements.requirement import robustness_of
from parcours_navigation.requirements.syntax import Comparison, Formula, walk
from parcours_navigation.requirements.vocabulary import Meaning
from temporal_logic import NAMES, by_rtamt, draw_formula, draw_traces, ours, robustness

PLAIN = {name: Meaning("1", "") for name in NAMES}


def of(text: str) -> Formula:
    return parse(text, names=PLAIN).formula


@pytest.mark.parametrize("seed", range(12))
def test_the_kernel_agrees_with_the_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(25):
        traces = draw_traces(rng, int(rng.integers(1, 30)))
        formula = draw_formula(rng, 3)
        assert ours([formula], traces)[0] == robustness(formula, traces), formula


def test_the_kernel_agrees_with_rtamt() -> None:
    rng = np.random.default_rng(7)
    compared = unbounded = 0
    for _ in range(400):
        traces = draw_traces(rng, int(rng.integers(2, 40)))
        formula = draw_formula(rng)
        found, theirs = ours([formula], traces)[0], by_rtamt(formula, traces)
        assert found == theirs or abs(found - theirs) <= 1e-12, formula
        compared += 1
        unbounded += math.isinf(theirs)
    assert compared == 400 and unbounded < 200


@pytest.mark.parametrize(
    ("first", "last"),
    [(a, b) for a in (0, 1, 5, 40) for b in (0, 1, 2, 7, 31, 32, 33, 99, 100, 101, 250) if a <= b],
)
@pytest.mark.parametrize("n", [1, 2, 33, 100])
def test_windows_of_any_length_take_the_least_of_what_is_there(first: int, last: int, n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    period = 0.05
    text = f"always (a > 0.3 -> eventually[{first * period:g}, {last * period:g}] a < 0)"
    traces = {"a": values.tolist()}
    assert ours([of(text)], traces)[0] == robustness(of(text), traces)


def test_a_finite_trace_ends_as_rtamt_lets_it_end() -> None:
    traces = {"a": [1.0, 2.0, 3.0]}
    found = ours([of(text) for text in (
        "always[0.1, 5] a > 0", "always[1, 2] a > 0", "eventually[1, 2] a > 0", "a > 0 until[1, 2] a > 0",
        "a > 0 until a > 2.5", "a < 2.5 until a > 2.5", "a < 1.5 until a > 2.5",
    )], traces)  # fmt: skip
    assert found.tolist() == [3.0, math.inf, -math.inf, -math.inf, 0.5, 0.5, -0.5]


def test_formulas_share_what_they_have_in_common_and_do_not_disturb_each_other() -> None:
    rng = np.random.default_rng(3)
    traces = draw_traces(rng, 25)
    formulas = [draw_formula(rng, 3) for _ in range(12)]
    together = ours(formulas, traces)
    alone = [ours([one], traces)[0] for one in formulas]
    assert together.tolist() == alone
    twice = compile_formulas([of("always a > 1"), of("always a > 1"), of("b < 0 or always a > 1")], NAMES)
    assert len(twice.code) == 4 and twice.roots[0] == twice.roots[1]


def test_nested_untils_cost_what_they_are_long() -> None:
    text = "a > 0"
    for _ in range(15):
        text = f"({text}) until[0, 1] ({text})" if len(text) < 800 else f"({text}) until[0.1, 1] b > 0"
    assert len(compile_formulas([of(text)], NAMES).code) < 200


def test_a_comparison_without_a_value_anywhere_leaves_its_formula_without_robustness() -> None:
    traces = {"a": [1.0, 0.0, 2.0], "b": [1.0, 0.0, 1.0]}
    found = ours([of("always[0, 0] a / b > 0"), of("always a >= 0"), of("min(a / b, 5) > 0"), of("a / (b - 5) > -9")],
                 traces)  # fmt: skip
    assert [math.isnan(one) for one in found] == [True, False, True, False]


def test_the_sample_that_decides_a_violation_has_its_robustness() -> None:
    rng = np.random.default_rng(5)
    seen = 0
    for _ in range(300):
        traces = draw_traces(rng, int(rng.integers(2, 25)))
        formula = draw_formula(rng, 3)
        (value,), (when,) = robustness_of([formula], traces)
        if not value < 0.0:
            assert math.isnan(when)
            continue
        assert 0 <= when < len(traces["a"])
        if math.isfinite(value):
            at = [abs(robustness(part, traces, int(when))) for part in comparisons(formula)]
            assert -value in at
            seen += 1
    assert seen > 60


def comparisons(formula: Formula) -> list[Formula]:
    return [one for one in walk(formula) if isinstance(one, Comparison)]


def test_the_decisive_sample_is_where_a_reader_looks_for_it() -> None:
    traces = {"a": [1.0, 1.0, -1.0, 1.0, 1.0, 1.0], "b": [0.0, 0.0, 1.0, 1.0, 1.0, 0.0]}
    texts = {"always a > 0": 2, "always[0, 0.1] (b > 0.5 -> eventually[0.05, 0.1] a > 3)": 2, "eventually a > 5": 0,
             "eventually[5, 9] a > 0": 5, "a > 0 until b > 2": 2}  # fmt: skip
    for text, expected in texts.items():
        value, when = robustness_of([of(text)], traces)
        assert value[0] < 0.0 and when[0] == expected, text


def test_numbers_are_computed_as_python_computes_them() -> None:
    traces = {"a": [3.0], "b": [4.0], "c": [-2.0]}
    values = {"hypot(a, b)": 5.0, "sqrt(b)": 2.0, "abs(c)": 2.0, "min(a, c)": -2.0, "max(a, 2 * c)": 3.0, "-c": 2.0,
              "a / b": 0.75, "0.1 + 0.2 - a": 0.1 + 0.2 - 3.0, "sqrt(0.5) * b": math.sqrt(0.5) * 4.0}  # fmt: skip
    for text, expected in values.items():
        assert ours([of(f"{text} > 0")], traces)[0] == expected, text
        assert ours([of(f"{text} < 0")], traces)[0] == -expected, text


SCRIPT = """
import numpy as np
from parcours import kernels
from parcours_navigation.requirements.kernel import judge
from parcours_navigation.requirements.requirement import Monitor, requirements_of
from parcours_navigation.requirements.vocabulary import SIGNALS
from temporal_logic import draw_formula, draw_traces, ours
rng = np.random.default_rng(11)
flags = {"imminent": "eventually imminent"}
every = {name: f"always {name} < 0.5" for name in SIGNALS if name not in flags} | flags
monitor = Monitor(requirements_of(every), 30)
entries = rng.normal(size=(20, 11))
entries[:, 0] = np.arange(20) * 50_000_000
last = entries[-1] + 1e7
program, found = monitor.program, np.zeros((2, len(every)))
judge(entries, last, np.array([0.1, 0.2]), 0.1, 2.0, 2.0, program.code, program.roots, program.wanted, monitor.memory,
      monitor.absent, *found)
print(found.tobytes().hex())
for _ in range(40):
    traces = draw_traces(rng, int(rng.integers(1, 25)))
    print(ours([draw_formula(rng, 3), draw_formula(rng, 3)], traces).tobytes().hex())
"""


def test_without_numba_robustness_has_the_same_bits(tmp_path: Path) -> None:
    (tmp_path / "numba.py").write_text("raise ImportError('not here')\n")
    source = str(Path(parcours.__file__).parent.parent)
    support = str(Path(__file__).parents[2] / "support")
    said = []
    for folder in ([source, support], [str(tmp_path), source, support]):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT], env={**os.environ, "PYTHONPATH": os.pathsep.join(folder)},
            capture_output=True, text=True, check=True, timeout=300,
        )  # fmt: skip
        said.append(done.stdout)
    assert said[0] == said[1] and len(said[0].split()) == 41


def test_a_hundred_thousand_samples_are_judged_in_linear_time() -> None:
    n = 100_000
    program = compile_formulas([of("always (a > -9 -> eventually[0, 1000] a > -9)")], NAMES)
    memory, out = program.memory(n), np.zeros(1)
    memory[0] = np.random.default_rng(0).normal(size=n)
    evaluate(program.code, program.roots, memory, np.zeros(len(memory), np.int64), n, out, np.zeros(1))
    assert out[0] > 0.0  # 2e9 comparisons if every window were looked at


def test_formulas_that_share_memory_are_what_each_is_alone() -> None:
    rng, traces = np.random.default_rng(5), draw_traces(np.random.default_rng(6), 50)
    formulas = [draw_formula(rng, 4) for _ in range(60)]
    formulas += [*formulas[:10], of("always a > 0"), of("not always a > 0"), of("eventually a <= 0")]
    together = robustness_of(formulas, traces)
    for k, each in enumerate(formulas):
        alone = robustness_of([each], traces)
        assert [one[k].tobytes() for one in together] == [one[0].tobytes() for one in alone], each
    program = compile_formulas(formulas, NAMES)
    assert len(np.unique(program.code[:, OUT])) < len(program.code) / 2  # rows are used again
