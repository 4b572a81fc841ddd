"""PICT models: what they say arrives, comes back, or is reported lost; broken ones get one answer with a line."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import InputModel, enumeration, parse_input_model, split
from parcours.data.choosing import choose
from parcours.data.inputs import Group, constraint_of, rules_of
from parcours.data.writing import write_input_model
from parcours.errors import BadDomain
from parcours.model.expression import parse_expression
from parcours_formats.pict import parse_pict, read_pict, write_pict

DISK = """\
# a comment, as in the middle of the constraints
Kind:        Single, Span (5), Stripe | Striped, ~Broken
Size:        100, 10, 500, ~-1
Format tool: Quick, Slow
Again:       <Format tool>, None

{ Kind, Size, Format tool } @ 3
IF [kind] = "SINGLE" AND NOT [Size] IN {10, 100}
  THEN [Format tool] LIKE "q*k"
# here
  ELSE ([Size] >= 100 OR [Kind] <> "Span");
[Again] <> [Format tool] OR [Size] < 500;
NOT [Again] = "none" OR IsPositive([Kind]);
"""


def without_source(model: InputModel) -> InputModel:
    return replace(model, source="", name="", constraints=tuple(replace(c, name="") for c in model.constraints))


def test_a_model_arrives_with_everything_it_says() -> None:
    reading = parse_pict(DISK, "disk.pict")
    model = reading.model
    assert model.names == ("Kind", "Size", "Format_tool", "Again") and model.name == "disk"
    assert model.domains[0].labels == ("Single", "Span", "Stripe", "Broken") and model.sizes == (3, 3, 2, 3)
    assert model.domains[1].labels == ("10", "100", "500", "-1") and model.domains[1].bases == (1,)
    assert model.domains[3].values == ("Quick", "Slow", "None")
    assert model.groups == (Group(("Kind", "Size", "Format_tool"), 3),)
    assert [str(loss) for loss in reading.losses] == [
        "line 2: parameter 'Kind': the weight of 'Span' is not kept",
        "line 2: parameter 'Kind': of the aliases of 'Stripe' only that one is kept",
        "line 4: parameter 'Format tool': it is called Format_tool here",
        "line 7: sub-model of 3 parameters: PICT crosses whole rows of a sub-model with other values; "
        "here it is a group of mixed strength",
    ]


def test_its_constraints_mean_what_pict_means() -> None:
    model = parse_pict(DISK, "disk.pict").model
    kinds, sizes, tools, others = (domain.labels for domain in model.domains)
    for index in itertools.product(*(range(len(d.choices)) for d in model.domains)):
        kind, size, tool, other = kinds[index[0]], float(sizes[index[1]]), tools[index[2]], others[index[3]]
        if kind == "Single" and size not in (10, 100):
            first = tool == "Quick"
        else:
            first = size >= 100 or kind != "Span"
        slow = first and (other != tool or size < 500) and (other != "None" or kind != "Broken")
        assert rules_of(model).hold(np.array([index]))[0] == slow


def test_what_pict_can_say_comes_back_as_it_was() -> None:
    first = parse_pict(DISK, "disk.pict").model
    written = write_pict(first)
    again = parse_pict(written.text, "disk.pict")
    crossed = "PICT crosses whole rows of a sub-model with other values; here it is a group of mixed strength"
    assert [str(loss) for loss in again.losses] == [f"line 5: sub-model of 3 parameters: {crossed}"]
    assert [str(loss) for loss in written.losses] == [
        "parameter 'Size': its bases are not written",
        f"group of 3 parameters: {crossed}",
    ]
    assert replace(again.model.domains[1], bases=(1,)) == first.domains[1]
    domains = tuple(replace(d, bases=(0,)) for d in first.domains)
    assert again.model.domains == domains and again.model.groups == first.groups
    every = np.array(list(itertools.product(*(range(len(d.choices)) for d in domains))))
    assert (rules_of(again.model).hold(every) == rules_of(first).hold(every)).all()
    third = parse_pict(write_pict(again.model).text, "disk.pict").model
    assert without_source(third) == without_source(again.model)


def test_a_pict_model_written_as_yaml_reads_back_equal() -> None:
    model = parse_pict(DISK, "disk.pict").model
    assert replace(parse_input_model(write_input_model(model), "disk.pict"), source="disk.pict") == model


def test_arrays_of_a_pict_model_hold_the_sub_model_by_its_own_order() -> None:
    model = parse_pict("A: 1, 2, 3\nB: 1, 2, 3\nC: 1, 2, 3\nD: 1, 2\n{A, B, C} @ 3\n", "m.pict").model
    rows = choose(model, "pairwise", budget=0.05).rows
    assert len({tuple(row) for row in rows[:, :3].tolist()}) == 27


def test_what_pict_cannot_say_is_written_as_forbidden_blocks_or_reported() -> None:
    domains = (
        split("v", "m/s", [0.0, 1.0, 2.0]),
        split("w", "m/s", [0.0, 1.0, 2.0]),
        enumeration("mode", ["a,b", "~c"]),
    )
    texts = {"sum": "v + w <= 1.5", "near": "hypot(v, w) >= 0.2"}
    rules = tuple(constraint_of(name, parse_expression(text), domains) for name, text in texts.items())
    written = write_pict(InputModel("m", domains, rules))
    assert 'NOT ([v] = "(1 2]" AND [w] = "(1 2]");' in written.text.splitlines()
    assert {loss.where for loss in written.losses} == {
        "parameter 'v'", "parameter 'w'", "parameter 'mode'", "constraint 'sum'", "constraint 'near'", "parameters",
    }  # fmt: skip
    assert parse_pict(written.text, "m.pict").model.sizes == (2, 2, 2)


@pytest.mark.parametrize(
    ("text", "line", "slug"),
    [
        ("", 0, "parameters-none"),
        ("# only a comment\n", 0, "parameters-none"),
        ("A 1 2\n", 1, "pict-syntax"),
        (", 1, 2\n", 1, "pict-syntax"),
        ("A,\n", 1, "pict-syntax"),
        ("A:\n", 1, "pict-syntax"),
        ("A: 1,, 2\n", 1, "name"),
        ("A: 1, 1\n", 1, "values-double"),
        ("A: x, X\n", 1, "values-double"),
        ("A: 10, 1e1\n", 1, "values-blocks|blocks-overlap"),
        ("A: 1\na: 2\n", 2, "duplicate-name"),
        ("A: ~1, ~2\n", 1, "blocks-none"),
        ("A: <B>, 2\n", 1, "unknown-name"),
        ("A: 1, 2\n{ A, B } @ 2\n", 2, "group"),
        ("A: 1, 2\n{ A } @ 2\n", 2, "group"),
        ("A: 1, 2\n{ A, } @\n", 2, "pict-syntax"),
        ("A: 1, 2\n[B] = 1;\n", 2, "unknown-name"),
        ("A: 1, 2\n\n[A] = 1\n", 3, "pict-syntax"),
        ('A: 1, 2\n[A] = "x";\n', 2, "pict-type"),
        ('A: 1, 2\nB: x\n[A] = [B];\n', 3, "pict-type"),
        ('A: 1, 2\n[A] LIKE "1*";\n', 2, "pict-type"),
        ("A: 1, 2\n[A] == 1;\n", 2, "pict-syntax"),
        ("A: 1, 2\nIF [A] = 1;\n", 2, "pict-syntax"),
        ("A: 1, 2\nIF [A] = 1 THEN\n[A] = $;\n", 3, "pict-syntax"),
        ("A: 1, 2\n" + "(" * 5000 + "[A] = 1" + ")" * 5000 + ";\n", 2, "expression-size"),
        ("A: 1, 2\n" + "NOT " * 5000 + "[A] = 1;\n", 2, "expression-size"),
        ("".join(f"p{i}: 1, 2\n" for i in range(1001)), 1001, "columns"),
        ("A: " + ", ".join(map(str, range(10_001))) + "\n", 1, "values-many"),
        ("A: 1, 2\n" + "[A] = 1;\n" * 1001, 1002, "columns"),
    ],
)  # fmt: skip
def test_broken_models_get_one_answer_with_the_line(text: str, line: int, slug: str) -> None:
    with pytest.raises(BadDomain, match=rf"\[({slug})\]$") as caught:
        parse_pict(text, "broken.pict")
    assert not line or str(caught.value).startswith(f"broken.pict:{line}:")


def test_large_comparisons_are_refused_in_time() -> None:
    begun = time.process_time()
    many = ", ".join(f"v{i}" for i in range(400))
    text = f"A: {many}\nB: {many}\n" + "[A] < [B];\n" * 900
    with pytest.raises(BadDomain, match="pict-size"):
        parse_pict(text, "large.pict")
    with pytest.raises(BadDomain, match="file-size"):
        parse_pict("#" * 1_000_001, "large.pict")
    assert time.process_time() - begun < 5


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(DISK) - 1), st.integers(0, 12), st.text("{}[](),:;\"'|~<>=@#\n 0aIFé\x00", max_size=4))
def test_a_damaged_model_is_read_or_refused_but_never_breaks_the_reader(at: int, cut: int, put: str) -> None:
    try:
        reading = parse_pict(DISK[:at] + put + DISK[at + cut :], "damaged.pict")
    except BadDomain as error:
        assert str(error).startswith("damaged.pict")
    else:
        assert reading.model.domains


def test_files_that_cannot_be_read_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BadDomain, match=r"absent\.pict"):
        read_pict(tmp_path / "absent.pict")


def test_values_taken_over_keep_their_negative_mark() -> None:
    model = parse_pict("A: ~x, a\nB: <A>, c, ~y", "m.pict").model
    assert model.domains[1].labels == ("a", "c", "x", "y") and model.sizes == (1, 2)
    assert choose(model, "each_choice").n_negative == 3


FONT = """\
# Tabs and blanks as people type them.
Font,Times,Arial
Style , Regular, Italic, ~Bold (3)
Size @ 1, 10, 12
If, Yes, No
Address: http, https
Link, see:here, there
IF [Font] = "Times" THEN [Size] < 12;
"""


def test_a_parameter_may_be_set_apart_by_a_comma() -> None:
    reading = parse_pict(FONT, "font.pict")
    labels = {domain.name: domain.labels for domain in reading.model.domains}
    assert labels["Font"] == ("Times", "Arial") and labels["Style"] == ("Regular", "Italic", "Bold")
    assert labels["Size"] == ("10", "12") and labels["If"] == ("Yes", "No")
    assert str(reading.model.constraints[0]) == "line_8: !(Font == 'Times') || Size < 12"
    colon = FONT.replace("Font,", "Font:").replace("Style ,", "Style:").replace("Size @ 1,", "Size @ 1:")
    assert parse_pict(colon.replace("If,", "If:"), "font.pict") == reading


def test_a_colon_goes_before_a_comma_as_pict_has_it() -> None:
    reading = parse_pict(FONT, "font.pict")
    assert reading.titles[4:] == ("Address", "Link, see")
    assert reading.model.domains[5].labels == ("here", "there")


@pytest.mark.parametrize(
    ("line", "group"),
    [
        ("{A}", Group(("A",), 1)),
        ("{ A }@1", Group(("A",), 1)),
        ("{A, B, C}", Group(("A", "B", "C"), 2)),
        ("{\tA,B , C } @\t3", Group(("A", "B", "C"), 3)),
        ("{A, B, C}@   3", Group(("A", "B", "C"), 3)),
    ],
)
def test_sub_models_may_have_one_parameter_and_blanks_anywhere(line: str, group: Group) -> None:
    reading = parse_pict(f"A: 1, 2\nB: 1, 2\nC: 1, 2\n{line}\n", "m.pict")
    assert reading.model.groups == (group,)
    assert len(reading.losses) == (len(group.inputs) > 1)
    assert choose(reading.model, "pairwise").rows.shape[1] == 3


@pytest.mark.parametrize("title", ["A @ 3", "A @3", "A@ 3", "A@3", "A  @\t3"])
def test_an_order_of_a_parameter_is_no_part_of_its_name(title: str) -> None:
    reading = parse_pict(f"{title}: 1, 2", "m.pict")
    assert reading.titles == ("A",) and reading.model.names == ("A",)
    assert [str(loss) for loss in reading.losses] == ["line 1: parameter 'A': its own order 3 is not kept"]


def test_result_parameters_and_orders_of_one_parameter_are_losses() -> None:
    reading = parse_pict("A @ 3: 1, 2\n$R: yes, no\nLib/@Name: x, y", "m.pict")
    assert reading.titles == ("A", "$R", "Lib/@Name") and reading.model.names == ("A", "R", "Lib_Name")
    lost = [str(loss) for loss in reading.losses]
    assert "line 1: parameter 'A': its own order 3 is not kept" in lost
    assert "line 2: parameter '$R': a result parameter is combined like any other here" in lost
