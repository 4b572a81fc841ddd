"""`parcours binding check` without ROS, and what `run` refuses before anything is started."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.errors import BadRequest
from parcours_navigation.cli.binding import command

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros1_python" / "binding.yaml"


def test_a_sound_binding_is_called_fine() -> None:
    result = CliRunner().invoke(command, ["check", str(EXAMPLE)])
    assert result.exit_code == 0
    assert "3 nodes, 9 channels of 'small_navigation': fine" in result.output


def test_a_wrong_one_is_refused_with_its_line(tmp_path: Path) -> None:
    wrong = tmp_path / "binding.yaml"
    wrong.write_text(EXAMPLE.read_text().replace("model: model.yaml", f"model: {EXAMPLE.parent / 'model.yaml'}")
                     .replace("  goal:\n    topic", "  gaol:\n    topic"))  # fmt: skip
    result = CliRunner().invoke(command, ["check", str(wrong)])
    assert isinstance(result.exception, BadRequest)
    assert "did you mean 'goal'?" in str(result.exception)


@pytest.mark.parametrize("arguments", [["run", str(EXAMPLE)], ["run", str(EXAMPLE), "--out", "x", "--record", "wav"]])
def test_a_run_says_what_it_lacks(arguments: list[str]) -> None:
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 2
