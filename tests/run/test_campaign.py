"""Campaigns: the same bytes however computed; killed, cut short, tampered with, or asked for nonsense."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest, BadResults, HostFailure
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign, Rows, create, open_results

DTYPE = np.dtype([("case", "i8"), ("value", "f8"), ("flags", "i1", (3,))], align=True)

STUDY = """
import os, signal, time
from pathlib import Path
import numpy as np
DTYPE = np.dtype([("case", "i8"), ("value", "f8"), ("flags", "i1", (3,))], align=True)

def simulate(first, count):
    rows = np.empty(count, DTYPE)
    for k in range(count):
        value = np.random.default_rng([7, first + k]).random()
        rows[k] = (first + k, value, (k % 2, 1, (first + k) % 5))
    return rows

def slowly(first, count):
    time.sleep(0.05)
    return simulate(first, count)

def dies_once(first, count):
    mark = Path(os.environ["TOY_MARK"])
    if first == 20 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return simulate(first, count)

def dies_always(first, count):
    if first == 20:
        os.kill(os.getpid(), signal.SIGKILL)
    return simulate(first, count)

def raises(first, count):
    if first == 20:
        raise ArithmeticError("case 23 is odd")
    return simulate(first, count)
"""


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "code"
    folder.mkdir()
    (folder / "toy_campaign_study.py").write_text(STUDY)
    monkeypatch.syspath_prepend(str(folder))
    return folder


def campaign(n_cases: int = 95, shard_size: int = 10, seed: int = 7) -> Campaign:
    return Campaign("toy", "original", seed, n_cases, DTYPE, {"latency": 0.25, "modes": ["a"]}, shard_size)


def simulate(first: int, count: int) -> Rows:
    rows = np.zeros(count, DTYPE)
    rows["case"] = np.arange(first, first + count)
    rows["value"] = np.sqrt(rows["case"])
    return rows


def contents(folder: Path) -> dict[str, bytes]:
    # A worker that outlives its killed parent may still be writing the shard it was on.
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir()) if not file.name.startswith(".")}


def test_one_and_two_workers_give_the_same_bytes(study: Path, tmp_path: Path) -> None:
    for workers in (1, 2):
        outcome = run_campaign("toy_campaign_study:simulate", campaign(), tmp_path / str(workers), workers=workers)
        assert outcome.finished == 95 and not outcome.interrupted
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    assert open_results(tmp_path / "1").load()["case"].tolist() == list(range(95))


def test_a_campaign_killed_in_the_middle_resumes_to_the_bytes_of_an_uninterrupted_one(
    study: Path, tmp_path: Path
) -> None:
    script = tmp_path / "go.py"
    script.write_text(
        "import sys\nfrom pathlib import Path\nimport toy_campaign_study as toy\n"
        "from parcours.run.campaign import run_campaign\nfrom parcours.run.store import Campaign\n"
        "if __name__ == '__main__':\n"
        "    c = Campaign('toy', 'original', 7, 95, toy.DTYPE, {'latency': 0.25, 'modes': ['a']}, 10)\n"
        "    run_campaign('toy_campaign_study:slowly', c, Path(sys.argv[1]), workers=int(sys.argv[2]))\n"
    )
    whole = tmp_path / "whole"
    run_campaign("toy_campaign_study:simulate", campaign(), whole)
    for workers in ("1", "2"):
        folder, told = tmp_path / f"killed-{workers}", Mock()
        environment = os.environ | {"PYTHONPATH": str(study)}
        process = subprocess.Popen([sys.executable, str(script), str(folder), workers], env=environment)
        deadline = time.monotonic() + 60
        while len(list(folder.glob("*.sha256"))) < 3 and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        missing = open_results(folder).missing()
        assert missing, "the campaign was over before it could be killed"
        (folder / ".shard-000009.parquet.partial").touch()  # no name of ours: must not disturb
        with pytest.raises(BadResults, match="results-unfinished"):
            open_results(folder).load()
        run_campaign("toy_campaign_study:simulate", campaign(), folder, progress=told)
        assert told.call_args_list[0].args[0] > 0 and told.call_args.args == (95, 95)
        assert contents(folder) == contents(whole)


def unshared(script: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True, check=False)


MOUNTED = pytest.mark.skipif(
    not shutil.which("unshare") or unshared("mount -t tmpfs t /mnt").returncode != 0,
    reason="a file system of one's own cannot be mounted here",
)


@pytest.mark.parametrize(
    ("limit", "says"),
    [
        pytest.param("size=32k", "No space left", marks=MOUNTED),
        pytest.param("size=1m,ro", "Read-only", marks=MOUNTED),
        ("", "No such"),
    ],
)
def test_a_full_disk_a_read_only_one_and_a_removed_folder_end_a_run_with_the_reason(
    tmp_path: Path, limit: str, says: str
) -> None:
    script, folder = tmp_path / "go.py", tmp_path / "disk" / "c"
    folder.mkdir(parents=True)
    removes = f"\n    if first == 50: shutil.rmtree({str(folder)!r})" if not limit else ""
    script.write_text(
        "import shutil, numpy as np\nfrom pathlib import Path\n"
        "from parcours.run.campaign import run_campaign\nfrom parcours.run.store import Campaign\n"
        "D = np.dtype([('x', 'f8', (100,))])\n"
        f"def noise(first, count):{removes}\n"
        "    return np.frombuffer(np.random.default_rng(first).bytes(count * D.itemsize), D)\n"
        f"run_campaign(noise, Campaign('toy', 'plain', 7, 950, D, shard_size=10), Path({str(folder)!r}))\n"
    )
    mount = f"mount -t tmpfs -o {limit} t {folder.parent} && " if limit else ""
    words = ["unshare", "-rm"] if limit else []
    command = [*words, "sh", "-c", f"{mount}{sys.executable} {script}; ls -A {folder} 2>/dev/null"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert f": {says}" in done.stderr and "[folder-unwritable]" in done.stderr.splitlines()[-1]
    assert "partial" not in done.stdout
    assert (done.stdout.count(".sha256") > 1) == (says == "No space")  # what was finished is kept


def test_a_real_ctrl_c_ends_the_process_in_order_and_leaves_nothing_half_written(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "go.py"
    script.write_text(
        "import signal, sys\nfrom pathlib import Path\nimport toy_campaign_study as toy\n"
        "from parcours.run.campaign import run_campaign\nfrom parcours.run.store import Campaign\n"
        "if __name__ == '__main__':\n"
        "    signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a background shell ignores it
        "    c = Campaign('toy', 'original', 7, 9500, toy.DTYPE, shard_size=10)\n"
        "    print(run_campaign('toy_campaign_study:slowly', c, Path(sys.argv[1]), workers=2))\n"
    )
    folder = tmp_path / "c"
    environment = os.environ | {"PYTHONPATH": str(study)}
    process = subprocess.Popen(
        [sys.executable, str(script), str(folder)],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while len(list(folder.glob("*.sha256"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0 and not err
    finished = len(open_results(folder).load(partial=True))
    assert 30 <= finished < 9500 and out.startswith(f"interrupted: {finished} of 9500 cases")
    assert not list(folder.glob(".*"))


def test_ctrl_c_keeps_what_is_finished_and_says_so(study: Path, tmp_path: Path) -> None:
    for workers in (1, 2):
        folder = tmp_path / str(workers)

        def interrupt(done: int, total: int) -> None:
            if done >= 30:
                raise KeyboardInterrupt

        outcome = run_campaign("toy_campaign_study:simulate", campaign(), folder, workers=workers, progress=interrupt)
        assert outcome.interrupted and 30 <= outcome.finished < 95
        assert str(outcome).startswith(f"interrupted: {outcome.finished} of 95 cases are finished and kept")
        assert len(open_results(folder).load(partial=True)) == outcome.finished
        again = run_campaign("toy_campaign_study:simulate", campaign(), folder)
        assert again.finished == 95
    assert contents(tmp_path / "1") == contents(tmp_path / "2")


def test_a_killed_worker_costs_one_attempt_at_its_shard(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOY_MARK", str(tmp_path / "mark"))
    outcome = run_campaign("toy_campaign_study:dies_once", campaign(), tmp_path / "once", workers=2)
    assert outcome.finished == 95 and (tmp_path / "mark").exists()
    with pytest.raises(HostFailure, match=r"shard 2 \(cases 20..29\).*killed by signal 9.*\[worker-died\]"):
        run_campaign("toy_campaign_study:dies_always", campaign(), tmp_path / "always", workers=2)
    assert 2 in open_results(tmp_path / "always").missing()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_study_that_raises_is_named_with_its_cases_and_keeps_the_other_shards(
    study: Path, tmp_path: Path, workers: int
) -> None:
    with pytest.raises(HostFailure, match=r"cases 20..29.*ArithmeticError: case 23 is odd.*\[shard-raised\]"):
        run_campaign("toy_campaign_study:raises", campaign(), tmp_path / "r", workers=workers)
    assert set(open_results(tmp_path / "r").missing()) <= set(range(2, 10))


def test_padding_and_byte_order_never_reach_the_file(tmp_path: Path) -> None:
    def swapped(first: int, count: int) -> Rows:
        noise = np.frombuffer(os.urandom(count * DTYPE.itemsize), DTYPE).copy()
        plain = simulate(first, count)
        for name in DTYPE.names or ():
            noise[name] = plain[name]
        return noise.astype(DTYPE.newbyteorder(">"))

    run_campaign(simulate, campaign(), tmp_path / "a")
    run_campaign(swapped, campaign(), tmp_path / "b")
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


@given(n_cases=st.integers(1, 60), shard_size=st.integers(1, 70))
@settings(max_examples=25, deadline=None)
def test_shards_partition_the_cases(n_cases: int, shard_size: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    asked = campaign(n_cases, shard_size)
    assert [case for shard in asked.shards for case in asked.cases(shard)] == list(range(n_cases))
    folder = tmp_path_factory.mktemp("c")
    run_campaign(simulate, asked, folder)
    store = open_results(folder)
    assert store.campaign == asked
    assert store.load()["value"].tolist() == np.sqrt(np.arange(n_cases)).tolist()


def damage(path: Path, how: str) -> None:
    content = path.read_bytes()
    match how:
        case "cut":
            path.write_bytes(content[:-5])
        case "empty":
            path.write_bytes(b"")
        case "flip":
            path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))


@pytest.mark.parametrize("how", ["cut", "empty", "flip", "swap"])
def test_a_damaged_shard_is_refused_by_name_and_the_same_command_heals_it(tmp_path: Path, how: str) -> None:
    folder = tmp_path / "c"
    store = run_campaign(simulate, campaign(), folder).store
    whole = contents(folder)
    if how == "swap":
        for suffix in ("", ".sha256"):
            one, other = (folder / f"{store.path(shard).name}{suffix}" for shard in (3, 5))
            one.rename(folder / "aside")
            other.rename(one)
            (folder / "aside").rename(other)
    else:
        damage(store.path(3), how)
    with pytest.raises(BadResults, match=r"shard-000003.parquet.*SHA-256.*again.*\[shard-damaged\]"):
        open_results(folder).load()
    again = run_campaign(simulate, campaign(), folder)
    assert again.repaired == ((3, 5) if how == "swap" else (3,)) and "computed again: shard-000003.parquet" in str(
        again
    )
    assert contents(folder) == whole


def test_a_shard_whose_sum_fits_but_whose_content_does_not_is_refused(tmp_path: Path) -> None:
    store = run_campaign(simulate, campaign(), tmp_path / "c").store
    for suffix in ("", ".sha256"):
        target = store.path(9).with_name(store.path(9).name + suffix)
        target.write_bytes(store.path(0).with_name(store.path(0).name + suffix).read_bytes())
    store.path(9).with_name(store.path(9).name + ".sha256").write_text(
        f"{hashlib.sha256(store.path(9).read_bytes()).hexdigest()}  {store.path(9).name}\n"
    )
    with pytest.raises(BadResults, match=r"must hold 5 records.*\[shard-damaged\]"):
        store.load()


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (campaign(seed=8), "seed is 8, but was 7"),
        (campaign(n_cases=96), "n_cases is 96, but was 95"),
        (
            Campaign("toy", "guarded", 7, 95, DTYPE, {"latency": 0.25, "modes": ["a"]}, 10),
            'schedule is "guarded", but was "original"',
        ),
        (Campaign("toy", "original", 7, 95, DTYPE, {"latency": 0.5, "modes": ["a"]}, 10), "parameters"),
    ],
)
def test_a_folder_with_another_campaign_is_refused(tmp_path: Path, other: Campaign, says: str) -> None:
    create(tmp_path / "c", campaign())
    with pytest.raises(BadResults, match=rf"{says}.*\[results-other\]"):
        create(tmp_path / "c", other)


@pytest.mark.parametrize(
    ("change", "slug"),
    [
        ({"parcours": "campaign/3"}, "results-version"),
        ({"n_cases": -1}, "results-manifest"),
        ({"n_cases": 10**15}, "results-manifest"),
        ({"dtype": [["a", "|O"]]}, "results-manifest"),
        ({"dtype": "f8"}, "results-manifest"),
        ({"dtype": [["a", "__import__('os')"]]}, "results-manifest"),
        ({"study": 3}, "results-manifest"),
        ({"parameters": 3}, "results-manifest"),
        (None, "results-manifest"),
    ],
)
def test_a_manifest_that_is_not_ours_is_refused(tmp_path: Path, change: dict[str, object] | None, slug: str) -> None:
    create(tmp_path / "c", campaign())
    path = tmp_path / "c" / "campaign.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change) if change else path.read_text()[:-20])
    with pytest.raises(BadResults, match=rf"\[{slug}\]"):
        open_results(tmp_path / "c")


def test_units_are_kept_and_decide_nothing(tmp_path: Path) -> None:
    said = dataclasses.replace(campaign(), units={"x": "m"})
    assert create(tmp_path / "said", said).campaign.units == said.units
    assert open_results(tmp_path / "said").campaign == said
    create(tmp_path / "former", campaign())  # by a version that kept none
    assert create(tmp_path / "former", said).campaign == campaign()
    assert create(tmp_path / "said", campaign()).campaign == said


def test_a_folder_without_a_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadResults, match="results-manifest"):
        open_results(tmp_path / "nothing")
    folder = tmp_path / "c"
    run_campaign(simulate, campaign(), folder)
    (folder / "campaign.json").unlink()
    with pytest.raises(BadResults, match="results-manifest"):
        create(folder, campaign())


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    worked: list[int] = []

    def never(first: int, count: int) -> Rows:
        worked.append(first)
        return simulate(first, count)

    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(BadRequest, match="folder-unwritable"):
            run_campaign(never, campaign(), folder)
    assert not worked


@pytest.mark.parametrize("wrong", [{"n_cases": -1}, {"n_cases": 0}, {"seed": -1}, {"shard_size": 0}])
def test_counts_out_of_range_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(BadRequest, match="count-range"):
        campaign(**wrong)


def test_requests_that_cannot_be_run_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="count-range"):
        run_campaign(simulate, campaign(), tmp_path / "a", workers=-2)
    for name in ("no_such_module:f", "json:no_such", "json", ":"):
        with pytest.raises(BadRequest, match="simulate-name"):
            run_campaign(name, campaign(), tmp_path / "b")
    with pytest.raises(BadRequest, match="not-picklable"):
        run_campaign(lambda first, count: simulate(first, count), campaign(), tmp_path / "c", workers=2)
    with pytest.raises(BadRequest, match="results-dtype"):
        Campaign("toy", "x", 1, 1, np.dtype("f8"))  # type: ignore[arg-type]
    with pytest.raises(BadRequest, match="results-parameters"):
        Campaign("toy", "x", 1, 1, DTYPE, {"a": float("nan")})
    with pytest.raises(HostFailure, match=r"cases 0..9.*\[shard-shape\]"):
        run_campaign(lambda first, count: simulate(first, count)[1:], campaign(), tmp_path / "d")
