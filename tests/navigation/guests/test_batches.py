"""A planner that is asked for many cases at once: the same bits, and each fault costs its own case only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.run.campaign import run_campaign
from parcours.run.store import open_results
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.planner_tasks import planner_seed
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import HEADING, Observation, Observations, Task, X, Y
from parcours_navigation.requirements.requirement import requirements_of
from parcours_navigation.study.study import NavigationStudy, study_of

CASES = SystemCases(1)
SHORT = Scenario(time_limit=4.0, call_timeout=0.5)


class Steers:
    """Drives at the goal, slowly where something is near; each row by itself, and so with the same bits as `Alone`."""

    batch_size = 7

    def observe_batch(self, seen: Observations) -> object:
        goals = np.array([task.goal for task in seen.tasks])[seen.cases]
        errors = np.arctan2(goals[:, 1] - seen.robots[:, Y], goals[:, 0] - seen.robots[:, X]) - seen.robots[:, HEADING]
        near = np.abs(seen.obstacles[:, :, X] - seen.robots[:, X, np.newaxis]).min(axis=1) < 0.4
        seen.robots[:] = seen.obstacles[:] = np.nan  # its own
        return np.stack([np.where(near, 0.1, 0.25), 2.0 * errors], axis=1)


class Alone:
    def observe(self, seen: Observation) -> object:
        one = Observations(
            seen.time, seen.robot[None].copy(), seen.obstacles[None].copy(), np.zeros(1, int), (seen.task,)
        )
        return tuple(np.asarray(Steers().observe_batch(one))[0].tolist())


def test_cases_in_lockstep_have_the_facts_that_they_have_alone() -> None:
    requirements = requirements_of({"slow": "always speed < 0.2"})
    scenario = Scenario(time_limit=20.0, watched_on=8.0)
    batched, alone = (
        NavigationStudy(one, CASES, scenario, requirements=requirements)(0, 17) for one in (Steers, Alone)
    )
    assert batched.tobytes() == alone.tobytes()
    arrived = batched["t_goal"] != NEVER
    assert arrived.any() and (batched["t_goal_after"][~arrived] != NEVER).any()  # some leave their batch before others


PLANNER = """
import os, time
import numpy as np

class Planner:
    batch_size = 8
    deeds = {deeds}

    def reset_batch(self, tasks):
        self.all = len(tasks)

    def observe_batch(self, seen):
        answer = np.stack([0.2 - 0.1 * (seen.obstacles[:, 0, 0] < 1.0), 0.2 * seen.robots[:, 1]], axis=1)
        assert len(seen.tasks) == self.all and len(seen.robots) == len(seen.cases)
        for row, case in enumerate(seen.cases):
            deed = self.deeds.get(seen.tasks[case].seed)
            if deed is None or seen.time < 1.0:
                continue
            if deed == "raises":
                raise ValueError("no way")
            if deed == "misshapen":
                return answer[:, :1]
            if deed == "endless":
                while True:
                    pass
            if deed == "exits":
                os._exit(3)
            if deed == "patches":
                np.zeros = None
            answer[row] = np.nan
        return answer
"""
REASONS = {
    "raises": "raised: ValueError: no way",
    "misshapen": "bad answer: returned an array of shape (1, 1)",
    "endless": "hung: ",
    "exits": "died: its process ended with exit code 3",
    "patches": "changed its process: numpy.zeros was replaced",
    "gives NaN": "bad answer: returned (nan, nan)",
}


MEASURE = "def entries(run):\n    return len(run.track)\n"


def planner(folder: Path, deeds: dict[int, str]) -> str:
    file = folder / "batched.py"
    file.write_text(PLANNER.format(deeds=deeds))
    return f"{file}:Planner"


def test_what_a_planner_does_wrong_in_a_batch_costs_its_own_case(tmp_path: Path) -> None:
    n = 24
    guilty = {3 * k + 1: deed for k, deed in enumerate(REASONS)}  # up to two in each batch; the last one has none
    (tmp_path / "mine.py").write_text(MEASURE)
    own = requirements_of({}, measures={"entries": f"{tmp_path}/mine.py:entries"})
    runs = []
    for k, deeds in enumerate(({planner_seed(1, number): deed for number, deed in guilty.items()}, {})):
        (folder := tmp_path / str(k)).mkdir()
        study = study_of(planner(folder, deeds), CASES, SHORT, own)
        campaign = study.campaign(n, 12)
        run_campaign(study, campaign, folder / "results", workers=2)
        results = open_results(folder / "results")
        if not deeds:  # a shard that is missing is computed again, here by one worker
            before = results.load().tobytes()
            for file in (folder / "results").glob("shard-000000.*"):
                file.unlink()
            run_campaign(study, campaign, folder / "results", workers=1)
            assert open_results(folder / "results").load().tobytes() == before
        runs.append(open_results(folder / "results").load())
    facts, tame = runs
    innocent = ~np.isin(facts["number"], list(guilty))
    assert facts[innocent].tobytes() == tame[innocent].tobytes() and not tame["error"].any()
    said = {deed: facts[number]["reason"].decode() for number, deed in guilty.items()}
    assert {deed: reason for deed, reason in said.items() if not reason.startswith(REASONS[deed])} == {}
    assert (facts["own"]["entries"][innocent] > 50).all() and study.campaign(4000).shard_size == 64


def test_batches_of_fixed_size_are_filled_up() -> None:
    class Fixed(Steers):
        batch_is_fixed = True
        sizes: set[tuple[int, ...]] = set()  # noqa: RUF012

        def reset_batch(self, tasks: tuple[Task, ...]) -> None:
            self.sizes.add((len(tasks),))

        def observe_batch(self, seen: Observations) -> object:
            self.sizes.add((len(seen.robots), len(seen.obstacles), len(seen.cases), len(seen.tasks)))
            return super().observe_batch(seen)

    assert NavigationStudy(Fixed, CASES)(0, 9).tobytes() == NavigationStudy(Alone, CASES)(0, 9).tobytes()
    assert Fixed.sizes == {(7,), (7, 7, 7, 7)}


@pytest.mark.parametrize(
    ("attributes", "rule"),
    [
        ({"batch_size": 0}, "`batch_size` is a whole number from 1 to 4096, but is 0"),
        ({"observe_batch": lambda self: None}, "must take exactly one argument"),
        ({"needs": ("scan",)}, "a batch has no scan, map or path"),
    ],
)
def test_what_makes_no_batches_is_refused(attributes: dict[str, object], rule: str) -> None:
    with pytest.raises(BadRequest, match=rule) as refused:
        NavigationStudy(type("Wrong", (Steers,), attributes), CASES)(0, 1)
    assert refused.value.slug == "planner-form"
