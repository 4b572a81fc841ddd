"""The paper's Tables I to VI and its counts, each from the model files; what is reconstructed says so."""

from __future__ import annotations

from importlib.resources import files

import pytest

from parcours.abtc import (
    abstract_cases,
    case_counts,
    combinations,
    component_graph,
    interaction_paths,
    notation,
    rendezvous_pairs,
)
from parcours.abtc.interactions import hub
from parcours.abtc.serialising import POLICIES, Policy
from parcours.model import read_model
from parcours.paths import internal_paths

RAMP = read_model(str(files("parcours_ramp") / "components" / "model.yaml"))
OBSTACLES = read_model(str(files("parcours_navigation") / "cases" / "model.yaml"))


def test_table_1_links_the_components_by_nine_channels() -> None:
    spokes = ["TrajectoryGenerator", "TrajectoryEvaluation", "PathModification", "Control"]
    edges = {("Sensing", "Planner")}
    edges |= {pair for other in spokes for pair in [("Planner", other), (other, "Planner")]}
    assert set(component_graph(RAMP)) == edges
    assert hub(RAMP) == "Planner"


def test_table_2_has_37_predicates() -> None:
    counts = {c.name: len(list(c.transitions())) for c in RAMP.components}
    assert list(counts.values()) == [9, 5, 5, 9, 5, 4]
    assert sum(counts.values()) == 37


def test_table_3_is_what_edge_coverage_yields() -> None:
    found = {p.name: (p.component, p.states[0], p.ids) for paths in internal_paths(RAMP).values() for p in paths}
    assert found == {
        "tp11": ("Planner", "planning", ("p11", "p12", "p13")),
        "tp12": ("Planner", "listening", ("p14", "p15", "p16", "p17", "p18", "p19")),
        "tp21": ("TrajectoryGenerator", "listening", ("p21", "p22", "p23", "p24", "p25")),
        "tp31": ("TrajectoryEvaluation", "listening", ("p31", "p32", "p33", "p34", "p35")),
        "tp41": ("Control", "listening", ("p41", "p42", "p43", "p44", "p45", "p46")),
        "tp42": ("Control", "timing", ("p47", "p48", "p49")),
        "tp51": ("PathModification", "listening", ("p51", "p52", "p53", "p54", "p55")),
        "tp61": ("Sensing", "listening", ("p61", "p62", "p63", "p64")),
    }


def test_table_3_names_the_states_along_the_paths() -> None:
    states = {path.name: " ".join(path.states) for paths in internal_paths(RAMP).values() for path in paths}
    assert states == {
        "tp11": "planning planning control planning",
        "tp12": "listening listening generating generating evaluating evaluating listening",
        "tp21": "listening listening generating generating sending listening",
        "tp31": "listening listening evaluating evaluating sending listening",
        "tp41": "listening listening executing listening moving executing listening",
        "tp42": "timing timing sending timing",
        "tp51": "listening listening modifying modifying sending listening",
        "tp61": "listening listening sending sending listening",
    }


def test_table_4_lists_four_round_trips_and_two_specified_paths() -> None:
    planner, generator, evaluation = "Planner", "TrajectoryGenerator", "TrajectoryEvaluation"
    modification, control = "PathModification", "Control"
    assert {path.name: (path.criterion, path.components) for path in interaction_paths(RAMP)} == {
        "ITP1": ("EPC", (planner, generator, planner)),
        "ITP2": ("EPC", (planner, evaluation, planner)),
        "ITP3": ("EPC", (planner, modification, planner)),
        "ITP4": ("EPC", (planner, control, planner)),
        "ITP5": ("SPC", ("Sensing", planner, generator, planner, evaluation, planner, control)),
        "ITP6": ("SPC", (control, planner, modification, planner, control)),
    }


def test_table_4_holds_9_of_the_24_edge_pairs_of_the_graph() -> None:
    """Derived, not in the paper: full edge-pair coverage in Ammann and Offutt's sense would ask for 24."""
    edges = list(component_graph(RAMP))
    pairs = [(a, b, d) for a, b in edges for c, d in edges if b == c]
    assert len(pairs) == 24
    assert sum(middle == "Planner" for _, middle, _ in pairs) == 20
    walks = [path.components for path in interaction_paths(RAMP)]
    toured = {walk[n : n + 3] for walk in walks for n in range(len(walk) - 2)}
    assert len(toured & set(pairs)) == 9


def test_table_5_prints_abtc_1_like_the_paper() -> None:
    assert notation(next(abstract_cases(RAMP)), "ABTC1").splitlines() == [
        "Combination ITP1 (tp12, tp21, tp12) = ABTC1:",
        "(tp12[listening -p14-> listening -p15-> generating -p16-> generating"
        " -p17-> evaluating -p18-> evaluating -p19-> listening]",
        " -||-> tp21[listening -p21-> listening -p22-> generating -p23-> generating -p24-> sending -p25-> listening]",
        " -||-> tp12[listening -p14-> listening -p15-> generating -p16-> generating"
        " -p17-> evaluating -p18-> evaluating -p19-> listening])",
    ]


