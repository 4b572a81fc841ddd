"""Objects, lists and joined texts of SCXML: what has a fixed shape becomes variables, the rest is refused by name."""

from __future__ import annotations

import re

import pytest

from parcours.errors import BadModel
from parcours.model import predicate
from parcours.model.formats import ForeignModel
from parcours_formats import scxml


def read(data: str, content: str = "", cond: str = "true") -> ForeignModel:
    """Return the reading of a chart with data, and one transition with a condition and content."""
    return scxml.read(
        f"""<scxml xmlns="http://www.w3.org/2005/07/scxml" name="chart">
<datamodel>{data}</datamodel>
<state id="a"><transition event="e" cond="{cond}">
{content}
</transition></state></scxml>""",
        "chart.scxml",
    )


def step(data: str, content: str = "", cond: str = "true") -> str:
    """Return what the transitions do, as predicates."""
    return "\n".join(predicate(each) for each in read(data, content, cond).cefsm.components[0].transitions())


def initial(reading: ForeignModel) -> dict[str, object]:
    return {each.name: each.initial for each in reading.cefsm.components[0].variables}


POINT = "<data id=\"p\" expr=\"{x: 1, 'the name': 'k', at: {y: 0.5, on: true}, list: [10, 20, [30],]}\"/>"


def test_each_part_of_an_object_or_a_list_is_a_variable() -> None:
    reading = read(POINT + '<data id="q">{"z": [1, 2, 3]}</data><data id="n" expr="p.list[1] + q.z.length"/>')
    assert initial(reading) == {
        "p_x": 1, "p_the_name": "k", "p_at_y": 0.5, "p_at_on": True, "p_list_0": 10, "p_list_1": 20, "p_list_2_0": 30,
        "q_z_0": 1, "q_z_1": 2, "q_z_2": 3, "n": 23,
    }  # fmt: skip
    assert [str(loss) for loss in reading.losses] == [
        "line 2: data 'p': its parts are variables here: p_x, p_the_name, p_at_y, "
        "p_at_on, p_list_0, p_list_1, p_list_2_0",
        "line 2: data 'q': its parts are variables here: q_z_0, q_z_1, q_z_2",
    ]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ('<assign location="p.x" expr="p.list[0] + p.list.length"/>', "p_x := p_list_0 + 3"),
        ("<assign location=\"p['the name']\" expr=\"'l'\"/>", "p_the_name := 'l'"),
        ('<script>p.list[2][0]++; p["at"].y = p.x</script>', "p_list_2_0 := p_list_2_0 + 1; p_at_y := p_x"),
        ('<assign location="p.at" expr="{on: !p.at.on, y: 2}"/>', "p_at_y := 2; p_at_on := !p_at_on"),
        ('<assign location="p.list" expr="[p.list[1], 7, [p.list[0]]]"/>',
         "p_list_2_0 := p_list_0; p_list_0 := p_list_1; p_list_1 := 7"),
    ],
)  # fmt: skip
def test_parts_are_read_and_assigned(content: str, expected: str) -> None:
    assert step(POINT, content) == f"(e/-/{expected}/-)"


def test_what_is_assigned_as_a_whole_has_the_values_before() -> None:
    data = '<data id="p" expr="{a: 1, b: 2, c: 3}"/><data id="f" expr="true"/>'
    assert (
        step(data, '<assign location="p" expr="{a: p.b, b: p.c, c: 0}"/>') == "(e/-/p_a := p_b; p_b := p_c; p_c := 0/-)"
    )
    assert (
        step(data, '<assign location="p" expr="{c: p.b, b: p.a, a: 0}"/>') == "(e/-/p_c := p_b; p_b := p_a; p_a := 0/-)"
    )
    chosen = step(data, '<assign location="p" expr="f ? {a: 0, b: 0, c: 0} : {a: p.c, b: 1, c: 1}"/>')
    assert chosen.splitlines() == [
        "(e/[f]/p_a := 0; p_b := 0; p_c := 0/-)",
        "(e/[!f]/p_a := p_c; p_b := 1; p_c := 1/-)",
    ]


def test_conditions_read_parts() -> None:
    assert step(POINT, cond="p.list[1] &gt; 3 &amp;&amp; p.at.on") == "(e/[p_list_1 > 3 && p_at_on]/-/-)"
    assert step(POINT, cond="p.list.length == 3") == "(e/-/-/-)"


def test_names_of_parts_are_given_out_once_and_unknown_to_the_document() -> None:
    data = '<data id="p_x" expr="5"/><data id="p" expr="{x: 1}"/>'
    assert initial(read(data)) == {"p_x": 5, "p_x_2": 1}
    assert step(data, "<script>p.x = p_x</script>") == "(e/-/p_x_2 := p_x/-)"
    with pytest.raises(BadModel, match="'p_x_2' is not"):
        read(data, '<assign location="p_x" expr="p_x_2"/>')


def test_a_script_of_the_document_may_give_objects_and_parts() -> None:
    reading = scxml.read(
        '<scxml name="c"><script>var p = {a: 1, b: [2]}; p.b[0] = p.a + 4</script><state id="s"/></scxml>', "c.scxml"
    )
    assert initial(reading) == {"p_a": 1, "p_b_0": 5}


