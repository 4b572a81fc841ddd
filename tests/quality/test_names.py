"""The names of public classes: each means one thing in the whole code base."""

import ast
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src"
# The same thing twice: a component as a model describes it, and as a host runs it; RAMP's component of that name in the
# paper, and what anybody's planner is asked.
TWO_VIEWS = {"Component", "Planner"}


def defined_twice(folder: Path) -> dict[str, list[str]]:
    """Return the public top-level classes that more than one file defines, with the files."""
    found = defaultdict(list)
    for path in sorted(folder.rglob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(str(path.relative_to(folder)))
    return {name: files for name, files in found.items() if len(files) > 1}


def test_a_class_name_means_one_thing() -> None:
    assert set(defined_twice(SOURCE)) == TWO_VIEWS


def test_a_second_class_of_a_name_is_found(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text("class Route: ...\nclass _Private: ...\n")
    assert defined_twice(tmp_path) == {"Route": ["one.py", "two.py"]}
