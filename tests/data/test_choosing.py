"""Criteria on models: sizes of the literature, rules kept, must-have rows counted, invalid blocks alone."""

from __future__ import annotations

import itertools
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import Constraint, InputModel, enumeration, parse_input_model, read_input_model, split
from parcours.data.arrays import building
from parcours.data.blocks import Block
from parcours.data.boundaries import at_boundaries
from parcours.data.choosing import LISTED, MODEL_CRITERIA, base_rows, choose, set_size
from parcours.data.domains import Domain
from parcours.data.inputs import constraint_of, rules_of
from parcours.data.rules import Rules, UndecidedError
from parcours.errors import BadDomain, BadRequest
from parcours.model.expression import parse_expression

OBSTACLE = [3, 3, 2, 2, 1, 1]
PRINTER = parse_input_model(
    """
parcours: data/1
name: printer
parameters:
  paper: {kind: enumeration, values: [A4, A3, roll], invalid: [none], base: A3}
  tray: {kind: enumeration, values: [upper, lower], base: [upper, lower]}
  copies: {kind: integer, unit: "1", blocks: ["[1, 9]", "(9, 99]"], invalid: [0]}
  colour: {kind: enumeration, values: ["on", "off"]}
constraints:
  roll: {row: "paper != 'roll' || tray == 'lower'"}
  many: {blocks: "copies == '[1, 9]' || colour == 'off'"}
""",
    "printer.yaml",
)


def model_of(sizes: list[int]) -> InputModel:
    return InputModel("m", tuple(enumeration(f"p{i}", [f"v{b}" for b in range(n)]) for i, n in enumerate(sizes)))


@pytest.mark.parametrize(
    ("sizes", "each", "base", "pairs", "every"),
    [
        (OBSTACLE, 3, 7, (9, 9), 36),
        (OBSTACLE * 3, 3, 19, (9, 15), 46_656),
        ([9, *OBSTACLE * 3], 9, 27, (27, 28), 419_904),
        ([3, 1, 2, 1, 3], 3, 6, (9, 9), 18),
        ([1] * 10, 1, 1, (1, 1), 1),
    ],
    ids=["one obstacle", "three obstacles", "with the start vector", "messages, 5 parameters", "messages, 10"],
)
def test_set_sizes_are_those_of_the_reference(
    sizes: list[int], each: int, base: int, pairs: tuple[int, int], every: int
) -> None:
    model = model_of(sizes)
    assert [set_size(model, name)[0] for name in ("each_choice", "base_choice", "all_combinations")] == [
        each, base, every,
    ]  # fmt: skip
    chosen = choose(model, "pairwise", budget=1.0)
    assert pairs[0] <= chosen.fewest <= len(chosen.rows) <= pairs[1]


def test_the_studies_have_these_sizes_too() -> None:
    sizes = {
        name: read_input_model(str(files(package) / name / "domains.yaml")).sizes
        for package, name in (("parcours_navigation", "cases"), ("parcours_ramp", "components"))
    }
    assert sizes == {"cases": tuple(OBSTACLE * 3), "components": (3, 1, 2, 1, 3)}


@pytest.mark.parametrize("criterion", MODEL_CRITERIA)
def test_every_criterion_keeps_to_the_rules_and_tests_each_invalid_block_alone(criterion: str) -> None:
    chosen = choose(PRINTER, criterion, budget=0.02)
    rules, sizes = rules_of(PRINTER), np.array(PRINTER.sizes)
    assert rules.hold(chosen.rows).all()
    positive, negative = np.split(chosen.rows, [len(chosen.rows) - chosen.n_negative])
    assert (positive < sizes).all()
    assert [np.flatnonzero(row >= sizes).tolist() for row in negative] == [[0], [2]]
    values = chosen.values(seed=3)
    blocks = np.stack([d.blocks_of(values[:, c]) for c, d in enumerate(PRINTER.domains)], axis=1)
    assert (blocks == chosen.rows).all()
    whole = all(set(positive[:, c]) == set(range(size)) for c, size in enumerate(PRINTER.sizes))
    assert whole or criterion == "random"