@pytest.mark.parametrize(
    ("content", "named", "remedy"),
    [
        ('<assign location="p.z" expr="1"/>', "the part 'z' of 'p', whose parts are x, the name", "declare"),
        ('<assign location="p.list[3]" expr="1"/>', "the part '3' of 'p.list', whose parts are 0, 1, 2", "declare"),
        ('<assign location="p.x" expr="p.list[p.x]"/>', "an index of 'p.list' that is no constant", "write a choice"),
        ('<assign location="p.x" expr="p.list[-1]"/>', "an index of 'p.list' that is no constant", "write a choice"),
        ('<assign location="n" expr="p"/>', "'p' as a whole", "use its parts"),
        ('<assign location="p.at" expr="p.list"/>', "'p.at' assigned what is not written out as an object", "a copy"),
        ('<assign location="p.at" expr="{y: 1}"/>', "assigned the parts y, though it starts with y, on", "all parts"),
        ('<assign location="p.at" expr="[1, 2]"/>', "'p.at' assigned what is not written out as an object", "by part"),
        ('<assign location="p.at" expr="{y: [1], on: true}"/>', "one as the part 'y' of 'p.at'", "so"),
        ('<assign location="n" expr="[1]"/>', "one assigned to a place that starts as a single value", "that shape"),
        ('<assign location="p.list" expr="[p.list[1], p.list[0], [1]]"/>', "that exchange", "another"),
        ('<script>p.list.push(4)</script>', "'push', which changes the list 'p.list' as a whole", "all its elements"),
        ('<assign location="p.list.length" expr="0"/>', "an assignment to the length of a list", "all its elements"),
        ('<assign location="n" expr="p.x.y"/>', "the part 'y' of a single value", "use the value itself"),
        ('<assign location="n" expr="p.toString"/>', "the part 'toString' of 'p'", "declare"),
        ('<if cond="p == p"/>', "'p' as a whole", "use its parts"),
        ('<assign location="n" expr="{x}"/>', "the field 'x' without a value", "write x: value"),
        ("<assign location=\"t\" expr=\"t + 'x'\"/>", 'are joined by +, but "t" varies', "as a choice"),
        ("<assign location=\"t\" expr=\"'x' + (true &amp;&amp; 2)\"/>", "but a condition varies", "as a choice"),
        ("<assign location=\"t\" expr=\"'x' + n\"/>", 'are joined by +, but "n" varies', "as a choice"),
    ],
)  # fmt: skip
def test_what_a_fixed_shape_cannot_say_is_refused_with_line_construct_and_remedy(
    content: str, named: str, remedy: str
) -> None:
    with pytest.raises(BadModel) as caught:
        read(POINT + '<data id="n" expr="0"/><data id="t" expr="\'a\'"/>', content)
    assert named in str(caught.value) and remedy in str(caught.value) and caught.value.slug == "foreign-construct"
    assert re.match(r"chart\.scxml:4: <(assign|script|if)>: ", str(caught.value))


@pytest.mark.parametrize(
    ("data", "used", "named"),
    [
        ('<data id="p" expr="{a: null}"/>', "p.a", "'p' cannot be used"),
        ('<data id="p" expr="{a: 1, a: 2}"/>', "p.a", "the field 'a', twice"),
        ('<data id="p" expr="{__proto__: 1}"/>', "p.a", "the field '__proto__'"),
        ('<data id="p" expr="[1, , 2]"/>', "p[0]", "a value must stand"),
        ('<data id="p" expr="{a() { return 1 }}"/>', "p.a", "the field 'a' without a value"),
        ('<data id="p" expr="[1]"/><data id="p" expr="2"/>', "p", "a second initial value of 'p'"),
        ('<data id="p" expr="' + "[" * 5000 + '"/>', "p[0]", "nests at most"),
        ('<data id="p" expr="[' + "1," * 5000 + ']"/>', "p[0]", "more than 1000 parts"),
    ],
)  # fmt: skip
def test_data_that_are_not_well_formed_or_too_large_are_refused_where_they_are_used(
    data: str, used: str, named: str
) -> None:
    with pytest.raises(BadModel) as caught:
        read(data, cond=f"{used} == 1")
    assert named in str(caught.value)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("'a' + 'b'", "(e/-/t := 'ab'/-)"),
        ("'a' + 1 + 2", "(e/-/t := 'a12'/-)"),
        ("1 + 2 + 'a'", "(e/-/t := '3a'/-)"),
        ("'a' + -1.50 + true + 2.0", "(e/-/t := 'a-1.5true2'/-)"),
        ("'a' + +true", "(e/-/t := 'a1'/-)"),
        ("'a' + p.length", "(e/-/t := 'a2'/-)"),
        ("'is ' + !f", "(e/[!f]/t := 'is true'/-)\n(e/[f]/t := 'is false'/-)"),
        ("(n &gt; 1 ? 'many' : 'few') + '!'", "(e/[n > 1]/t := 'many!'/-)\n(e/[n <= 1]/t := 'few!'/-)"),
    ],
)
def test_texts_are_joined_as_javascript_does_where_each_case_is_constant(expression: str, expected: str) -> None:
    data = '<data id="t" expr="\'\'"/><data id="f" expr="true"/><data id="n" expr="0"/><data id="p" expr="[0, 0]"/>'
    assert step(data, f'<assign location="t" expr="{expression}"/>') == expected


def test_a_text_without_a_first_value_that_is_joined_is_a_text() -> None:
    [variable] = read('<data id="t"/>', '<assign location="t" expr="\'a\' + 1"/>').cefsm.components[0].variables
    assert (variable.name, variable.type, variable.initial) == ("t", "text", "")
