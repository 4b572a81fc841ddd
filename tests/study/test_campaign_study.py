"""A campaign study keeps every promise to its author, whatever the code that it simulates does."""

from __future__ import annotations

import copyreg
import dataclasses
import hashlib
import json
import os
import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from parcours.data import enumeration, split
from parcours.data.inputs import InputModel
from parcours.errors import BadModel, BadRequest, BadResults, BadSuite
from parcours.report.pieces import Figure, Table, Text
from parcours.study.campaign.calling import seed_of
from parcours.study.campaign.results import CampaignResults
from parcours.study.campaign.rules import Fact, Fault, Rule
from parcours.study.campaign.study import CampaignStudy
from parcours.study.components.systems import ProgramPart
from parcours.study.finding import find
from parcours.study.parameters import Parameter, settings_of
from parcours.study.protocol import Request, Study
from parcours.study.study_file import check_study_file
from parcours.verdict.judgement import Verdict

PARKING = Path(__file__).parents[2] / "examples" / "parking"
INPUTS = InputModel("inputs", (split("x", "m", [0.0, 1.0, 2.0]), split("n", "1", [0, 4, 9], kind="integer"),
                               enumeration("mode", ["slow", "fast"])))  # fmt: skip
DOMAINS = """\
parcours: data/1
name: inputs
parameters:
  x: {unit: m, edges: [0, 1, 2]}
"""
STUDY = """\
parcours: study/1
name: demo
kind: campaign
simulate: demo.py:simulate
facts: {y: {type: real, unit: m}}
fail: y > 1
cases: 24
"""
HOSTILE = """
import ctypes, os, signal, sys, time

def sleep_through_everything():
    while True:
        try:
            time.sleep(10)
        except BaseException:
            pass

def deaf():
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
    while True:
        pass

def child():
    if os.fork() == 0:
        return {"y": -1.0}
    os.wait()

def raising(error):
    raise error

CRIMES = {
    2: lambda: raising(ValueError(object())),
    3: lambda: {"y": float("nan")},
    4: lambda: {"z": 1.0},
    5: lambda: {"y": "one"},
    6: lambda: sys.exit(0),
    7: lambda: time.sleep(60),
    8: sleep_through_everything,
    9: deaf,
    10: lambda: os._exit(3),
    11: lambda: ctypes.string_at(0),
    13: lambda: None,
    14: lambda: {"y": 10**400},
    15: lambda: os.kill(os.getpid(), signal.SIGKILL),
}

def simulate(case, x):
    if case.number == 12:
        child()
    found = CRIMES[case.number]() if case.number in CRIMES else {"y": x}
    return found
"""
BLAME = {
    2: (Fault.RAISED, "raised: ValueError: <object object at 0x...> (demo.py:22)"),
    3: (Fault.BAD_FACTS, "bad facts: y must be a finite number, but is nan"),
    4: (Fault.BAD_FACTS, "bad facts: y is missing"),
    5: (Fault.BAD_FACTS, "bad facts: y must be a finite number, but is 'one'"),
    6: (Fault.RAISED, "raised: SystemExit: 0 (demo.py:29)"),
    7: (Fault.HUNG, "hung: no facts within 1.5 s"),
    8: (Fault.HUNG, "hung: no facts within 1.5 s"),
    9: (Fault.HUNG, "hung: no facts within 1.5 s"),
    10: (Fault.DIED, "died: its process ended with exit code 3"),
    11: (Fault.DIED, "died: its process was killed by signal 11 (SIGSEGV)"),
    13: (Fault.BAD_FACTS, "bad facts: must be a mapping from names to values, but are None"),
    14: (Fault.BAD_FACTS, "bad facts: y must be a finite number, but is 1" + "0" * 39),
    15: (Fault.DIED, "died: its process was killed by signal 9 (SIGKILL)"),
}


Hostile = tuple[CampaignStudy, CampaignResults, Path]


