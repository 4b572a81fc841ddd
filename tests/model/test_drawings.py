"""Drawings show every state and transition, are well formed, and are the same bytes each time."""

from __future__ import annotations

import re
from importlib.resources import files
from itertools import combinations
from xml.etree import ElementTree

import pytest

from parcours.model import Machine, Transition, predicate, read_model, to_svg, to_text
from parcours.model.drawing import WIDTH

MODEL = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
MACHINES = [(component.name, machine) for component in MODEL.components for machine in component.machines]
SVG = "{http://www.w3.org/2000/svg}"


def test_predicates_print_as_in_table_ii() -> None:
    assert predicate(MODEL.transition("p22")[2]) == "(trajectory_request(traj_request)/[tcp_socket]/-/-)"
    assert predicate(MODEL.transition("p43")[2]) == "(-/[imminent_collision]/pause()/-)"
    assert predicate(MODEL.transition("p13")[2]) == "(-/-/-/-)"


def test_the_tables_hold_every_transition_and_channel_within_the_width() -> None:
    text = to_text(MODEL)
    assert all(re.search(rf"\b{each.id}\b", text) for component in MODEL.components for each in component.transitions())
    assert all(channel.name in text for channel in MODEL.channels)
    assert max(map(len, text.splitlines())) <= WIDTH


@pytest.mark.parametrize(("owner", "machine"), MACHINES, ids=lambda value: getattr(value, "name", value))
def test_a_picture_has_each_state_and_transition_with_one_arrowhead(owner: str, machine: Machine) -> None:
    picture = to_svg(machine, f"{owner} <{machine.name}>")
    root = ElementTree.fromstring(picture)
    words = [text.text for text in root.iter(f"{SVG}text")]
    assert set(machine.states) <= set(words)
    for transition in machine.transitions:
        assert words.count(transition.id) == 2  # on the arrow and in the legend
        assert predicate(transition) in words
    assert len(list(root.iter(f"{SVG}polygon"))) == len(machine.transitions) + 1  # and the initial arrow
    assert picture == to_svg(machine, f"{owner} <{machine.name}>")


def test_labels_and_states_of_a_picture_do_not_cover_each_other() -> None:
    for _, machine in MACHINES:
        root = ElementTree.fromstring(to_svg(machine))
        ellipses = [
            [float(each.get(key, "")) for key in ("cx", "cy", "rx", "ry")] for each in root.iter(f"{SVG}ellipse")
        ]
        boxes = [(x - rx, y - ry, x + rx, y + ry) for x, y, rx, ry in ellipses]
        for each in list(root.iter(f"{SVG}rect"))[1:]:
            x, y, wide, high = (float(each.get(key, "")) for key in ("x", "y", "width", "height"))
            boxes.append((x, y, x + wide, y + high))
        for one, two in combinations(boxes, 2):
            assert one[2] <= two[0] or two[2] <= one[0] or one[3] <= two[1] or two[3] <= one[1]


def test_everything_lies_inside_the_picture() -> None:
    for _, machine in MACHINES:
        root = ElementTree.fromstring(to_svg(machine))
        left, top, wide, high = map(float, root.get("viewBox", "").split())
        for each in [*root.iter(f"{SVG}ellipse"), *root.iter(f"{SVG}text")]:
            x, y = float(each.get("cx") or each.get("x") or 0), float(each.get("cy") or each.get("y") or 0)
            assert left < x < left + wide and top < y < top + high


def test_names_from_a_hostile_model_stay_text() -> None:
    evil = "</text><script>\"'&"
    machine = Machine(evil, evil, (evil,), (Transition(evil, evil, evil),))
    root = ElementTree.fromstring(to_svg(machine))
    assert not list(root.iter(f"{SVG}script")) and evil in "".join(root.itertext())
