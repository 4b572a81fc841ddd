"""`--until` ends a campaign when its rule is met, tells the rate with an interval, and refuses what it cannot ask."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest
from parcours.study.stopping import parse_rule

PARKING = str(Path(__file__).parents[2] / "examples" / "parking")


def run(*words: str) -> str:
    result = CliRunner().invoke(parcours, ["run", *words])
    if isinstance(result.exception, BadRequest):
        raise result.exception
    assert result.exit_code in (0, 1), result.output
    return result.output


def test_a_study_ends_when_its_rate_is_known_and_is_reported_as_finished(tmp_path: Path) -> None:
    out = run(PARKING, "--until", "failed +- 12%", "--max-cases", "640", "--workers", "1", "--out", str(tmp_path))
    noted = json.loads((tmp_path / "stopped.json").read_bytes())
    assert 0 < noted["cases"] < 640 and f"stopped after {noted['cases']} cases" in out and "unfinished" not in out
    assert "failed +- 12%: failed " in out and "failed " in out.partition("of 640")[2]  # the progress line, too


@pytest.mark.parametrize(
    ("words", "slug"),
    [
        (["--until", "stuck"], "until-form"), (["--until", "failed < 150%"], "until-form"),
        (["--until", "failed ± 1% with 3% confidence"], "until-form"), (["--until", "stuck ± 1%"], "until-rate"),
        (["--until", "failed ± 1%", "--case", "1"], "option-study"), (["--max-cases", "9"], "option-study"),
        (["--until", "failed ± 1%", "--cases", "9", "--max-cases", "9"], "option-study"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_refused_before_anything_is_written(
    tmp_path: Path, words: list[str], slug: str
) -> None:
    with pytest.raises(BadRequest, match=rf"\[{slug}\]"):
        run(PARKING, *words, "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out" / "run.json").exists()


def test_studies_of_components_are_not_ended_by_rates(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="option-study"):
        run(str(Path(PARKING).parent / "lift"), "--until", "failed ± 1%", "--out", str(tmp_path))


def test_a_rule_keeps_its_own_confidence_and_per_cent() -> None:
    rule = parse_rule(" violated( keeps-away )>=2e-3 with 99% confidence ")
    assert (rule.measure, rule.relation, rule.limit, rule.confidence) == ("violated(keeps-away)", ">=", 0.002, 0.99)