def write(folder: Path, code: str, more: str = "", study: str = STUDY) -> Path:
    for name, text in (("demo.py", textwrap.dedent(code)), ("study.yaml", study + more), ("domains.yaml", DOMAINS)):
        (folder / name).write_text(text)
    return folder


def loaded(folder: Path, code: str, more: str = "") -> CampaignStudy:
    found = find(str(write(folder, code, more)))
    assert isinstance(found, CampaignStudy)
    return found


def study_of(simulate: object, fail: str | tuple[Rule, ...] = "y > 1", **more: object) -> CampaignStudy:
    rules = (Rule(fail),) if isinstance(fail, str) else fail
    given: dict[str, object] = {"facts": (Fact("y", "real", "m"),), "fail": rules, "n_cases": 24, **more}
    return CampaignStudy("demo", simulate, INPUTS, **given)  # type: ignore[arg-type]


def run(
    study: CampaignStudy, out: Path, *, workers: int = 2, n: int | None = None, chosen: tuple[str, ...] = (),
    seed: int = 1, **settings: object,
) -> CampaignResults:  # fmt: skip
    given = settings_of(study.parameters, {"workers": workers, **settings})
    done = study.run(Request(given, seed, out, n, chosen), lambda what, k, of: None)
    assert not done.interrupted
    found = study.read(out)
    assert isinstance(found, CampaignResults)
    return found


def shards(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("shard-*"))}


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Hostile:
    folder = tmp_path_factory.mktemp("hostile")
    study = loaded(folder, HOSTILE, "patience: 1.5 s\n")
    return study, run(study, folder / "two", workers=2), folder


