"""Reference implementations and metamorphic relations: sound components keep them, planted faults break them."""

import shutil
from pathlib import Path

import pytest

from parcours.study import above, below
from parcours.study.components.references import difference
from parcours.study.finding import find
from parcours.study.parameters import Scalar

LIFT = Path(__file__).parents[2] / "examples" / "lift"

TWINS = """
def door(order):
    return {"shut": True} if order["hold"] > 99 else None

def arrived(message):
    return {} if "shut" in message else {"floor": message["floor"]}

def shifted(channel, message):
    return {"floor": (message["floor"] + 1) % 9} if "floor" in message else message

def same(channel, message):
    return message if channel == "close" else None

class Counting:  # one for each instance
    def __init__(self, case):
        self.asked, self.case = 0, case

    def __call__(self, order):
        self.asked += 1
        assert self.case.number >= 0
        return {"shut": None, "order": self.asked} if self.asked > 1 else {"shut": None}

def broken(channel, message):
    raise ValueError("no idea")
"""


def verdicts(folder: Path) -> set[tuple[str, str]]:
    """Return verdict and reason of the first four cases of a study."""
    study = find(str(folder))
    settings: dict[str, Scalar] = {"host": "simulated", "graph": "", "record": "", "repeats": 60}
    judged = [study.judge(case, settings) for case in study.suite(settings, 0, 4)]
    return {(str(one.verdict), one.why) for one in judged}


@pytest.fixture
def lift(tmp_path: Path) -> Path:
    """Return a copy of the lift with references and relations beside it."""
    folder = tmp_path / "lift"
    shutil.copytree(LIFT, folder)
    (folder / "twins.py").write_text(TWINS)
    return folder


def test_sound_components_agree_with_their_reference(lift: Path) -> None:
    add(lift, "references: {door: twins.py:door, arrived: {function: twins.py:arrived, tolerance: 0.5}}")
    assert {verdict for verdict, _ in verdicts(lift)} == {"pass"}


def test_a_class_is_made_for_each_instance_and_remembers(lift: Path) -> None:
    add(lift, "references: {door: twins.py:Counting}")
    found = {why for _, why in verdicts(lift)}
    assert any("by twins.py:Counting, .order is missing" in why for why in found)  # where a door is asked twice
    assert any("all" in why or "is what" in why for why in found)


def test_an_answer_that_the_reference_does_not_give_is_found(lift: Path) -> None:
    add(lift, "references: {arrived: twins.py:arrived}")
    source = lift / "lift.py"
    source.write_text(source.read_text().replace('"c4", arrived={"floor": self.floor}', '"c4", arrived={"floor": 8}'))
    model = lift / "model.yaml"
    model.write_text(model.read_text().replace("message: arrived(floor)", "message: arrived"))
    found = {why for verdict, why in verdicts(lift) if verdict == "fail"}
    assert any("by twins.py:arrived, .floor is 8, but must be" in why for why in found)


@pytest.mark.parametrize(
    ("expect", "verdict", "said"),
    [
        ("same", "pass", "all"),
        ("broken", "error", "relation moved raised ValueError: no idea"),
    ],
)
def test_a_relation_is_judged_between_two_runs(lift: Path, expect: str, verdict: str, said: str) -> None:
    add(lift, f"relations: {{moved: {{change: twins.py:same, expect: twins.py:{expect}}}}}")
    # `same` changes nothing of what a panel is called with, and leaves the rest open.
    (lift / "twins.py").write_text(TWINS.replace('return message if channel == "close" else None', "return message"))
    assert {one for one, _ in verdicts(lift)} == {verdict}
    assert any(said in why for _, why in verdicts(lift))


def test_a_relation_that_does_not_hold_names_the_message(lift: Path) -> None:
    add(lift, "relations: {moved: {change: twins.py:same, expect: twins.py:shifted}}")
    (lift / "twins.py").write_text(TWINS.replace('return message if channel == "close" else None', "return message"))
    assert any("relation moved" in why and ".floor is" in why for verdict, why in verdicts(lift) if verdict == "fail")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("references: {call: twins.py:door}", "no component sends on"),
        ("references: {door: twins.py:nothing}", "nothing"),
        ("relations: {moved: {change: twins.py:same}}", "expect"),
    ],
)
def test_what_is_wrong_in_the_file_is_said(lift: Path, text: str, said: str) -> None:
    add(lift, text)
    with pytest.raises(Exception, match=said):
        find(str(lift))


def test_a_difference_is_named_by_its_place() -> None:
    assert difference({"a": [1, {"b": True}]}, {"a": [1, {"b": False}]}, 0.0) == ".a[1].b is True, but must be False"
    assert difference({"a": 1.0, "more": 2}, {"a": 1.0 + 1e-12}, 1e-9) == ""
    assert difference([1], [1, 2], 0.0) == "it has 1 items, but must have 2"
    assert difference({}, {"a": 1}, 0.0) == ".a is missing"
    assert difference({"a": 1, "b": [2]}, {"a": None, "b": [None]}, 0.0) == ""


def test_a_number_of_which_only_the_way_is_known_must_move_that_way() -> None:
    wanted = {"duration": above(2.0), "speeds": [below(0.5), None]}

    def found(duration: object, speed: float) -> str:
        return difference({"duration": duration, "speeds": [speed, 9.0]}, wanted, 0.0)

    assert found(2.1, 0.4) == ""
    assert found(2.0, 0.4) == ".duration is 2.0, but must be more than 2.0"
    assert found(3, 0.5) == ".speeds[0] is 0.5, but must be less than 0.5"
    assert found("long", 0.4) == ".duration is 'long', but must be more than 2.0"


def test_a_relation_may_say_the_way_only(lift: Path) -> None:
    add(lift, "relations: {moved: {change: twins.py:same, expect: twins.py:higher}}")
    same = TWINS.replace('return message if channel == "close" else None', "return message")
    higher = """
def higher(channel, message):
    from parcours.study import above
    return {"floor": above(message["floor"])} if "floor" in message else None
"""
    (lift / "twins.py").write_text(same + higher)
    found = [why for verdict, why in verdicts(lift) if verdict == "fail"]
    assert any(".floor is" in why and "must be more than" in why for why in found)


def add(folder: Path, text: str) -> None:
    """Add a line to the study's file."""
    path = folder / "study.yaml"
    path.write_text(path.read_text() + text + "\n")
