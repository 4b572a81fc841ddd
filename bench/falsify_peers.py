"""Falsifiers by others, each in a Python of its own as their requirements conflict with ours: `--peers` starts this.

    python3.11 -m venv verifai && verifai/bin/pip install verifai==2.2.0
    python bench/bench_falsify.py --rungs 1 2 --methods evolution --peers verifai=verifai/bin/python

The same goes for psy-taliro (3.2.0) and stgem (2.0.1). All move in the unit cube, as `parcours falsify` does, and call
the same simulation: a line [method, number of inputs, seed, budget] asks for a search, points go out one per line, and
how far each is from failing [s] comes back, or null when the search is over.
"""

from __future__ import annotations

import contextlib
import json
import math
import random
import sys
from collections.abc import Callable, Iterable

import numpy as np

FARTHEST = 10.0  # [s]: of distances, and of points that constraints refuse
_NEAR = 0.25  # [s]: VerifAI learns from points below it, by default from failures only; best of 0.1, 0.25, 0.5 and 1
_OUT = sys.stdout  # what tools print goes elsewhere


class _Over(Exception):
    """There is a failure, or the budget is spent."""


def _far(point: Iterable[float]) -> float:
    print(json.dumps([float(one) for one in point]), file=_OUT, flush=True)
    far = json.loads(sys.stdin.readline())
    if far is None:
        raise _Over
    return float(far)


def _psy_taliro(optimizer: str, n: int, seed: int, budget: int) -> None:
    import staliro
    from staliro import optimizers

    @staliro.costfunc
    def cost(inputs: staliro.Inputs) -> float:
        return _far(inputs.static[f"x{k}"] for k in range(n))

    bounds = {f"x{k}": (0.0, math.nextafter(1.0, 0.0)) for k in range(n)}
    options = staliro.TestOptions(runs=1, iterations=10 * budget, seed=seed, static_inputs=bounds)
    staliro.test(cost, getattr(optimizers, optimizer)(), options)


def _verifai(kind: str, n: int, seed: int, budget: int) -> None:
    from verifai.features import Box, Feature, FeatureSpace
    from verifai.samplers import feature_sampler

    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002  # it draws from there
    space = FeatureSpace({"point": Feature(Box(*[(0.0, 1.0)] * n))})
    parameters = feature_sampler.default_sampler_params(kind)
    parameters.thres = _NEAR
    samplers = feature_sampler.FeatureSampler
    make = {"ce": samplers.crossEntropySamplerFor, "mab": samplers.multiArmedBanditSamplerFor}[kind]
    sampler, far = make(space, parameters), None
    while True:
        far = _far(sampler.nextSample(far).point)


def _wogan(n: int, seed: int, budget: int) -> None:
    from stgem.features import FeatureVector, Real
    from stgem.limit import ExecutionCount
    from stgem.monitor import Monitor
    from stgem.sut import SystemUnderTest
    from stgem.testsuitegenerator.wogan import WOGAN_TestSuiteGenerator

    class Simulation(SystemUnderTest):
        def new_ifv(self) -> FeatureVector:
            return FeatureVector(features=[Real(f"x{k}", 0.0, 1.0, clip=True) for k in range(n)])

        def execute_test_fv(self, point: FeatureVector) -> tuple[FeatureVector, dict[str, float]]:
            return FeatureVector(features=[Real("far", 0.0, FARTHEST)], values=[_far(point.to_list())]), {}

    class Robustness(Monitor):
        def __call__(self, case: FeatureVector, *_: object) -> float:
            return case.far / FARTHEST  # in [0, 1], as it asks for

    generator = WOGAN_TestSuiteGenerator()
    generator.setup(sut=Simulation(), goal=Robustness(), limit=ExecutionCount(budget), seed=seed)
    generator.initialize()
    while True:
        generator.step()


METHODS: dict[str, Callable[[int, int, int], None]] = {
    "psy-taliro-dual-annealing": lambda *given: _psy_taliro("DualAnnealing", *given),
    "psy-taliro-uniform": lambda *given: _psy_taliro("UniformRandom", *given),
    "verifai-cross-entropy": lambda *given: _verifai("ce", *given),
    "verifai-bandit": lambda *given: _verifai("mab", *given),
    "stgem-wogan": _wogan,
}


def main() -> None:
    sys.stdout = sys.stderr
    for line in iter(sys.stdin.readline, ""):
        method, *given = json.loads(line)
        with contextlib.suppress(_Over):
            METHODS[method](*given)
        print("null", file=_OUT, flush=True)


if __name__ == "__main__":
    main()