def test_pairwise_says_which_combinations_the_rules_forbid() -> None:
    chosen = choose(PRINTER, "pairwise", budget=0.02)
    assert set(chosen.infeasible) == {"paper = roll, tray = upper", "copies = (9, 99], colour = on"}
    assert chosen.fewest <= len(chosen.rows) - chosen.n_negative <= 7


def test_all_combinations_are_the_allowed_ones() -> None:
    rows = choose(PRINTER, "all_combinations").rows[:-2].tolist()
    slow = [
        list(row) for row in itertools.product(range(3), range(2), range(2), range(2))
        if not (row[0] == 2 and row[1] == 0) and not (row[2] == 1 and row[3] == 0)
    ]  # fmt: skip
    assert rows == slow


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 4), min_size=1, max_size=5), st.data())
def test_multiple_base_choice_has_as_many_rows_as_ammann_and_offutt_say(sizes: list[int], data: st.DataObject) -> None:
    bases = [data.draw(st.lists(st.integers(0, n - 1), min_size=1, max_size=n, unique=True)) for n in sizes]
    rows, *left = base_rows(sizes, bases, Rules(sizes))
    m = max(map(len, bases))
    starts = {tuple(each[i % len(each)] for each in bases) for i in range(m)}
    assert left == [(), ()] and len(rows) <= m + m * sum(n - len(each) for n, each in zip(sizes, bases, strict=True))
    if len(sizes) > 1 and all(len(each) == m for each in bases):
        assert len(rows) == m + m * sum(n - m for n in sizes)
    assert starts <= {tuple(row) for row in rows.tolist()}
    for column, n in enumerate(sizes):
        assert set(rows[:, column]) == set(range(n))
    for row in rows.tolist():
        assert sum(b not in each for b, each in zip(row, bases, strict=True)) <= 1


def test_base_choice_starts_from_the_bases_and_leaves_them_only_where_rules_demand_it() -> None:
    rows = choose(PRINTER, "base_choice").rows
    assert rows[0].tolist() == [1, 0, 0, 0]
    assert [2, 1, 0, 0] in rows.tolist()  # the roll needs the lower tray
    assert [1, 0, 1, 1] in rows.tolist()  # many copies need colour off


def test_must_have_rows_keep_their_values_and_count() -> None:
    must = np.array([[0.0, 1.0, 5.0, 0.0], [3.0, 0.0, 7.0, 1.0]])  # the second one tests paper = none
    chosen = choose(PRINTER, "pairwise", must=must, budget=0.05)
    assert (chosen.values(seed=1)[:2] == must).all()
    assert chosen.n_negative == 1 and chosen.rows[-1, 2] == 2
    free = choose(PRINTER, "pairwise", budget=0.05)
    assert len(chosen.rows) <= len(free.rows) + 2
    everything = choose(PRINTER, "all_combinations", must=must)
    assert len(everything.rows) == len(choose(PRINTER, "all_combinations").rows)


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ([0.0, 0.0, 500.0, 0.0], "copies = 500 lies in none"),
        ([2.0, 0.0, 1.0, 0.0], "breaks 'roll'"),
        ([0.0, 0.0, 50.0, 0.0], "breaks 'many'"),
    ],
)
def test_must_have_rows_that_cannot_be_are_refused(row: list[float], told: str) -> None:
    with pytest.raises(BadRequest, match=rf"must-have row 1.*{told}.*must-row"):
        choose(PRINTER, "pairwise", must=np.array([row]))


def test_rows_that_break_a_rule_over_blocks_are_not_drawn() -> None:
    with pytest.raises(BadRequest, match=r"copies = \(9, 99\], colour = on breaks 'many'"):
        from parcours.data import draw

        draw(PRINTER, np.array([[0, 0, 1, 0]]), np.array([0]))


def test_rules_that_leave_no_row_are_named() -> None:
    domains = tuple(enumeration(name, ["yes", "no"]) for name in "ab")
    texts = {"first": "a == b", "second": "a != b"}
    rules = tuple(constraint_of(name, parse_expression(text), domains) for name, text in texts.items())
    with pytest.raises(BadDomain, match=r"'first', 'second'.*no-valid-row"):
        choose(InputModel("m", domains, rules), "pairwise")


