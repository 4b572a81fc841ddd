from __future__ import annotations

from importlib.resources import files

from parcours.abtc import abstract_cases, notation
from parcours.model import read_model

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))


def test_paths_that_share_a_visit_stand_in_braces() -> None:
    case = next(case for case in abstract_cases(RAMP) if case.interaction.name == "ITP4")
    assert "-||-> {tp41[listening -p41-> " in notation(case)
    assert "listening] || tp42[timing -p47-> timing -p48-> sending -p49-> timing]}" in notation(case)


def test_a_start_vector_is_printed_where_it_says_something() -> None:
    first, second, *_ = abstract_cases(RAMP)
    assert "starting at" not in notation(first)
    assert notation(second).endswith("\nstarting at (0, 0, 1)")


def test_components_that_never_meet_are_parted_by_bars_only() -> None:
    obstacles = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))
    text = notation(next(abstract_cases(obstacles)).combination)
    assert text.count("\n || ") == 2
    assert "->" not in text.replace("-p11->", "").replace("-p12->", "").replace("-p21->", "").replace(
        "-p22->", ""
    ).replace("-p31->", "").replace("-p32->", "")
