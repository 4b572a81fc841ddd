from __future__ import annotations

from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest, ParcoursError
from parcours.model.structure import Machine, Transition
from parcours.paths.walking import parse_condition, parse_generators
from parcours.paths.walking.conditions import StopCondition, is_bounded

RING = [("A.f", Machine("f", "a", ("a", "b"), (Transition("t1", "a", "b"), Transition("t2", "b", "a"))))]

amounts = st.floats(0, 1e9, allow_nan=False)
names = st.text("abcXYZ_.- 1", min_size=1, max_size=6)
leaves = st.one_of(
    st.builds(StopCondition, st.just("covered"), st.sampled_from(["node", "edge-pair", "2-switch"]), st.floats(0, 100)),
    st.builds(StopCondition, st.sampled_from(["reached", "taken"]), names),
    st.builds(StopCondition, st.sampled_from(["steps", "restarts", "elapsed"]), amount=amounts),
    st.just(StopCondition("never")),
)


def joined(inner: st.SearchStrategy[StopCondition]) -> st.SearchStrategy[StopCondition]:
    both = st.lists(inner.filter(lambda each: each.kind != "and"), min_size=2, max_size=3)
    either = st.lists(inner.filter(lambda each: each.kind != "or"), min_size=2, max_size=3)
    return st.builds(StopCondition, st.just("and"), parts=both.map(tuple)) | st.builds(
        StopCondition, st.just("or"), parts=either.map(tuple)
    )


@settings(max_examples=200, deadline=None)
@given(st.recursive(leaves, joined, max_leaves=8))
def test_a_condition_reads_back_from_what_it_prints(condition: StopCondition) -> None:
    assert parse_condition(str(condition)) == condition


NEVER = StopCondition("never")


def _joined(kind: Literal["and", "or"], *parts: StopCondition) -> StopCondition:
    return StopCondition(kind, parts=parts)


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("edge>=100%", StopCondition("covered", "edge", 100.0)),
        ("EDGE-PAIR >= 50 % OR never", _joined("or", StopCondition("covered", "EDGE-PAIR", 50.0), NEVER)),
        ("30s", StopCondition("elapsed", amount=30.0)),
        ("500 ms", StopCondition("elapsed", amount=0.5)),
        ("2 min", StopCondition("elapsed", amount=120.0)),
        ("steps>=1e6", StopCondition("steps", amount=1e6)),
        ("reached('not a word')", StopCondition("reached", "not a word")),
        ("taken(1)", StopCondition("taken", "1")),
        ("never and never or never", _joined("or", _joined("and", NEVER, NEVER), NEVER)),
        ("(never or never) && never", _joined("and", _joined("or", NEVER, NEVER), NEVER)),
    ],
)
def test_conditions_are_read(text: str, condition: StopCondition) -> None:
    assert parse_condition(text) == condition


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a condition must stand here, but it ends there"),
        ("edge", "'edge' must be followed by '>='"),
        ("edge=100%", "column 5 has '='"),
        ("edge>=100", "must be followed by '%'"),
        ("edge>=101%", "at most 100%"),
        ("30", "a time must have a unit, ms, s, min, h"),
        ("30 weeks", "column 4 has 'weeks'"),
        ("edge>=1e999%", "this one is too large"),
        ("reached()", "'reached' must name something"),
        ("(edge>=1%", "must be followed by ')'"),
        ("edge>=1% edge>=2%", "'and', 'or' or the end"),
        ("edge>=1% and", "it ends there"),
        ("(" * 60 + "never" + ")" * 60, "at most 50 deep"),
        ("never or " * 1000 + "never", "at most 4096 characters"),
    ],
)
def test_a_bad_condition_says_where_and_what(text: str, says: str) -> None:
    with pytest.raises(BadRequest, match=r"stop condition.*\[walk-syntax\]") as caught:
        parse_condition(text)
    assert says in str(caught.value)


@settings(max_examples=300, deadline=None)
@given(st.text(st.sampled_from("ab1%>=()&|'\" .\n-e_"), max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    for read in (parse_condition, lambda text: parse_generators(text, RING)):
        try:
            read(text)
        except ParcoursError as error:
            assert error.slug in ("walk-syntax", "unknown-generator", "foreign-condition", "no-predefined-path")


def test_only_steps_and_time_bound_every_walk() -> None:
    bounded = {
        text: is_bounded(parse_condition(text)) for text in ("steps>=1", "1 s", "edge>=1%", "restarts>=1", "never")
    }
    assert [text for text, yes in bounded.items() if yes] == ["steps>=1", "1 s"]
    assert is_bounded(parse_condition("edge>=1% or (steps>=1 and 1 s)"))
    assert not is_bounded(parse_condition("edge>=1% and steps>=1"))


@pytest.mark.parametrize(
    ("text", "phases"),
    [
        ("random(edge_coverage(100))", ["Random edge>=100%"]),
        ("RandomPath(EdgeCoverage(100))", ["Random edge>=100%"]),
        ("quick_random(vertex_coverage(80))", ["Guided node>=80%"]),
        ("weighted_random(time_duration(30))", ["Weighted 30 s"]),
        ("weightedrandompath(length(80))", ["Weighted steps>=80"]),
        ("a_star(reached_vertex(v_ABC))", ["Guided reached(v_ABC)"]),
        ("aStarPath(reached_edge(e_1) && reached_vertex(v))", ["Guided taken(e_1) and reached(v)"]),
        ("RANDOM ( REACHED_VERTEX( Some_vertex) OR never )", ["Random reached(Some_vertex) or never"]),
        (
            "random((vertex_coverage(100) and reached_vertex(v)) || time_duration(90))",
            ["Random node>=100% and reached(v) or 90 s"],
        ),
        ("random(edge_coverage(100)) a_star(reached_vertex(v))", ["Random edge>=100%", "Guided reached(v)"]),
        ("shortest_all_paths(edge_coverage(100))", ["Planned edge>=100%"]),
        ("new_shortest_all_paths(never)", ["Planned never"]),
        ("directed_chinese_postman", ["Planned never"]),
        ("predefined_path(predefined_path)", ["Planned never"]),
    ],
)
def test_generator_strings_become_phases(text: str, phases: list[str]) -> None:
    found = parse_generators(text, RING, predefined=["t1", "t2"])
    assert [f"{type(each.walker).__name__} {each.until}" for each in found] == phases


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rndom(edge_coverage(100))", "did you mean 'random'"),
        ("random(edge_coverag(100))", "did you mean 'edge_coverage'"),
        ("random(dependency_edge_coverage(80))", "no dependencies of edges"),
        ("random(reached_shared_state(LINK))", "no shared states"),
        ("random", "must be followed by '('"),
        ("random(edge_coverage(100)", "must be followed by ')'"),
        ("random(edge_coverage(100)))", "a generator must stand here"),
        ("random(edge_coverage(101))", "at most 100%"),
        ("a_star(edge_coverage(100))", "'a_star' needs reached_vertex or reached_edge"),
        ("predefined_path(predefined_path)", "--path"),
        ("", "a generator must stand here"),
    ],
)
def test_what_graphwalker_says_and_we_do_not_is_refused_by_name(text: str, says: str) -> None:
    with pytest.raises(BadRequest) as caught:
        parse_generators(text, RING)
    assert says in str(caught.value)
