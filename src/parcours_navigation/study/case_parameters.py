"""What every study on system cases asks its user: parameters and chosen cases, and which of them decide the results."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.errors import BadRequest
from parcours.study.covering import closing
from parcours.study.parameters import Parameter, Settings
from parcours.study.protocol import Request
from parcours.study.stopping import Rates
from parcours_navigation.cases.family import PROTOCOLS, PUBLISHED_CASES, SystemCases
from parcours_navigation.cases.running import Family
from parcours_navigation.facts import UNITS
from parcours_navigation.guests.staging import Cases
from parcours_navigation.measures.table import METRICS
from parcours_navigation.requirements.judging import judged_fields, rates
from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import find_world
from parcours_navigation.worlds.paper import paper_cases

CASES = (
    Parameter("protocol", "text", "table-vii", "how obstacles move", choices=tuple(PROTOCOLS)),
    Parameter("robot_radius", "real", 0.125, unit="m", low=0.0, high=0.5),
    Parameter("obstacle_radius", "real", 0.1, unit="m", low=0.0, high=0.5),
)
"""What the cases of any planner depend on."""

WORLDS = (
    Parameter("world", "text", "", "a shipped world (parcours world list) or a .yaml file; nothing: the paper's arena"),
    Parameter("combine", "text", "each_choice", "how the blocks of the world's data are combined"),
)
"""What the cases of planners in worlds of their own depend on."""
REQUIREMENTS = (
    Parameter("require", "text", "", "what must hold of every case: 'keeps-away: always clearance > 0.05; ...'"),
    Parameter("fail", "text", "", "a case fails if this holds: 'clearance < 0.05 or time > 30; ...'"),
)
"""What is required of the cases beside the sound outcome (docs/requirements.md)."""

MEASURES = (
    Parameter("measure", "text", "", "measures of your own: 'hesitation: time_at_rest / time; crowd: mine.py:crowd'"),
)
"""Measures of the user's own (docs/requirements.md#measures-of-your-own)."""

KEPT_UNITS = UNITS | {f"measures.{one.name}": one.unit for one in METRICS}
"""The units of what is kept of a case, as columns of shards are called."""

TIME_LIMIT_DOC = "of a case, after its static second; under the published protocol with it"


def cases_of(settings: Settings, seed: int, study: str = "navigation") -> SystemCases:
    """Return the family of cases that settings ask for; their ids begin with the study's name."""
    radii = float(settings["robot_radius"]), float(settings["obstacle_radius"])
    return SystemCases(seed, settings["protocol"], *radii, study)  # type: ignore[arg-type]


def world_cases(settings: Settings, seed: int, study: str = "navigation") -> Cases:
    """Return the cases of the world that settings name; without one, those of the paper's arena."""
    name = str(settings.get("world", ""))
    if not name:
        _require_unset(settings, WORLDS[1:], "only a world that was named has data to combine", "name one, or leave it")
        return cases_of(settings, seed, study)
    _require_unset(settings, CASES, "a world says how large its robot and how its others are and move",
                   "write it in the world's file, or leave it")  # fmt: skip
    world = find_world(name)
    found = paper_cases(world, seed, study)
    return WorldCases(seed, world, study, str(settings.get("combine", "each_choice"))) if found is None else found


def _require_unset(settings: Settings, parameters: Sequence[Parameter], rule: str, remedy: str) -> None:
    """Raise BadRequest if one of these is set, where it would be without effect."""
    for one in parameters:
        if settings.get(one.name, one.default) != one.default:
            raise BadRequest(one.option, rule, remedy, slug="setting-idle")


def watched(requirements: Requirements) -> Rates:
    """Return what system cases count for the rates that rules may ask for."""
    return Rates(lambda facts: rates(facts, requirements), judged_fields(requirements))


def start_vectors(cases: Family) -> tuple[str, ...]:
    """Return the start vectors that cases have, in words; the only one is empty where nothing orders cases."""
    return tuple(dict.fromkeys(".".join(map(str, cases.vector(number))) for number in range(PUBLISHED_CASES)))


def asked_for(cases: Family, request: Request) -> tuple[int, ...]:
    """Return the numbers of the only cases that a request is for, chosen or to cover pairs of blocks; all if empty."""
    return numbers_of(cases, request.chosen) or closing(
        request, cases.inputs, cases.values,
        lambda numbers: [".".join(map(str, cases.vector(number))) for number in numbers.tolist()], start_vectors(cases),
    )  # fmt: skip


def numbers_of(cases: Family, chosen: Sequence[str]) -> tuple[int, ...]:
    """Return the numbers of chosen cases, in ascending order. Raises BadRequest, naming all that are unknown."""
    found = {given: cases.number(given) for given in chosen}
    wrong = [given for given, number in found.items() if number is None]
    if wrong:
        rule = f"chosen cases must be the study's, but it has no {', '.join(wrong[:5])}"
        remedy = f"an id looks like {cases.id(0)}; its number will do, too"
        raise BadRequest("cases", rule, remedy, slug="case-unknown")
    return tuple(sorted({number for number in found.values() if number is not None}))


def question_of(study: object, request: Request) -> dict[str, object]:
    """Return what decides the results of a campaign, as its folder keeps it."""
    parameters: Sequence[Parameter] = study.parameters  # type: ignore[attr-defined]
    return {
        "seed": request.seed,
        "settings": {one.name: request.settings[one.name] for one in parameters if one.decides},
    }
