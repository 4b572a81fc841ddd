"""What every study on system cases asks its user: parameters and chosen cases, and which of them decide the results."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.errors import BadRequest
from parcours.study.parameters import Parameter, Settings
from parcours.study.protocol import Request
from parcours_navigation.cases.family import PROTOCOLS, SystemCases

CASES = (
    Parameter("protocol", "text", "table-vii", "how obstacles move", choices=tuple(PROTOCOLS)),
    Parameter("robot_radius", "real", 0.125, unit="m", low=0.0, high=0.5),
    Parameter("obstacle_radius", "real", 0.1, unit="m", low=0.0, high=0.5),
)
"""What the cases of any planner depend on."""

TIME_LIMIT_DOC = "of a case, after its static second; under the published protocol with it"


def cases_of(settings: Settings, seed: int, study: str = "navigation") -> SystemCases:
    """Return the family of cases that settings ask for; their ids begin with the study's name."""
    radii = float(settings["robot_radius"]), float(settings["obstacle_radius"])
    return SystemCases(seed, settings["protocol"], *radii, study)  # type: ignore[arg-type]


def numbers_of(cases: SystemCases, chosen: Sequence[str]) -> tuple[int, ...]:
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