class TestStrangers:
    def test_each_crime_costs_its_own_case_and_is_named(self, hostile: Hostile, tmp_path: Path) -> None:
        _, results, _ = hostile
        found = {row["number"]: (Fault(row["error"]), row["reason"].decode()) for row in results.facts if row["error"]}
        assert found == BLAME
        honest = run(loaded(tmp_path, "def simulate(x): return {'y': x}"), tmp_path / "out")
        for row, other in zip(results.facts, honest.facts, strict=True):
            assert row["error"] or row.tobytes() == other.tobytes()
            assert row["error"] == 0 or np.isnan(row["y"])

    def test_every_process_loads_the_file_as_it_was_and_no_exception_hides_its_words(self, tmp_path: Path) -> None:
        code = """
            import os

            class Hidden(Exception):
                __traceback__ = property(lambda self: 1 / 0)

            def simulate(case, x):
                if case.number == 1:
                    open(__file__, "w").write("raise SystemExit")
                if case.number == 2:
                    os._exit(3)
                if case.number == 5:
                    raise Hidden("here")
                return {"y": x}
        """
        facts = run(loaded(tmp_path, code), tmp_path / "out").facts
        assert {row["number"]: row["reason"].decode() for row in facts if row["error"]} == {
            2: "died: its process ended with exit code 3",
            5: "raised: Hidden: here (demo.py:13)",
        }

    def test_the_bytes_do_not_depend_on_the_number_of_workers(self, hostile: Hostile) -> None:
        study, _, folder = hostile
        run(study, folder / "three", workers=3)
        assert shards(folder / "two") == shards(folder / "three") != {}

    def test_an_error_is_a_verdict_with_its_reason(self, hostile: Hostile) -> None:
        cases = hostile[1].cases()
        assert [case.verdict for case in cases].count(Verdict.ERROR) == len(BLAME)
        assert {case.why for case in cases if case.verdict is Verdict.ERROR} == {why for _, why in BLAME.values()}
        assert cases[0].verdict in (Verdict.PASS, Verdict.FAIL)
        assert hostile[1].measures()["errors"].values.sum() == len(BLAME)
        assert np.isnan(hostile[1].measures()["y"].values).sum() == len(BLAME)

    @pytest.mark.parametrize(("number", "slug"), [(10, "replay-lost"), (7, "replay-lost")])
    def test_a_case_that_was_lost_has_no_replay(self, hostile: Hostile, number: int, slug: str) -> None:
        with pytest.raises(BadResults, match=slug):
            hostile[1].replay(str(number))

    def test_a_case_that_raised_raises_again_in_its_replay(self, hostile: Hostile) -> None:
        assert "ValueError" in hostile[1].replay("2").subtitle

    @pytest.mark.parametrize("number", [2, 10, 11])
    def test_judging_one_case_never_runs_it_here(self, hostile: Hostile, number: int) -> None:
        study, _, _ = hostile
        judged = study.judge(study.case(number, 1), settings_of(study.parameters, {}))
        assert (judged.verdict, judged.why) == (Verdict.ERROR, BLAME[number][1])

    def test_nothing_runs_in_the_process_of_the_user(self, tmp_path: Path) -> None:
        study = loaded(tmp_path, "import os\ndef simulate(x): return {'y': os.getpid()}")
        pids = run(study, tmp_path / "out", workers=1).facts["y"]
        assert os.getpid() not in pids

    def test_draws_from_global_random_numbers_depend_on_the_case_only(self, tmp_path: Path) -> None:
        code = "import random, numpy\ndef simulate(x): return {'y': random.random() + numpy.random.rand()}"
        study = loaded(tmp_path, code)
        assert run(study, tmp_path / "a", workers=1).facts.tobytes() == run(study, tmp_path / "b").facts.tobytes()
        assert len(set(run(study, tmp_path / "a").facts["y"])) == 24

    @pytest.mark.parametrize(
        ("code", "slug"),
        [("import nothing_like_this", "target-raised"), ("simulate = 3", "simulate-form"),
         ("def make(): return lambda z: z\nsimulate = make()", "simulate-arguments")],
    )  # fmt: skip
    def test_code_that_no_case_can_run_is_one_complaint(self, tmp_path: Path, code: str, slug: str) -> None:
        study = loaded(tmp_path, f"{code}\nif 1:\n    simulate = globals().get('simulate')")
        with pytest.raises(BadRequest) as caught:
            run(study, tmp_path / "out")
        assert caught.value.slug == slug
        assert (tmp_path / "out" / "run.json").exists(), "a folder says what it holds, however its run ended"

    def test_what_others_registered_for_pickling_exceptions_changes_no_complaint(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(copyreg.dispatch_table, BadRequest, lambda error: (str, (str(error),)))  # as Dask does
        with pytest.raises(BadRequest, match="target-raised"):
            run(loaded(tmp_path, "import nothing_like_this\ndef simulate(x): return x"), tmp_path / "out")


class TestCases:
    def test_a_function_is_given_what_it_asks_for_by_name(self, tmp_path: Path) -> None:
        def simulate(case, seed, rng, x, n, mode, gain, extra=5):  # type: ignore[no-untyped-def]
            assert type(x) is float and type(n) is int and mode in ("slow", "fast") and gain == 2.5 and extra == 5
            assert case["x"] == x and case.number == int(case.id.rpartition("/")[2])
            return {"y": rng.random() + seed}

        own = (Parameter("gain", "real", 1.0, unit="1"),)
        facts = run(study_of(simulate, own=own), tmp_path / "out", gain=2.5).facts
        assert not facts["error"].any(), facts["reason"]
        draws = [np.random.default_rng([1, k]).random() + seed_of(1, k) for k in range(24)]
        assert facts["y"].tolist() == draws

    def test_chosen_cases_are_those_of_the_whole_campaign(self, tmp_path: Path) -> None:
        study = study_of(lambda x, seed: {"y": x + seed})
        whole = run(study, tmp_path / "whole")
        for k, chosen in enumerate((("17", "3"), ("demo/cases/3", "cases/17"))):
            part = run(study, tmp_path / str(k), chosen=chosen)
            assert part.numbers == [3, 17]
            assert part.facts.tobytes() == whole.facts[[3, 17]].tobytes()
            assert [case.id for case in part.cases()] == ["demo/cases/3", "demo/cases/17"]
        with pytest.raises(BadRequest, match="case-unknown"):
            run(study, tmp_path / "none", chosen=("other/3",))

    def test_a_run_that_was_cut_short_is_completed_to_the_same_bytes(self, tmp_path: Path) -> None:
        study = study_of(lambda x: {"y": x})
        run(study, tmp_path)
        whole = shards(tmp_path)
        for name in list(whole)[:2]:
            (tmp_path / name).unlink()
        partial = study.read(tmp_path)
        assert 0 < len(partial.cases()) < partial.planned == 24
        run(study, tmp_path)
        assert shards(tmp_path) == whole

    @pytest.mark.parametrize(
        ("change", "said"),
        [({"n": 48}, "n_cases is 48, but was 24"), ({"seed": 2}, "seed is 2, but was 1"),
         ({"gain": 3.0}, "settings.gain is 3.0, but was 1.0"), ({"chosen": ("1",)}, "n_cases is 1, but was 24")],
    )  # fmt: skip
    def test_a_folder_of_another_question_is_refused(
        self, tmp_path: Path, change: dict[str, object], said: str
    ) -> None:
        study = study_of(lambda x: {"y": x}, own=(Parameter("gain", "real", 1.0),))
        run(study, tmp_path)
        with pytest.raises(BadResults, match=said) as caught:
            run(study, tmp_path, **change)  # type: ignore[arg-type]
        assert caught.value.slug == "results-other"

    def test_the_criterion_says_how_many_cases_if_nobody_does(self, tmp_path: Path) -> None:
        study = study_of(lambda x: {"y": x}, n_cases=None, criterion="all_combinations")
        assert len(run(study, tmp_path / "out").numbers) == len(list(study.suite({}, 1))) == 8

    def test_a_case_with_other_values_is_not_judged(self) -> None:
        study = study_of(lambda x: {"y": x})
        case = study.case(3, 1)
        with pytest.raises(BadSuite, match="foreign-case"):
            study.judge(dataclasses.replace(case, values=(0.5, 1.0, 0.0)), {})


class TestVerdicts:
    def test_the_first_rule_that_holds_gives_the_reason_and_inconclusive_comes_first(self, tmp_path: Path) -> None:
        study = study_of(
            lambda x, n: {"y": x, "k": n, "ok": n % 2 == 0},
            facts=(Fact("y", "real", "m"), Fact("k", "int"), Fact("ok", "bool")),
            fail=(Rule("!ok", "it is odd"), Rule("y > limit && mode == 'fast'")),
            inconclusive=(Rule("k == 0", "nothing to see"),),
            own=(Parameter("limit", "real", 1.0, unit="m"),),
        )
        results = run(study, tmp_path / "out", n=200)
        seen = set()
        for row, values, case in zip(
            results.facts, study.values(results.facts["number"], 1), results.cases(), strict=True
        ):
            mode = study.natural(values)["mode"]
            if row["k"] == 0:
                due = (Verdict.INCONCLUSIVE, "nothing to see (k = 0)")
            elif row["k"] % 2:
                due = (Verdict.FAIL, "it is odd (ok = false)")
            elif row["y"] > 1.0 and mode == "fast":
                why = f"y > limit && mode == 'fast' (limit = 1 m, mode = fast, y = {row['y']:.6g} m)"
                due = (Verdict.FAIL, why)
            else:
                due = (Verdict.PASS, f"nothing that fails it: y = {row['y']:.6g} m, k = {row['k']}, ok = true")
            assert (case.verdict, case.why) == due
            seen.add(due[0])
        assert len(seen) == 3

    def test_a_formula_that_cannot_be_evaluated_is_an_error_of_its_case(self, tmp_path: Path) -> None:
        study = study_of(lambda n: {"y": float(n)}, fail="1 / y > 0.5")
        results = run(study, tmp_path / "out", n=100)
        found = {case.verdict for case, y in zip(results.cases(), results.facts["y"], strict=True) if y == 0.0}
        assert found == {Verdict.ERROR}
        assert Verdict.PASS in {case.verdict for case in results.cases()}

    def test_which_way_is_worse_follows_from_the_formulas_unless_the_author_says_it(self, tmp_path: Path) -> None:
        facts = tuple(Fact(name) for name in "abcde")
        study = study_of(
            lambda x: dict.fromkeys("abcde", x), "a - b > 2 || !(c <= 3) || min(d, 4) < 0 || e == 2", facts=facts,
            worse={"b": "more"},
        )  # fmt: skip
        measures = run(study, tmp_path / "out").measures()
        assert {name: measures[name].worse for name in "abcde"} == {
            "a": "more",
            "b": "more",
            "c": "more",
            "d": "less",
            "e": "",
        }
        assert (measures["failed"].kind, measures["a"].kind) == ("rate", "quantity")

    @pytest.mark.parametrize(
        ("change", "slug"),
        [({"facts": (Fact("x"),)}, "study-double"), ({"facts": (Fact("error"),)}, "study-double"),
         ({"own": (Parameter("seed", "int", 1),)}, "study-double"), ({"facts": (Fact("y", "text"),)}, "study-facts"),
         ({"worse": {"z": "more"}}, "study-facts"), ({"fail": (Rule("y + 1"),)}, "type"),
         ({"fail": (Rule("z > 1"),)}, "unknown-name"), ({"fail": (Rule("y >"),)}, "syntax")],
    )  # fmt: skip
    def test_a_study_that_makes_no_sense_is_refused_when_it_is_made(self, change: dict[str, object], slug: str) -> None:
        with pytest.raises((BadRequest, BadModel)) as caught:
            study_of(lambda x: {"y": x}, **change)  # type: ignore[arg-type]
        assert caught.value.slug == slug


class TestResults:
    def test_a_report_counts_every_case_once(self, tmp_path: Path) -> None:
        study = study_of(lambda x, n: {"y": x} if n else {}, own=(Parameter("limit", "real", 1.0),), fail="y > limit")
        folders = {"a": run(study, tmp_path / "a", n=60), "b": run(study, tmp_path / "b", n=60, limit=1.5)}
        reported = study.report(folders)
        assert [table.title for table in reported.tables] == ["Outcomes", "Measures", "Reasons"]
        for name, results in folders.items():
            document = json.loads(json.dumps(reported.documents[name], allow_nan=False))
            counted = {verdict: of["cases"] for verdict, of in document["verdicts"].items()}
            assert sum(counted.values()) == 60
            assert counted["fail"] == sum(case.verdict is Verdict.FAIL for case in results.cases()) > 0
            assert sum(reason["cases"] for reason in document["reasons"]) == counted["fail"] + counted["error"]
            assert document["measures"]["y"]["cases"] == 60 - counted["error"] < 60
            assert document["measures"]["y"]["mean"] == pytest.approx(np.nanmean(results.facts["y"]))
        assert folders["b"].label.endswith("limit = 1.5")

    def test_a_replay_shows_the_case_with_its_facts_and_trace(self, tmp_path: Path) -> None:
        code = """
            def simulate(x): return {"y": x}
            def trace(x): return [{"time": 0.1 * k, "place": x * k, "phase": "up"} for k in range(1000)]
        """
        results = run(loaded(tmp_path, code, "trace: demo.py:trace\n"), tmp_path / "out")
        page = results.replay("demo/cases/5")
        pieces = {piece.title: piece for piece in page.sections[0].pieces if isinstance(piece, Table | Figure)}
        assert list(pieces) == ["Test inputs and parameters", "Facts", "Over time", "Trace"]
        facts, trace = pieces["Facts"], pieces["Trace"]
        assert isinstance(facts, Table) and isinstance(trace, Table)
        assert facts.rows == (("y", results.facts["y"][5], "m"),)
        assert 100 <= len(trace.rows) <= 200 and trace.rows[1][2] == "up"
        with pytest.raises(BadRequest, match="case-number"):
            results.replay("99")

    @pytest.mark.parametrize(
        "crime", ["raise ValueError('no')", "return 3", "import os; os._exit(1)", "while True: pass"]
    )
    def test_a_trace_that_cannot_be_had_leaves_the_rest_of_the_page(self, tmp_path: Path, crime: str) -> None:
        code = f"def simulate(x): return {{'y': x}}\ndef trace(x):\n    {crime}"
        results = run(loaded(tmp_path, code, "trace: demo.py:trace\npatience: 0.5 s\n"), tmp_path / "out")
        said = results.replay("1").sections[0].pieces[-1]
        assert isinstance(said, Text) and said.body.startswith("There is no trace: ")

    def test_a_replay_that_gives_other_facts_is_refused(self, tmp_path: Path) -> None:
        run(loaded(tmp_path, "def simulate(x): return {'y': x}"), tmp_path / "out")
        changed = loaded(tmp_path, "def simulate(x): return {'y': x + 1}")
        with pytest.raises(BadResults, match=r"y is .*, but was .* \[replay-differs\]"):
            changed.read(tmp_path / "out").replay("1")

    @pytest.mark.parametrize(
        "change", [{"facts": (Fact("y"), Fact("z"))}, {"criterion": "base_choice"}, {"name": "other"},
                   {"own": (Parameter("gain", "int", 1),), "fail": (Rule("y > gain"),)}],
    )  # fmt: skip
    def test_results_of_other_facts_inputs_or_names_are_not_read(
        self, tmp_path: Path, change: dict[str, object]
    ) -> None:
        study = study_of(lambda x: {"y": x}, own=(Parameter("gain", "text", "much"),))
        run(study, tmp_path)
        with pytest.raises(BadResults, match=r"results-(study|parameters)"):
            dataclasses.replace(study, **change).read(tmp_path)  # type: ignore[arg-type]


class TestPrograms:
    PROGRAM = """
        import json, os, sys, time
        for line in sys.stdin:
            case = json.loads(line)["case"]
            k, y = case["number"], case["values"]["x"] * case["parameters"].get("gain", 1)
            print("thinking", file=sys.stderr)
            if k == 3: os._exit(4)
            if k == 5: time.sleep(60)
            if k == 7: print("hello")
            if k == 9: y = "many"
            if k == 11: print('{"facts": {"y": NaN}}', flush=True); continue
            if k == 13: os.kill(os.getpid(), 11)
            print(json.dumps({"facts": {"y": y, "pid": os.getpid()}}), flush=True)
    """

    def program(self, folder: Path, code: str, patience: float = 1.0) -> CampaignStudy:
        (folder / "program.py").write_text(textwrap.dedent(code))
        part = ProgramPart((sys.executable, "-u", "program.py"), folder)
        facts = (Fact("y"), Fact("pid", "int"))
        return study_of(part, facts=facts, patience=patience, own=(Parameter("gain", "real", 1.0),))

    def test_what_it_does_wrong_costs_its_own_case(self, tmp_path: Path) -> None:
        study = self.program(tmp_path, self.PROGRAM)
        results = run(study, tmp_path / "out", gain=2.0, workers=1)
        blame = {row["number"]: row["reason"].decode() for row in results.facts if row["error"]}
        assert blame.pop(3).startswith("died: its program must answer `case`, but ended (exit status 4)")
        assert blame.pop(5).startswith("hung: its program must answer `case` within 1 s, but did not")
        assert blame.pop(13).startswith("died: its program must answer `case`, but ended (killed by SIGSEGV)")
        assert blame.pop(9) == "bad facts: y must be a finite number, but is 'many'"
        assert sorted(blame) == [7, 11] and all(why.startswith("bad facts: ") for why in blame.values())
        sound = results.facts[results.facts["error"] == 0]
        values = [2.0 * study.natural(row)["x"] for row in study.values(sound["number"], 1)]  # type: ignore[operator]
        assert sound["y"].tolist() == values
        assert len(set(sound["pid"])) < len(sound), "it is kept running over cases"

    def test_a_program_that_does_one_case_and_ends_is_started_for_each(self, tmp_path: Path) -> None:
        code = """
            import json, os
            print(json.dumps({"facts": {"y": json.loads(input())["case"]["seed"], "pid": os.getpid()}}))
        """
        results = run(self.program(tmp_path, code, 20.0), tmp_path / "out", n=4)
        assert results.facts["y"].tolist() == [seed_of(1, k) for k in range(4)], results.facts["reason"]

    def test_it_is_named_in_the_file_and_its_words_count(self, tmp_path: Path) -> None:
        write(tmp_path, "")
        (tmp_path / "tool.py").write_text(
            'import json\nwhile True: json.loads(input()); print(\'{"facts": {"y": 1}}\')'
        )
        command = f"[{sys.executable}, -u, tool.py]"
        text = STUDY.replace("demo.py:simulate", f"{{command: {command}}}")
        (tmp_path / "study.yaml").write_text(text)
        study = find(str(tmp_path))
        assert isinstance(study, CampaignStudy)
        assert {"tool.py", "study.yaml", "domains.yaml"} <= set(study.digests)
        assert set(run(study, tmp_path / "out", n=6).facts["y"]) == {1.0}
        (tmp_path / "study.yaml").write_text(text.replace(str(sys.executable), "./absent"))
        with pytest.raises(BadRequest, match="study-program"):
            find(str(tmp_path))


class TestFiles:
    BAD = """\
parcours: study/1
name: demo
kind: campaign
simulate: demo.py:simulat
trace: absent.py:trace
combine: pairwize
parameters:
  x: {default: 1}
facts:
  y: {type: complex}
  ok: bool
  reason: real
fail:
  - y > limit
  - when: y + 1
  - {when: "y >"}
  - {when: ok == 3, why: never}
inconclusive: ok
measures: {z: more, y: worse}
patience: never
"""

    def test_all_that_is_wrong_is_said_at_once_with_its_line(self, tmp_path: Path) -> None:
        write(tmp_path, "def simulate(x): return {}", study=self.BAD)
        study, found = check_study_file(tmp_path / "study.yaml")
        assert study is None
        assert [(one.line, one.rule) for one in found] == [
            (4, "target-missing"), (5, "study-file"), (6, "study-name"), (8, "study-double"), (10, "value"),
            (12, "study-double"), (14, "study-name"), (15, "type"), (16, "syntax"), (17, "type"), (19, "study-name"),
            (19, "value"), (20, "value"),
        ]  # fmt: skip

    @pytest.mark.parametrize("key", ["simulate", "facts", "fail"])
    def test_what_must_be_there_is_asked_for(self, tmp_path: Path, key: str) -> None:
        lines = [line for line in STUDY.splitlines() if not line.startswith(key)]
        write(tmp_path, "def simulate(x): return {}", study="\n".join(lines))
        with pytest.raises(BadRequest, match=f"must have the key '{key}'"):
            find(str(tmp_path))

    def test_without_test_inputs_there_is_no_campaign(self, tmp_path: Path) -> None:
        write(tmp_path, "def simulate(x): return {}")
        (tmp_path / "domains.yaml").unlink()
        with pytest.raises(BadRequest, match="needs test inputs"):
            find(str(tmp_path))

    def test_what_a_function_asks_for_in_vain_is_seen_by_reading(self, tmp_path: Path) -> None:
        write(tmp_path, "def simulate(x, speed, *, mass, k=2): return {}")
        with pytest.raises(BadRequest, match=r"study.yaml:4: simulate is given .* asks for speed, mass"):
            find(str(tmp_path))

    def test_reading_judging_and_reporting_run_no_code_in_this_process(self, tmp_path: Path) -> None:
        mark = tmp_path / "ran"
        code = f"import os\nopen({str(mark)!r}, 'a').write(f'{{os.getpid()}} ')\ndef simulate(x): return {{'y': x}}"
        study = loaded(tmp_path, code)
        assert not mark.exists()
        results = run(study, tmp_path / "out", workers=1)
        study.report({"out": results})
        results.replay("1")
        study.judge(study.case(1, 1), {})
        study.check(lambda what, k, of: None)
        assert str(os.getpid()) not in mark.read_text().split()


class TestBattery:
    def findings(self, study: Study) -> dict[str, str]:
        return {one.rule: one.level for one in study.check(lambda what, k, of: None)}

    def levels(self, found: Mapping[str, str], words: str) -> list[str]:
        return [level for rule, level in found.items() if words in rule]

    def test_a_sound_study_has_no_complaint(self) -> None:
        assert set(self.findings(study_of(lambda x, rng: {"y": x + 0.1 * rng.random()})).values()) == {"note"}

    @pytest.mark.parametrize(
        ("code", "words"),
        [("import time\ndef simulate(x): return {'y': time.time()}", "the same facts each time"),
         ("SEEN = []\ndef simulate(x): SEEN.append(x); return {'y': len(SEEN)}", "depend on those before"),
         ("def simulate(x): return {'y': None}", "20 of 20 cases end in an error: bad facts"),
         ("def simulate(x): return {'y': x / (x > 1)}", "ZeroDivisionError")],
    )  # fmt: skip
    def test_a_planted_fault_is_found(self, tmp_path: Path, code: str, words: str) -> None:
        assert self.levels(self.findings(loaded(tmp_path, code)), words) == ["error"]

    @pytest.mark.parametrize(("fail", "words"), [("y > 9", "never holds"), ("y < 9", "always holds")])
    def test_a_formula_that_tells_nothing_apart_is_a_warning(self, fail: str, words: str) -> None:
        assert self.levels(self.findings(study_of(lambda x: {"y": x}, fail)), words) == ["warning"]

    def test_a_formula_that_divides_by_zero_and_a_bad_trace_are_errors(self) -> None:
        found = self.findings(study_of(lambda x: {"y": x}, "1 / (y - y) > 2", trace=lambda x: 3))
        assert list(found.values()).count("error") == 2


class TestParking:
    def test_the_example_is_sound_and_has_the_weakness_that_it_plants(self, tmp_path: Path) -> None:
        study = find(str(PARKING))
        assert isinstance(study, CampaignStudy)
        assert {one.level for one in study.check(lambda what, k, of: None)} == {"note"}
        results = run(study, tmp_path / "out")
        assert len(results.numbers) == 200
        grounds = [study.natural(values)["ground"] for values in study.values(results.facts["number"], 1)]
        on_ice = [ground == "ice" for ground in grounds]
        hits = results.facts["hit"]
        assert hits[on_ice].mean() > 0.5 and not hits[np.logical_not(on_ice)].any()
        late = run(study, tmp_path / "late", delay=0.5)
        assert late.facts["hit"].sum() > hits.sum(), "a slower sensor hits more often"

    def test_a_car_that_stands_has_used_up_its_speed_and_the_way_between(self, tmp_path: Path) -> None:
        study = find(str(PARKING))
        assert isinstance(study, CampaignStudy)
        for number in range(6):
            trace = study.traced(study.case(number, 1), settings_of(study.parameters, {}))
            assert not isinstance(trace, str)
            times, gaps, speeds = (np.array(column) for column in zip(*trace[1], strict=True))
            assert (np.diff(gaps) <= 0).all() and (np.diff(speeds) <= 0).all()
            assert gaps[0] - gaps[-1] == pytest.approx(np.trapezoid(speeds, times), abs=1e-9)
