"""UPPAAL files to models: everything is written out, and does what the network of automata does."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path
from xml.sax.saxutils import escape

import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadModel
from parcours.model import ENVIRONMENT, Cefsm, StepRelation, predicate
from parcours.model.formats import ForeignModel, read_any
from parcours_formats import uppaal

SEEDS = Path(__file__).parents[1] / "fuzz" / "seeds"


def network(declarations: str, system: str, *templates: str) -> str:
    """Return a file: a template is `name(parameters) | declarations | start | a -> b: label ;; label`."""
    lines = [f"<nta><declaration>{escape(declarations)}</declaration>"]
    for template in templates:
        head, declared, initial, *edges = (part.strip() for part in template.split("|"))
        name, _, parameters = head.partition("(")
        lines.append(f"<template><name>{name}</name><parameter>{escape(parameters.rstrip(')'))}</parameter>")
        lines.append(f"<declaration>{escape(declared)}</declaration>")
        ends = [tuple(end.strip() for end in edge.partition(":")[0].split("->")) for edge in edges]
        places = dict.fromkeys([initial, *(place for pair in ends for place in pair)])
        lines += [f'<location id="{place}"><name>{place}</name></location>' for place in places]
        lines.append(f'<init ref="{initial}"/>')
        for (source, target), edge in zip(ends, edges, strict=True):
            lines.append(f'<transition><source ref="{source}"/><target ref="{target}"/>')
            for label in filter(None, (part.strip() for part in edge.partition(":")[2].split(";;"))):
                kind, _, text = label.partition(" ")
                lines.append(f'<label kind="{kind}">{escape(text)}</label>')
            lines.append("</transition>")
        lines.append("</template>")
    return "\n".join([*lines, f"<system>{escape(system)}</system></nta>"])


def read(declarations: str, system: str, *templates: str) -> ForeignModel:
    return uppaal.read(network(declarations, system, *templates), "net.xml")


def predicates(cefsm: Cefsm) -> dict[str, str]:
    return {each.id: predicate(each) for part in cefsm.components for each in part.transitions()}


def test_a_template_with_a_range_becomes_one_process_for_each_value() -> None:
    cefsm = read(
        "const int N = 3; typedef int[0,N-1] id_t; chan go[N];",
        "system Car, Gate;",
        "Car(const id_t id) | clock x; | a | a -> b: synchronisation go[id]? ;; assignment x = id",
        "Gate |  | s | s -> s: select e : id_t ;; guard e > 0 ;; synchronisation go[e]!",
    ).cefsm
    assert [component.name for component in cefsm.components] == ["Car_0", "Car_1", "Car_2", "Gate"]
    assert predicates(cefsm) == {
        "Car(0).1": "(go_0/-/x := 0/-)",
        "Car(1).1": "(go_1/-/x := 1/-)",
        "Car(2).1": "(go_2/-/x := 2/-)",
        "Gate.1[e=1]": "(-/-/-/go_1())",
        "Gate.1[e=2]": "(-/-/-/go_2())",
    }
    ends = {channel.name: (channel.sender, channel.receiver, channel.capacity) for channel in cefsm.channels}
    assert ends["go_2"] == ("Gate", "Car_2", 0) and ends["go_0"] == (ENVIRONMENT, "Car_0", 0)


def test_partial_instances_bind_values_and_references() -> None:
    cefsm = read(
        "int total; int other; chan c;",
        "Half(const int k) = T(k, total, c); A = Half(2); B = Half(5); C = T(1, other, c); system A, B, C;",
        "T(const int k, int &n, chan &d) | const int twice = 2 * k; | s | s -> s: assignment n += twice",
    ).cefsm
    assert [component.name for component in cefsm.components] == ["A_B", "C"]
    assert predicates(cefsm) == {
        "A.1": "(-/-/total := total + 4/-)",
        "B.1": "(-/-/total := total + 10/-)",
        "C.1": "(-/-/other := other + 2/-)",
    }


def test_processes_that_share_a_variable_are_machines_of_one_component() -> None:
    reading = read_any(SEEDS / "lock.xml")
    [component] = reading.cefsm.components
    assert [machine.name for machine in component.machines] == ["P1", "P2"]
    assert [(each.name, each.type) for each in component.variables] == [
        ("id", "int"),
        ("P1_x", "clock"),
        ("P2_x", "clock"),
    ]
    said = predicates(reading.cefsm)
    assert said["P1.set"] == "(-/[P1_x <= 2]/P1_x := 0; id := 1/-)" and said["P2.enter"].startswith(
        "(-/[P2_x > 2 && id == 2]"
    )
    assert [str(condition) for _, condition in component.machines[0].invariants] == ["P1_x <= 2"]


def test_what_nobody_changes_is_no_reason_to_share() -> None:
    reading = read(
        "int limit = 4;", "A = T(); B = T(); system A, B;", "T | int n; | s | s -> s: guard n < limit ;; assignment n++"
    )
    assert [component.name for component in reading.cefsm.components] == ["A", "B"]
    assert predicates(reading.cefsm)["A.1"] == "(-/[n < 4]/n := n + 1/-)"
    assert any("its value stands in its place" in loss.what for loss in reading.losses)


def test_a_channel_becomes_one_for_each_pair_of_components() -> None:
    cefsm = read(
        "chan c;",
        "A = S(); B = S(); X = R(); Y = R(); system A, B, X, Y;",
        "S | | s | s -> s: synchronisation c!",
        "R | | s | s -> s: synchronisation c?",
    ).cefsm
    assert sorted(channel.name for channel in cefsm.channels) == ["c_A_X", "c_A_Y", "c_B_X", "c_B_Y"]
    assert sorted(predicates(cefsm)) == sorted(
        [f"{one}.1 with {other}" for one in "AB" for other in "XY"]
        + [f"{one}.1 with {other}" for one in "XY" for other in "AB"]
    )
    steps = StepRelation(cefsm)
    assert len(steps.enabled(steps.layout.initial(), {})) == 4


def test_urgent_places_take_no_time_and_branch_points_have_weights() -> None:
    reading = read_any(SEEDS / "gate.xml")
    keeper = reading.cefsm.components[-1]
    weights = {each.id: each.weight for each in keeper.transitions()}
    assert weights["Keeper.4.5[e=0]#1"] == 3 and weights["Keeper.4.6[e=2]#1"] == 1
    assert {each.duration for each in keeper.transitions() if each.source == "id6"} == {(0.0, 0.0)}
    assert any("committed" in loss.what and loss.line == 46 for loss in reading.losses)


def test_a_queue_in_functions_behaves_as_a_queue() -> None:
    cefsm = read(
        "",
        "system Q;",
        "Q | int[0,3] list[5]; int[0,4] len; int[-1,3] out = -1; int[0,40] all;"
        " void put(int[0,3] e) { list[len++] = e; }"
        " int[0,3] head() { if (len == 0) return 0; return list[0]; }"
        " void take() { int i = 0; len -= 1; while (i < len) { list[i] = list[i + 1]; i++; } list[i] = 0; }"
        " void total() { int t; for (k : int[0,4]) t += list[k]; all = t; }"
        " | s | s -> s: select e : int[0,3] ;; guard len < 4 ;; assignment put(e), total()"
        " | s -> s: guard len > 0 ;; assignment out = head(), take(), total()",
    ).cefsm
    steps, source, twin = StepRelation(cefsm), random.Random(5), list[int]()
    here, names = steps.layout.initial(), [variable.name for _, variable in steps.layout.variables]
    for _ in range(300):
        move = source.choice(steps.enabled(here, {}))
        here = steps.step(here, move)
        values = dict(zip(names, here.values, strict=True))
        if move.transition.startswith("Q.1"):
            twin.append(int(move.transition.partition("=")[2][0]))
        else:
            assert values["out"] == twin.pop(0)
        assert [values[f"list_{at}"] for at in range(5)] == [*twin, 0, 0, 0, 0, 0][:5]
        assert values["len"] == len(twin) and values["all"] == sum(twin)


def test_records_quantifiers_and_varying_indices_are_written_out() -> None:
    cefsm = read(
        "",
        "system T;",
        "T | typedef struct { bool on; int[0,9] n; } lamp_t; lamp_t lamp[2] = {{true, 3}, {false, 0}}; int[0,1] at;"
        " | s | s -> s: guard forall (i : int[0,1]) lamp[i].n < 5 ;; assignment lamp[at].n++, lamp[at].on = true"
        " | s -> t: guard (sum (i : int[0,1]) lamp[i].n) > 6",
    ).cefsm
    said = predicates(cefsm)
    assert said["T.2"] == "(-/[lamp_0_n + lamp_1_n > 6]/-/-)"
    assert said["T.1#1"] == (
        "(-/[lamp_0_n < 5 && lamp_1_n < 5 && at == 0]/lamp_0_n := lamp_0_n + 1; lamp_0_on := true/-)"
    )
    assert [each.initial for each in cefsm.components[0].variables] == [True, 3, False, 0, 0]


@pytest.mark.parametrize(
    ("declarations", "template", "named"),
    [
        ("double f(double x) { return sin(x); }", "T | | s | s -> s: guard f(1.0) > 2", "a call of the function 'sin'"),
        ("void f() { while (true) { } }", "T | | s | s -> s: assignment f()", "a loop ends within"),
        ("int f(int n) { return f(n); }", "T | | s | s -> s: guard f(1) > 2", "calls more than"),
        ("int n; int f() { n++; return n; }", "T | | s | s -> s: guard f() > 2", "which changes variables"),
        ("", "T | int n; | s | s -> s: guard n & 1", "the bit operator '&'"),
        ("", "T | clock x; | s | s -> s: guard x' == 0", "a derivative"),
        ("", "T | hybrid clock x; | s | s -> s", "a hybrid clock"),
        ("", "T | int n | s | s -> s", "';' must stand"),
        ("", "T | int a[3]; | s | s -> s: assignment a = a", "an array"),
        ("", "T | int a[3]; | s | s -> s: guard a[7] > 0", "an index must lie inside its array"),
        ("", "T | | s | s -> s: guard missing > 0", "'missing' is not"),
        ("", "T | clock x; int n; | s | s -> s: assignment n = x", "reads 'x'"),
        ("chan c;", "T | | s | s -> s: synchronisation c", "'!' or '?' must stand"),
        ("before_update { }", "T | | s | s -> s", "'before_update'"),
    ],
)
def test_what_cannot_be_said_is_refused_by_name_and_line(declarations: str, template: str, named: str) -> None:
    with pytest.raises(BadModel) as caught:
        read(declarations, "system T;", template)
    assert named in str(caught.value) and re.search(r"net\.xml:[0-9]+", str(caught.value))


@pytest.mark.parametrize(
    ("declarations", "system", "template"),
    [
        ("", "system T;", "T | | s | s -> s: select i : int[0,2147483647] ;; guard i > 3"),
        ("", "system T;", "T | | s | s -> s: select i : int[0,999], j : int[0,999], k : int[0,999] ;; guard i > j"),
        ("", "system T;", "T(const int[0,999] a, const int[0,999] b) | | s | s -> s"),
        ("", "system T;", "T(const int[0,2147483647] a) | | s | s -> s"),
        ("", "A = B(); B = A(); system A;", "T | | s | s -> s"),
        ("int a[100000000];", "system T;", "T | | s | s -> s"),
        ("int a[1000][1000][1000];", "system T;", "T | | s | s -> s"),
        ("int a[0];", "system T;", "T | | s | s -> s"),
        ("", "system T;", "T | int n; | s | s -> s: guard " + "forall (i : int[0,999]) " * 6 + "n > i"),
        ("int a[200];", "system T;", "T | int n; | s | s -> s: guard a[a[a[a[n]]]] > 0"),
        ("void f() { for (i : int[0,999]) for (j : int[0,999]) for (k : int[0,999]) { } }", "system T;",
         "T | | s | s -> s: assignment f()"),
        ("void f() { f(); f(); } ", "system T;", "T | | s | s -> s: assignment f()"),
        ("struct { " * 3000, "system T;", "T | | s | s -> s"),
        ("const int a = " + "(" * 5000 + "1;", "system T;", "T | | s | s -> s"),
    ],
)  # fmt: skip
def test_what_would_grow_without_bound_is_refused_at_once(declarations: str, system: str, template: str) -> None:
    began = time.process_time()
    with pytest.raises(BadModel, match=r"net.xml:\d+"):
        read(declarations, system, template)
    assert time.process_time() - began < 5


@pytest.mark.parametrize("name", ["switch", "case", "enum", "deadlock", "numOf", "invariant", "rate", "location_"])
def test_names_that_are_words_elsewhere_are_names(name: str) -> None:
    cefsm = read(
        f"int {name}; chan c;",
        f"P = {name}_(1); system P, T;",
        f"{name}_(const int k) | | {name} | {name} -> b: guard {name} < k ;; assignment {name}++",
        f"T | | {name} | {name} -> b: assignment {name} = 0",
    ).cefsm
    assert predicates(cefsm)["P.1"] == f"(-/[{name} < 1]/{name} := {name} + 1/-)"
    assert read("", f"system {name};", f"{name} | | s | s -> s").cefsm.components[0].name == name


def test_words_of_the_language_are_no_names() -> None:
    for word in ("while", "return", "exit", "xor"):
        with pytest.raises(BadModel, match=rf"here is (the loop )?'{word}'"):
            read(f"int {word};", "system T;", "T | | s | s -> s")


@pytest.mark.parametrize(
    ("declarations", "system", "templates", "last"),
    [
        ("", "system Car;", ["Car(const int[0,4999] id) | clock x; int[0,9] y; | a | a -> b: guard y < 5 ;; "
         "assignment y = y + 1, x = 0 | b -> a"], "(-/[y < 5]/y := y + 1; x := 0/-)"),
        ("", "{lines}system {names};", ["Car(const int id) | | a | a -> b: guard id < 5000"], "(-/-/-/-)"),
        ("chan go[5000];", "system Gate, Car;", ["Car(const int[0,4999] id) | | a | a -> b: synchronisation go[id]?",
         "Gate | | s | s -> s: select e : int[0,4999] ;; synchronisation go[e]!"], "(go_4999/-/-/-)"),
        ("chan go;", "system Gate, Car;", ["Car(const int[0,4999] id) | | a | a -> b: synchronisation go?",
         "Gate | | s | s -> s: synchronisation go!"], "(go_Gate_Car_4999/-/-/-)"),
        ("int[0,9] y;", "system Car;", ["Car(const int[0,4999] id) | | a | a -> b: guard y < 5 ;; assignment y++"],
         "(-/[y < 5]/y := y + 1/-)"),
    ],
)  # fmt: skip
def test_thousands_of_processes_are_read_in_linear_time(
    declarations: str, system: str, templates: list[str], last: str
) -> None:
    names = [f"a_process_with_a_long_name_{number}" for number in range(5000)]
    lines = "".join(f"{name} = Car({number});\n" for number, name in enumerate(names))
    began = time.process_time()
    cefsm = read(declarations, system.format(lines=lines, names=", ".join(names)), *templates).cefsm
    assert time.process_time() - began < 30  # where each process looks at each other one it takes minutes
    machines = [machine for component in cefsm.components for machine in component.machines]
    assert len(machines) == 5000 + (len(templates) > 1)
    assert predicate(machines[-1].transitions[0]) == last


@pytest.mark.parametrize(
    ("declarations", "templates", "rule"),
    [
        ("", ["T(const int[0,299] a, const int[0,299] b) | | s | s -> s"],
         "a system has at most 50000 processes, but this one has 90000 or more; make the ranges of the parameters"),
        ("chan c;", ["T(const int[0,999] a) | | s | s -> s: synchronisation c! | s -> s: synchronisation c?"],
         "at most 200000 in all, but channel 'c' joins 1000 processes that send with 1000 that receive; instantiate"),
    ],
)  # fmt: skip
def test_a_system_too_large_is_refused_with_the_limit_and_a_way_out(
    declarations: str, templates: list[str], rule: str
) -> None:
    began = time.process_time()
    with pytest.raises(BadModel, match=r"net.xml:\d+") as caught:
        read(declarations, "system T;", *templates)
    assert rule in str(caught.value) and caught.value.slug == "expansion-size"
    assert time.process_time() - began < 5


def test_an_old_file_reads_as_a_new_one() -> None:
    old = read(
        "const N 3; int n := 0;",
        "P := T(N); system P;",
        "T(const int k) | | s | s -> s: guard n<k, n>=0 ;; assignment n:=n+1",
    )
    assert predicates(old.cefsm) == {"P.1": "(-/[n < 3 && n >= 0]/n := n + 1/-)"}


def test_edges_that_nobody_can_take_are_losses() -> None:
    reading = read(
        "chan c;",
        "system Both, Other;",
        "Both | | a | a -> b: synchronisation c! ;; guard true | b -> a: synchronisation c? | a -> a: guard 1 == 2",
        "Other | | s | s -> s: synchronisation c!",
    )
    assert [each.source for each in reading.cefsm.component("Both").transitions()] == ["b"]
    said = [str(each) for each in reading.losses]
    assert len(said) == 2 and "'Both.1': no other process meets it on channel 'c'" in said[0], said
    assert "edge from 'a' to 'a' of 'Both': its guard is false whatever happens" in said[1]


BROADCAST = (
    "Speaker | | a | a -> b: synchronisation c! | b -> a:", "Hearer | | r | r -> q: synchronisation c?",
)  # fmt: skip


def test_a_deadlock_that_may_come_from_what_is_not_kept_is_no_error(tmp_path: Path) -> None:
    file = tmp_path / "net.xml"
    file.write_text(network("broadcast chan c;", "system Speaker, Hearer;", *BROADCAST))
    done = CliRunner().invoke(parcours, ["explore", str(file)])
    assert (
        done.exit_code == 3 and "runs may differ for what is not kept: line 1: channel 'c': a broadcast" in done.stdout
    )
    assert "doubtful: no move is possible" in done.stdout and "error" not in done.stdout
    assert "runs may differ" in CliRunner().invoke(parcours, ["feasible", str(file)]).stdout
    file.write_text(network("chan c;", "system Speaker, Hearer;", *BROADCAST))
    done = CliRunner().invoke(parcours, ["explore", str(file)])
    assert done.exit_code == 1 and "error: no move is possible" in done.stdout
