"""The command line as a user meets it: help, tables, JSON, and one paragraph for every mistake."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import parcours_here
from parcours.run.store import open_results

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "src/parcours_ramp/components/model.yaml"
OBSTACLES = ROOT / "src/parcours_navigation/cases/model.yaml"
DOMAINS = ROOT / "src/parcours_navigation/cases/domains.yaml"


def parcours(*arguments: object, code: int = 0) -> str:
    """Run the command and return what it printed: standard output, or standard error if it is to be refused."""
    ended, out, complaints = parcours_here(*arguments)
    assert ended == code, complaints
    assert "Traceback" not in complaints
    return complaints if code == 2 else out


def test_neither_loading_a_command_nor_its_end_looks_for_garbage() -> None:
    program = (
        "import atexit, gc, sys\n"
        "looked = []\n"
        "atexit.register(lambda: print('FROZEN', gc.get_freeze_count() > 0, 'LOOKED', looked.count('start')))\n"
        "from parcours.cli import main\n"
        "gc.callbacks.append(lambda phase, info: looked.append(phase))\n"
        "sys.argv = ['parcours', 'run', 'ramp_system', '--help']\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == "FROZEN True LOOKED 0", done.stderr


def test_a_campaign_in_simulated_time_loads_nothing_that_it_does_not_need(tmp_path: Path) -> None:
    program = (
        f"import sys; sys.argv = ['parcours', 'run', 'ramp_system', '--cases', '1', '--out', {str(tmp_path / 'o')!r}]\n"
        "from parcours.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "needless = {'pandas', 'pyarrow.compute', 'urllib.request', 'matplotlib', 'scipy.stats', 'rich.progress',\n"
        "            'parcours.study.components.archive', 'parcours_ramp.system.live_results',\n"
        "            'parcours_ramp.system.component_form', 'parcours_ramp.planner.planner'}\n"
        "print('NEEDLESS', sorted(needless & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "NEEDLESS []" in done.stdout, done.stdout
    assert (tmp_path / "o" / "campaign.json").exists()


def test_help_names_every_stage_and_imports_nothing_heavy() -> None:
    program = (
        "import sys; sys.argv = ['parcours', '--help']\n"
        "from parcours.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'ortools', 'z3', 'matplotlib', 'rich', 'yaml', 'jinja2'}\n"
        "heavy &= set(sys.modules)\n"
        "print('HEAVY', sorted(heavy))"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "HEAVY []" in printed
    for stage in (
        "model",
        "convert",
        "explore",
        "paths",
        "feasible",
        "walk",
        "abtc",
        "data",
        "suite",
        "export",
        "run",
        "demo",
    ):
        assert f"\n  {stage} " in printed


def test_the_papers_gaps_are_warnings_and_leave_the_model_usable() -> None:
    found = json.loads(parcours("model", "check", MODEL, "--json"))
    unread = [finding["message"] for finding in found if finding["rule"] == "unread-channel"]
    assert len(unread) == 2 and "'modification_response'" in unread[0] and "'update'" in unread[1]
    assert {finding["severity"] for finding in found} == {"warning"}


def test_a_broken_model_is_reported_with_its_lines_and_code_2(tmp_path: Path) -> None:
    broken = tmp_path / "broken.yaml"
    text = MODEL.read_text().replace("guard: tcp_socket,", "guard: tcp_sockett,", 1)
    broken.write_text(text.replace("event: odometry(", "event: odometri("))
    code, printed, _ = parcours_here("model", "check", broken)
    assert code == 2 and printed.count(f"{broken}:") > 1 and "error" in printed
    assert "broken.yaml" in parcours("paths", broken, code=2)


def test_pictures_of_the_machines_are_written(tmp_path: Path) -> None:
    printed = parcours("model", "show", OBSTACLES, "--svg", tmp_path / "pictures")
    assert "stopped" in printed
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == [f"Obstacle{i}-motion.svg" for i in (1, 2, 3)]


def test_paths_and_abstract_cases_are_the_papers() -> None:
    covers = json.loads(parcours("paths", MODEL, "--json"))
    paths = {path["name"]: path["transitions"] for cover in covers for path in cover["paths"]}
    assert paths["tp41"] == ["p41", "p42", "p43", "p44", "p45", "p46"]
    assert len(json.loads(parcours("abtc", MODEL, "--json"))) == 67
    assert len(json.loads(parcours("abtc", OBSTACLES, "--json"))) == 9
    assert "-||->" in parcours("abtc", MODEL, "--case", "ITP1-tp12.tp21.tp12-0.0.0")
    assert "no rendezvous" in parcours("abtc", MODEL, "--dropped")


def test_rows_of_each_choice_hit_every_block() -> None:
    drawn = json.loads(parcours("data", "draw", DOMAINS, "--json"))
    assert len(drawn["rows"]) == 3 and drawn["hit"] == drawn["blocks"] == 36


def test_a_suite_is_written_and_reads_back(tmp_path: Path) -> None:
    from parcours.suite import read_suite

    out = tmp_path / "suite.jsonl"
    assert "27 cases" in parcours("suite", "ramp_system", "--out", out)
    cases = list(read_suite(out))
    assert len({case.id for case in cases}) == 27 and len({case.abstract for case in cases}) == 9


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "ramp_sytem", "--out", "x"), "did you mean 'ramp_system'"),
        (("run", "ramp_system", "--cases", "-3", "--out", "x"), "-3"),
        (("run", "ramp_system", "--schedule", "fast", "--out", "x"), "parameter-choice"),
        (("run", "ramp_system", "--protocol", "nobody", "--out", "x"), "parameter-choice"),
        (("run", "ramp_system", "--obstacle-radius", "-1", "--out", "x"), "parameter-range"),
        (("run", "ramp_system", "--robot-radius", "0", "--out", "x"), "radius-range"),
        (("run", "ramp_system", "--added-stop", "-1", "--out", "x"), "parameter-range"),
        (("run", "ramp_system", "--added-stop", "6", "--out", "x"), "latency-range"),
        (("run", "ramp_system", "--workers", "many", "--out", "x"), "parameter-kind"),
        (("run", "ramp_system", "--faults", "Planner: crash at 3 s", "--out", "x"), "option-study"),
        (("run", "ramp_system", "--case", "nobody/7", "--out", "x"), "case-unknown"),
        (("run", "ramp_system", "--case", "3", "--cases", "9", "--out", "x"), "option-study"),
        (("run", "ramp_system", "--fail-if", "stuck", "--out", "x"), "gate-form"),
        (("run", "ramp_system", "--fail-if", "stukk > 1%", "--out", "x"), "did you mean 'stuck'"),
        (("run", "ramp_components", "--fail-if", "stuck > 1%", "--out", "x"), "gate-measure"),
        (("run", "navigation", "--planner", "orca", "--fail-if", "violated(z) > 1%", "--out", "x"), "gate-measure"),
        (("run", "navigation", "--set", "command_delay=1", "--out", "x"), "write --command-delay 1"),
        (("suite", "navigation", "--set", "seed=2", "--out", "x"), "give it as an option of its own, --seed"),
        (("run", "navigation", "--planner", "orca", "--robot-radius", "nan", "--out", "x"), "parameter-kind"),
        (("run", "navigation", "--planner", "orca", "--time-limit", "0", "--out", "x"), "parameter-range"),
        (("run", "navigation", "--planner", "ramp-guarded", "--time-limit", "-1", "--out", "x"), "parameter-range"),
        (("run", "navigation", "--out", "x"), "planner-unknown"),
        (("run", "ramp_system", "--cases", "1", "--out", "/proc/nowhere"), "folder-unwritable"),
        (("demo", "--cases", "1", "--out", "/proc/nowhere"), "folder-unwritable"),
        (("run", "ramp_components", "--protocol", "published", "--out", "x"), "No such option"),
        (("run", "ramp_components", "--percent", "9", "--out", "x"), "parameter-range"),
        (("run", "ramp_components", "--case", "ITP1", "--out", "x"), "case-unknown"),
        (("run", "/nowhere/study.yaml", "--out", "x"), "unreadable-file"),
        (("report", "/nowhere"), "results-manifest"),
        (("replay", "/nowhere", "3"), "results-manifest"),
        (("run", "ramp_system", "--cases", "1", "--junit", "/tmp", "--out", "x"), "is a directory"),
        (("run", "ramp_system", "--cases", "1", "--baseline", "/nowhere", "--out", "x"), "results-manifest"),
        (("model", "check"), "Missing argument"),
        (("nonsense",), "No such command"),
    ],
)
def test_a_mistake_costs_one_paragraph_and_code_2(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    given = [str(tmp_path / "x") if argument == "x" else argument for argument in arguments]
    assert says in parcours(*given, code=2)
    assert list(tmp_path.iterdir()) == []


def test_a_campaign_is_run_judged_resumed_and_replayed(tmp_path: Path) -> None:
    out = tmp_path / "results"
    run = ("run", "ramp_system", "--schedule", "original", "--cases", "9", "--workers", "1", "--out", out, "--json")
    first = parcours(*run, code=1)
    assert json.loads(first)[str(out)]["cases"] == 9
    assert parcours(*run, "--fail-if", "errors > 0") == first
    parcours("report", out, "--html", tmp_path / "r.html", "--junit", tmp_path / "r.xml", code=1)
    assert "<html" in (tmp_path / "r.html").read_text() and 'tests="9"' in (tmp_path / "r.xml").read_text()
    assert 'classname="ramp_system" name="together-' in (tmp_path / "r.xml").read_text()
    assert "ramp_system/" in parcours("replay", out, 4, "--html", tmp_path / "case.html")
    assert "0 .. 8" in parcours("replay", out, 9, "--html", tmp_path / "case.html", code=2)
    shard = next(out.glob("shard-*.parquet"))
    shard.write_bytes(shard.read_bytes()[:-100])
    assert "cut short" in parcours("report", out, code=2)


def test_component_results_are_read_by_a_later_command(tmp_path: Path) -> None:
    out = tmp_path / "components"
    run = ("run", "ramp_components", "--cases", "3", "--repeats", "1", "--out", out)
    told = parcours(*run, "--junit", tmp_path / "first.xml", code=3)  # one repeat is too few to judge a duration
    assert f"all 63 cases are finished in {out}" in told
    assert "ITP6" in parcours("report", out, "--junit", tmp_path / "r.xml", code=3)
    assert 'tests="63"' in (tmp_path / "r.xml").read_text() == (tmp_path / "first.xml").read_text()
    assert 'classname="functional.ramp_components" name="ITP1-' in (tmp_path / "r.xml").read_text()
    (out / "components.json").write_text((out / "components.json").read_text()[:-200])
    assert "results-components" in parcours("report", out, code=2)


def test_a_demo_that_is_refused_leaves_the_report_that_is_there(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    other = ("run", "ramp_system", "--cases", "9", "--workers", "1", "--out", out / "table-vii-original")
    parcours(*other, "--fail-if", "errors > 0")
    (out / "report.html").write_text("a finished report")
    assert "results-other" in parcours("demo", "--cases", "18", "--out", out, code=2)
    assert (out / "report.html").read_text() == "a finished report"


def test_an_unfinished_campaign_says_so_and_misplaced_or_foreign_results_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "results"
    parcours("run", "ramp_system", "--cases", "128", "--workers", "1", "--out", out, code=1)
    first, second = out / "shard-000000.parquet", out / "shard-000001.parquet"
    sum_of_second = Path(f"{second}.sha256")
    kept = second.read_bytes(), sum_of_second.read_bytes()
    sum_of_second.unlink()
    assert "64 of 128, unfinished" in parcours("report", out, code=1)
    second.write_bytes(first.read_bytes())
    sum_of_second.write_text(f"{hashlib.sha256(first.read_bytes()).hexdigest()}  {second.name}\n")
    assert "results-order" in parcours("report", out, code=2)
    second.write_bytes(kept[0])
    sum_of_second.write_bytes(kept[1])
    store = open_results(out)
    changed = store.read(0)
    changed["travelled"] += 0.5
    store.write(0, changed)
    assert "replay-differs" in parcours("replay", out, 3, "--html", tmp_path / "case.html", code=2)
    manifest = out / "campaign.json"
    manifest.write_text(manifest.read_text().replace('"seed": 1,', '"seed": 7,'))
    assert "was changed since" in parcours("report", out, code=2)


def test_the_package_runs_as_the_command_does() -> None:
    done = subprocess.run([sys.executable, "-m", "parcours", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("parcours, version ")
    done = subprocess.run([sys.executable, "-m", "parcours", "nonsense"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "No such command" in done.stderr and "Traceback" not in done.stderr