def test_table_6_gives_each_obstacle_one_path() -> None:
    found = {path.name: (path.states, path.ids) for paths in internal_paths(OBSTACLES).values() for path in paths}
    assert found == {
        f"tp{n}1": (("stopped", "moving", "stopped"), (f"p{n}1", f"p{n}2")) for n in (1, 2, 3)
    }  # fmt: skip


def test_section_4b_drops_the_infeasible_combination_of_itp1() -> None:
    first = interaction_paths(RAMP)[0]
    result = combinations(RAMP, first)
    assert [str(kept) for kept in result.kept] == ["(tp12, tp21, tp12)"]
    (dropped,) = result.dropped
    assert str(dropped).startswith(
        "ITP1 (tp11, tp21, tp11): Planner -> TrajectoryGenerator: "
        "tp11 and tp21 have no rendezvous on trajectory_request (tp12 and tp21 have)"
    )


def test_combinations_of_one_path_a_component_number_2_2_2_4_4_4() -> None:
    """Derived: 1, 1, 1, 0, 0, 0 of them are kept; from ITP4 on some visits need both paths of a component."""
    singles, kept = [], []
    for interaction in interaction_paths(RAMP):
        result = combinations(RAMP, interaction)
        alone = [c for c in result.kept if all(len(visit) == 1 for visit in c.visits)]
        singles.append(len(alone) + len(result.dropped))
        kept.append([str(combination) for combination in result.kept])
    assert singles == [2, 2, 2, 4, 4, 4]
    assert kept == [
        ["(tp12, tp21, tp12)"],
        ["(tp12, tp31, tp12)"],
        ["(tp11, tp51, tp11)"],
        ["(tp11, tp41+tp42, tp11)"],
        ["(tp61, tp11+tp12, tp21, tp11+tp12, tp31, tp11+tp12, tp41)"],
        ["(tp41+tp42, tp11, tp51, tp11, tp41+tp42)"],
    ]


def test_rendezvous_pairs_are_those_of_tables_1_and_2() -> None:
    assert {(pair.send, pair.receive) for pair in rendezvous_pairs(RAMP)} == {
        ("p63", "p15"), ("p15", "p22"), ("p16", "p22"), ("p24", "p16"), ("p17", "p32"), ("p18", "p32"),
        ("p34", "p18"), ("p11", "p52"), ("p12", "p42"), ("p54", None), ("p48", None),
    }  # fmt: skip


def test_section_4c_counts_19_for_epc_and_67_in_all() -> None:
    """19 and 67 are the paper's; the split by interaction, and 48 (printed: 49), are reconstructed."""
    counts = case_counts(RAMP)
    assert counts == {"ITP1": 3, "ITP2": 3, "ITP3": 3, "ITP4": 10, "ITP5": 18, "ITP6": 30}
    assert sum(counts[name] for name in ("ITP1", "ITP2", "ITP3", "ITP4")) == 19
    assert sum(counts[name] for name in ("ITP5", "ITP6")) == 48
    assert len({case.id for case in abstract_cases(RAMP)}) == 67


def test_one_of_eight_policies_of_the_same_kind_gives_67_and_19(monkeypatch: pytest.MonkeyPatch) -> None:
    """The table of docs/test-generation.md: four rules for points, with and without a hub that waits at its request."""
    counted = {}
    for rule in ("all-states", "before-return", "distinct-states", "every-transition"):
        for at_request in (True, False):
            tried = Policy("", POLICIES[rule].marks, hub_at_request=at_request)
            monkeypatch.setitem(POLICIES, "tried", tried)
            counts = case_counts(RAMP, "tried")
            epc = sum(counts[f"ITP{i}"] for i in range(1, 5))
            vectors = sum(case_counts(OBSTACLES, "tried").values())
            counted[rule, at_request] = sum(counts.values()), epc, vectors
    assert counted == {
        ("all-states", True): (150, 30, 9), ("all-states", False): (83690, 98, 9),
        ("before-return", True): (67, 19, 4), ("before-return", False): (4052, 44, 4),
        ("distinct-states", True): (51, 15, 4), ("distinct-states", False): (3996, 36, 4),
        ("every-transition", True): (394, 46, 9), ("every-transition", False): (3954268, 220, 9),
    }  # fmt: skip


def test_section_5c_has_9_types_of_concurrency_among_three_obstacles() -> None:
    """9 is the paper's; the vectors are those of the authors' published enumeration of start offsets."""
    assert [case.start_vector for case in abstract_cases(OBSTACLES)] == [
        (0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 1), (0, 1, 2), (0, 1, 3), (0, 2, 2), (0, 2, 3), (0, 2, 4),
    ]  # fmt: skip
