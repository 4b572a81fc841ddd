"""Mistakes in a study.yaml: each is found with its file and line, several at once, and no code that it names is run."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults
from parcours.study.finding import find, study_of
from parcours.study.selection import ids_of

LIFT = Path(__file__).parents[2] / "examples" / "lift"
PARTS = "Panel: lift.py:Panel, Cabin: lift.py:Cabin"
TRAP = "import pathlib\npathlib.Path(__file__).with_name('was run').touch()\n"

Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Return what writes a lift whose study.yaml is another, and whose code leaves a trace when it is run."""

    def write(
        more: str = "", system: str = "lift.py", change: tuple[str, str] = ("", ""), text: str | None = None
    ) -> Path:
        folder = tmp_path / "lift"
        shutil.copytree(LIFT, folder, ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "study.yaml").write_text(text or f"parcours: study/1\nname: lift\nsystem: {system}\n{more}")
        source = (folder / "lift.py").read_text().replace(*change)
        (folder / "lift.py").write_text(source.replace("from parcours", f"{TRAP}from parcours", 1))
        return folder

    return write


def complaint(folder: Path) -> str:
    """Return what is said of a study that cannot be read; its folder is left as it was."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(BadRequest) as caught:
        find(str(folder))
    assert sorted(folder.rglob("*")) == before
    return str(caught.value).replace(f"{folder}/", "")


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("model: none.yaml", "model must be a file, but there is no 'none.yaml'; check the path [study-file]"),
        ("data: none.yaml", "data must be a file, but there is no 'none.yaml'; check the path [study-file]"),
        ("kind: componets", "must be known, but is 'componets'; did you mean 'components'?"),
        ("patince: 3 s", "a study has no key 'patince'; did you mean 'patience'?"),
        ("patience: fast", "patience must be a time above 0, such as 0.5 s"),
        ("time_budget: 0 s", "time_budget must be a time above 0"),
        ("cases: 0", "cases must be an integer from 1"),
        ("combine: all", "combine must be a known name, but is 'all'; Known: each_choice"),
        ("paths: every", "paths: must be a known name, but 'every' was given; Known: node, edge"),
        ("serialisation: hup", "serialisation must be a known name, but is 'hup'; did you mean 'hub'?"),
        ('limits: {ITP9: "p95 < 1 s"}', "limits: there is no interaction path 'ITP9'"),
        ('limits: {ITP1: "soon"}', "limit ITP1: it reads STATISTIC < LIMIT UNIT"),
        ('limits: {door: {from: c1, to: c9, bound: "p95 < 1 s"}}', "to of limit door must be a transition"),
        ('limits: {door: {from: c1, bound: "p95 < 1 s"}}', "limit door must have the key 'to', but has not"),
        ("oracles: {ITP7: lift.py:holds}", "oracles: there is no interaction path 'ITP7'"),
        ("oracles: {ITP1: lift.py:holds}", "oracle of ITP1: 'holds' must be defined in lift.py, but is not"),
        ("oracles: [other.py:holds]", "an oracle: there is no file 'other.py'"),
        ("oracles: [lift.py]", "an oracle must be file.py:Name or package.module:Name"),
        ("supply: {cal: {floor: 1}}", "supply: there is no channel from the environment 'cal'"),
        ("supply: {call: {flor: 1}}", "supply of call: it has no 'flor'; did you mean 'floor'?"),
        ("supply: {call: {floor: flor + 1}}", "a formula reads test inputs and parameters, but there is no 'flor'"),
        ('supply: {call: {floor: "1 +"}}', 'must stand at the caret, but found the end in "1 +^" [syntax]'),
        ('supply: {call: {floor: "true"}}', "supply of call, floor"),
        ("inputs: {d1: {blokced: true}}", "inputs of d1: it has no 'blokced'; did you mean 'blocked'?"),
        ("inputs: {d9: {blocked: true}}", "inputs: there is no transition 'd9'"),
        ("parameters: {a: {type: rel, default: 1}}", "type of parameter a must be bool or int or real or text"),
        ("parameters: {a: {default: x}}", "default of parameter a must be a number, but 'x' was given"),
        ("parameters: {a: {default: 3, range: [5, 9]}}", "default of parameter a must be from 5 to 9, but 3 was given"),
        ("parameters: {a: {default: 3, range: [5, 0]}}", "must be [least, greatest], but 5 > 0"),
        ("parameters: {a: {default: 3, range: [5]}}", "range of parameter a must be [least, greatest]"),
        ("parameters: {a: {type: text, default: x, choices: [y]}}", "must be one of its choices, but 'x' was given"),
        ("parameters: {a b: {default: 1}}", "a name among the parameters must be letters, digits and _"),
        ("name: lift2", "a key must be unique, but 'name' stands in line 2 already"),
    ],
)  # fmt: skip
def test_a_mistake_is_said_with_its_line_and_what_to_write(written: Written, more: str, says: str) -> None:
    said = complaint(written(more))
    assert said.startswith("study.yaml:4: ") and says in said and "\n" not in said


@pytest.mark.parametrize("name", ["host", "repeats", "seed", "out", "cases", "case", "as_json", "study"])
def test_a_parameter_must_not_have_the_name_of_an_option_that_is_there(written: Written, name: str) -> None:
    said = complaint(written(f"parameters: {{{name}: {{default: 1}}}}"))
    assert said.startswith("study.yaml:4: ") and name in said


def test_a_limit_between_transitions_that_no_case_takes_in_turn_is_not_passed_over(written: Written) -> None:
    said = complaint(written('limits: {door: {from: d3, to: p1, bound: "p95 < 1 s"}}'))
    assert said.startswith("study.yaml:4: ") and "limit door" in said


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("def door(", "def dor("), "system, Cabin: class Cabin (lift.py:16) lacks the method door; write: def door"),
        (("class Door", "class Dor"), "system, Door: 'Door' must be defined in lift.py, but is not"),
        (("class Door:", "class Door"), "system, Door: lift.py must be Python, but: lift.py:33: expected ':'"),
    ],
)  # fmt: skip
def test_code_that_lacks_what_the_model_needs_is_found_without_running_it(
    written: Written, change: tuple[str, str], says: str
) -> None:
    assert says in complaint(written(change=change))


@pytest.mark.parametrize(
    "change",
    [
        ("class Cabin:", "class Base:\n    def door(self): pass\n\nclass Cabin(Base):"),
        ("class Cabin:", "from elsewhere import Base\n\nclass Cabin(Base):"),
        ("class Cabin:", "class Cabin:\n    def run(self, port): pass\n"),
        ("class Cabin:", "class Cabin:\n    def __getattr__(self, name): pass\n"),
        ("class Cabin:", "class Cabin:\n    door = lambda self, message: None\n"),
        ("class Cabin:", "if True:\n  def Cabin(case): pass\nclass Other:"),
    ],
)
def test_what_may_have_its_methods_from_elsewhere_is_believed(written: Written, change: tuple[str, str]) -> None:
    folder = written(change=change)
    text = (folder / "lift.py").read_text()
    (folder / "lift.py").write_text(text.replace("    def door(self, message):", "    def other(self, message):"))
    assert find(str(folder)).name == "lift"
    assert not (folder / "was run").exists()


@pytest.mark.parametrize(
    ("system", "says"),
    [
        ("nothing.py", "system, Door: there is no file 'nothing.py'"),
        ("[lift.py]", "system must be a mapping, but is a list"),
        (f"{{{PARTS}, Dor: lift.py:Door}}", "system: the model has no component 'Dor'; did you mean 'Door'?"),
        (f"{{{PARTS}}}", "system: nothing stands for the component 'Door'; add Door: file.py:Door"),
        (f"{{{PARTS}, Door: {{close: lift.py:took, clos: lift.py:took}}}}", "'clos' is no channel to it"),
        (f"{{{PARTS}, Door: {{d3: lift.py:took}}}}", "system, Door lacks functions for close; add close: file.py:name"),
        (f"{{{PARTS}, Door: {{command: [./door]}}}}", "system, Door: there is no program './door' in"),
        (f"{{{PARTS}, Door: {{command: [no_such_door]}}}}", "there is no program 'no_such_door' on the path"),
        (f"{{{PARTS}, Door: {{command: [./lift.py]}}}}", "'./lift.py' in"),
        (f"{{{PARTS}, Door: {{command: []}}}}", "command of system, Door must be a list of words, but is empty"),
    ],
)  # fmt: skip
def test_what_stands_for_the_components_must_be_there(written: Written, system: str, says: str) -> None:
    said = complaint(written(system=system))
    assert says in said and "study.yaml:3: " in said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("parcours: study/2\nname: a\n", "study.yaml:1: the format must be study/1, but is 'study/2' [format]"),
        ("name: a\nsystem: lift.py\n", "study.yaml:1: the format must be study/1, but is ''"),
        ("parcours: study/1\nsystem: lift.py\n", "study.yaml:1: a study must have the key 'name', but has not"),
        ("parcours: study/1\nname: a b\nsystem: lift.py\n", "study.yaml:2: a study's name consists of letters"),
        ("- a\n", "study.yaml:1: a study must be a mapping, but is a list"),
        ("# nothing\n", "study.yaml: a study must have content"),
        ("parcours: study/1\nname: 'a\n", "a study must be YAML, but this is not"),
    ],
)
def test_what_is_no_study_is_refused(written: Written, text: str, says: str) -> None:
    assert says in complaint(written(text=text))


def test_all_mistakes_are_said_at_once_in_the_order_of_their_lines(written: Written) -> None:
    more = 'limits: {ITP9: "p95 < 1 s"}\ncases: none\ncombine: all\nsupply: {cal: {floor: 1}}\noracles: lift.py:holds\n'
    said = complaint(written(more, system=f"{{{PARTS}, Door: lift.py:Dor}}")).splitlines()
    assert said[0] == "study.yaml: a study must have no errors, but this one has 6:"
    assert [line.strip().split(": ")[0] for line in said[1:-1]] == [f"study.yaml:{k}" for k in range(3, 9)]
    assert "study-errors" in said[-1]


def test_a_folder_in_the_place_of_the_model_is_said_to_be_one(written: Written) -> None:
    folder = written("")
    (folder / "model.yaml").unlink()
    (folder / "model.yaml").mkdir()
    said = complaint(folder)
    assert "model must be a file, but 'model.yaml' is a folder" in said and "there is no" not in said


def test_mistakes_of_the_files_that_a_study_names_are_said_with_theirs(written: Written) -> None:
    folder = written("combine: all")
    model = folder / "model.yaml"
    model.write_text(model.read_text().replace("event: close(it), guard: blocked", "event: clos(it), guard: blocked"))
    said = complaint(folder)
    line = 1 + model.read_text().split("\n").index(
        next(one for one in model.read_text().split("\n") if "clos(it)" in one)
    )
    assert f"model.yaml:{line}: " in said and "'clos'" in said and "study.yaml:4: error: combine" in said


def test_every_command_refuses_such_a_study_with_code_2(written: Written, tmp_path: Path) -> None:
    folder = written('limits: {ITP9: "p95 < 1 s"}\ncases: none')
    for words in (["run", folder, "--out", tmp_path / "out"], ["suite", folder, "--out", tmp_path / "s"],
                  ["study", "check", folder], ["faults", folder], ["run", folder / "study.yaml"]):  # fmt: skip
        result = CliRunner().invoke(parcours, [str(word) for word in words])
        assert isinstance(result.exception, BadRequest) and "this one has 2" in str(result.exception)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lift"] and not (folder / "was run").exists()


@pytest.mark.parametrize(
    ("given", "slug"),
    [("no_such_study", "unknown-study"), ("ramp_sytem", "unknown-study"), ("no/such/folder", "unreadable-file"),
     ("none.yaml", "unreadable-file"), ("none.py:STUDY", "target-missing"), ("no_such_module:STUDY", "target-raised"),
     ("math:pi", "study-form"), ("math:tau2", "target-missing")],
)  # fmt: skip
def test_a_study_that_is_not_there_is_refused_with_how_to_name_one(given: str, slug: str) -> None:
    with pytest.raises(BadRequest) as caught:
        find(given)
    assert caught.value.slug == slug and given.partition(":")[0] in str(caught.value)


def test_a_python_file_is_no_yaml_and_the_refusal_says_how_to_name_what_it_defines(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def mine(observation):\n    return 0.0, 0.0\n")
    with pytest.raises(
        BadRequest, match=r"a planner: parcours run navigation --planner .*mine.py:NAME \[unknown-study"
    ):
        find(str(file))


def test_a_list_of_cases_that_is_a_folder_is_refused_with_what_to_name(tmp_path: Path) -> None:
    with pytest.raises(
        BadRequest, match=r"but: Is a directory; name a text file with one case id per line \[case-list"
    ):
        ids_of((), tmp_path)


def test_a_folder_of_results_that_is_not_there_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(BadResults, match="there is no such folder"):
        study_of(tmp_path / "none")
    with pytest.raises(BadResults, match="this one does not"):
        study_of(tmp_path)
