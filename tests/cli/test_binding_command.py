"""`parcours binding check` without ROS."""

from __future__ import annotations

from pathlib import Path

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
