"""What a report draws of components and channels, against what the traces of the cases hold."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from parcours.report.pieces import Figure
from parcours.study.components.results import StudyResults
from parcours.study.components.running import run_again
from parcours.study.components.study import ComponentStudy
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request

LIFT = str(Path(__file__).parents[2] / "examples/lift")


def test_messages_on_the_picture_are_those_of_the_traces(tmp_path: Path) -> None:
    study = find(LIFT)
    assert isinstance(study, ComponentStudy)
    settings = settings_of(study.parameters, {}, LIFT)
    counted: Counter[str] = Counter()
    cases = list(study.suite(settings, 1))
    for case in cases:
        _, trace = run_again(study, case, settings)
        counted.update(event.channel for event in trace.events if event.kind == "send")

    study.run(Request(settings, 1, tmp_path), lambda *_: None)
    results = study.read(tmp_path)
    assert isinstance(results, StudyResults)
    picture = next(piece for piece in results.machines("here") if isinstance(piece, Figure))
    for channel in study.model.channels:
        rate = f"{counted[channel.name] / len(cases):.3g}"
        assert counted[channel.name] and f">{rate} {channel.name}<" in picture.svg
        assert f"{channel.name} from {channel.sender} to {channel.receiver} {rate}" in picture.alt