def test_values_beyond_one_set_go_on_and_stay_in_their_blocks() -> None:
    for criterion in ("each_choice", "pairwise"):
        model = model_of([3, 2, 2])
        one = choose(model, criterion, budget=0.02)
        many = one.values(seed=2, n=25)
        assert (many[: len(one.rows)] == one.values(seed=2)).all() and len(many) == 25
        assert len(one.values(seed=2, n=2)) == 2


BOXES = [split("v", "m/s", [0.0, 0.5]), split("x", "m", [0.0, 2.0]), split("n", "1", [1, 9], kind="integer")]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_boundary_values_have_the_set_sizes_of_jorgensen(n: int) -> None:
    model = at_boundaries(InputModel("m", tuple(BOXES[:n])))
    normal = choose(model, "base_choice")
    assert len(normal.rows) - normal.n_negative == 4 * n + 1
    assert len(normal.rows) == 6 * n + 1
    assert set_size(model, "all_combinations")[0] == 5**n
    assert all(d.blocks[d.bases[0]].name == "nominal" for d in model.domains)


def test_boundary_values_are_on_and_just_inside_and_just_outside_the_ends() -> None:
    model = at_boundaries(InputModel("m", (split("n", "1", [1, 4, 9], kind="integer"),)))
    values = {block.name: block.low for block in model.domains[0].choices}
    assert values == {
        "[1, 4] min": 1, "[1, 4] nominal": 2, "[1, 4] max-": 3, "[1, 4] max": 4,
        "(4, 9] min": 5, "(4, 9] min+": 6, "(4, 9] nominal": 7, "(4, 9] max-": 8, "(4, 9] max": 9,
        "below": 0, "above": 10,
    }  # fmt: skip


def test_rules_mean_the_same_at_boundaries() -> None:
    model = at_boundaries(PRINTER)
    chosen = choose(model, "all_combinations")
    old = np.stack([d.blocks_of(chosen.values()[:, c]) for c, d in enumerate(PRINTER.domains)], axis=1)
    positive = old[: len(old) - chosen.n_negative]
    assert rules_of(PRINTER).hold(positive).all()
    assert {tuple(row) for row in positive.tolist()} == {
        tuple(row) for row in choose(PRINTER, "all_combinations").rows[:-2].tolist()
    }


def test_an_unknown_criterion_is_answered_with_the_known_ones() -> None:
    with pytest.raises(BadRequest, match="did you mean 'pairwise'"):
        choose(PRINTER, "pairwize")


def test_a_rule_over_values_forbids_only_blocks_in_which_no_value_meets_it() -> None:
    parts = (split("a", "1", [0, 1, 2]), split("b", "1", [0, 1, 2]))
    model = InputModel("m", parts, (Constraint("c", parse_expression("a >= b + 1.5")),))
    assert choose(model, "each_choice").infeasible == ("a = [0, 1]", "b = (1, 2]")


def test_what_a_search_cannot_decide_is_not_called_forbidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def undecided(*_: object) -> None:
        raise UndecidedError

    monkeypatch.setattr(Rules, "complete", undecided)
    chosen = choose(PRINTER, "base_choice")
    assert not chosen.infeasible and chosen.n_undecided == len(chosen.undecided)
    assert {"paper = roll", "paper = none", "copies = 0"} <= set(chosen.undecided)


def test_growing_ends_when_the_time_is_over_and_counts_what_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "LEAST_GROWTH", 0.0)
    chosen = choose(model_of([20] * 10), "pairwise", must=np.zeros((1, 10)), budget=0.0)
    n_pairs = 10 * 9 // 2
    assert len(chosen.rows) == 1 and chosen.n_undecided == n_pairs * (20 * 20 - 1)
    assert len(chosen.undecided) == LISTED and not chosen.infeasible


@pytest.mark.parametrize("step", [1.0, 0.5])
def test_at_boundaries_an_invalid_block_shrinks_to_its_value_next_to_the_range(step: float) -> None:
    invalid = (Block(-50, 0, high_closed=False), Block(100, 900, low_closed=False, name="huge"), Block(950, 960))
    domain = Domain("n", "1", (Block(0, 100),), "integer" if step == 1.0 else "real", invalid=invalid, step=step)
    changed = at_boundaries(InputModel("m", (domain,))).domains[0].invalid
    assert changed == (Block(-step, -step, name="below"), Block(100 + step, 100 + step, name="huge"), invalid[2])
