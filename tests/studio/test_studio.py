"""The studio over HTTP, as a process of its own: what its page asks for, and what it refuses."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from parcours.model.model_file import check_text
from parcours.run.store import create, open_results
from parcours.study.finding import find
from parcours.verdict.statistics import wilson
from studio_server import Server, events, start

EXAMPLES = Path(__file__).parents[2] / "examples"
SECRET = "the secret of another folder"
HOSTILE = '<img src=x onerror="alert(1)">.yaml'


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Two studies, a run of one of them, and what an attacker may have put beside them."""
    base = tmp_path_factory.mktemp("studio")
    (base / "secret.yaml").write_text(SECRET)
    root = base / "folder"
    shutil.copytree(EXAMPLES / "lift", root / "lift")
    shutil.copytree(EXAMPLES / "parking", root / "parking")
    shutil.copytree(EXAMPLES / "ros2_python", root / "nodes")
    shutil.copytree(EXAMPLES / "ros1_python", root / "ros1_python")
    shutil.copy(EXAMPLES / "ros2_navigation/yard.yaml", root)
    for module in (
        "json",
        "yaml",
        "scipy",
        "click",
        "starlette",
    ):  # looking at a folder must not import what lies there
        (root / f"{module}.py").write_text(f"open({str(base / 'imported')!r}, 'w')\n")
    for study in ("lift/lift.py", "parking/parking.py"):
        with (root / study).open("a") as file:
            file.write(f"\nopen({str(base / 'executed')!r}, 'a').close()\n")
    (root / "link.yaml").symlink_to(base / "secret.yaml")
    (root / "linked").symlink_to(base)
    os.mkfifo(root / "pipe.yaml")
    (root / HOSTILE).write_text("parcours: model/1\nname: '<script>alert(1)</script>'\n")
    (root / os.fsdecode(b"\xff.yaml")).write_text("parcours: model/1\n")
    (root / ".hidden.yaml").write_text(SECRET)
    (root / "plain.txt").write_text(SECRET)
    found = start(root)
    yield found
    found.process.send_signal(signal.SIGTERM)
    assert found.process.wait(10) == 0


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {"Cookie": ""}, 403),
        ("GET", "/?token=wrong", {"Cookie": ""}, 403),
        ("GET", "/api/files", {"Cookie": ""}, 403),
        ("GET", "/studio.js", {"Cookie": ""}, 403),
        ("GET", "/api/files", {"Host": "evil.example"}, 421),
        ("GET", "/api/files", {"Host": ""}, 400),
        ("GET", "/api/files", {"Origin": "http://evil.example"}, 403),
        ("GET", "/api/files", {"Origin": "http://127.0.0.1:1"}, 403),
        ("GET", "/api/files", {"Origin": "", "Sec-Fetch-Site": "same-site"}, 403),
        ("GET", "/", {"Origin": "", "Sec-Fetch-Site": "same-site"}, 403),
        ("GET", "/", {"Origin": "", "Sec-Fetch-Site": "cross-site"}, 403),
        ("POST", "/api/run?path=lift/study.yaml", {"Origin": ""}, 403),
        ("POST", "/api/run?path=lift/study.yaml", {"Origin": "null"}, 403),
        ("PUT", "/api/file?path=lift/study.yaml", {"Origin": "http://localhost:1"}, 403),
        ("OPTIONS", "/api/file", {"Origin": "http://evil.example"}, 403),
        ("GET", "/api/run?path=lift/study.yaml", {}, 405),
    ],
)
def test_requests_that_are_not_of_its_own_page_are_refused(
    server: Server, method: str, path: str, headers: dict[str, str], status: int
) -> None:
    given, answered, content = server.ask(method, path, headers=headers)
    assert given == status
    assert b"lift" not in content
    if status != 400:  # of which the server takes care before us
        assert "script-src 'self'" in answered["Content-Security-Policy"]
        assert "Access-Control-Allow-Origin" not in answered


def test_a_page_runs_nothing_but_the_studios_own_script(server: Server) -> None:
    status, headers, page = server.ask("GET", "/", headers={"Origin": ""})
    assert status == 200 and headers["Content-Security-Policy"].startswith("default-src 'none'")
    assert "unsafe" not in headers["Content-Security-Policy"]
    assert page.count(b"<script") == 1 and b"style=" not in page and b" on" not in page.partition(b"<body>")[2].lower()
    script = server.ask("GET", "/studio.js")[2]
    assert not any(
        word in script for word in (b"innerHTML", b"outerHTML", b"insertAdjacent", b"document.write", b"eval(")
    )
    assert sum(len(server.ask("GET", path)[2]) for path in ("/", "/studio.js", "/studio.css")) < 300_000


@pytest.mark.parametrize(
    "path",
    ["../secret.yaml", "lift/../../secret.yaml", "/etc/passwd", "//etc/hostname", "link.yaml", "linked/secret.yaml",
     "linked", "pipe.yaml", ".hidden.yaml", "plain.txt", "lift/lift.py", "lift", "lift/model.yaml/", "a\0.yaml", "",
     "x" * 5000 + ".yaml", "\\..\\secret.yaml", "%2e%2e/secret.yaml"],
)  # fmt: skip
def test_no_file_outside_the_folder_is_given_out(server: Server, path: str) -> None:
    for method, name in (("GET", "file"), ("PUT", "file"), ("POST", "check"), ("POST", "cases"), ("POST", "step")):
        status, _, content = server.ask(method, f"/api/{name}", b"", path=path, version="", case="x")
        assert status in (400, 404) and SECRET.encode() not in content and b"root:" not in content
    assert server.refused("POST", "compare", before=path, now="linked")
    status, _, content = server.ask("GET", "/api/watch", run=path)
    assert status in (400, 404) or content.startswith(b"event: refused")


def test_what_a_study_names_must_lie_in_the_folder(server: Server) -> None:
    text = (server.root / "lift/study.yaml").read_text()
    binding = (server.root / "nodes/binding.yaml").read_text()
    world = (server.root / "yard.yaml").read_text()
    (server.root / "lift/between.yaml").write_text("image: ../../secret.yaml\n")
    for file in ("../../secret.yaml", "/etc/passwd", "../link.yaml", "../lift/between.yaml"):
        for path, changed in (
            ("lift/study.yaml", text.replace("model: model.yaml", f"model: {file}")),
            ("nodes/binding.yaml", binding.replace("model: ../ros1_python/model.yaml", f"model: {file}")),
            ("nodes/binding.yaml", world.replace("  map: 10 cm", f"  map: {file}")),
        ):
            found = server.api("POST", "check", changed, path=path)
            assert [one["rule"] for one in found["findings"]] == ["studio-outside"] and SECRET not in str(found)


def test_too_much_is_refused_whether_or_not_its_length_is_said(server: Server) -> None:
    assert server.ask("POST", "/api/check", b"x" * 1_200_000, path="lift/model.yaml")[0] == 413
    chunk = b"%x\r\n%s\r\n" % (100_000, b"x" * 100_000)
    with socket.create_connection(("127.0.0.1", server.port), timeout=30) as connection:
        head = ("POST /api/check?path=lift/model.yaml HTTP/1.1", f"Host: 127.0.0.1:{server.port}", "", "")
        sent = (f"Cookie: {server.cookie}", f"Origin: http://127.0.0.1:{server.port}", "Transfer-Encoding: chunked")
        connection.sendall("\r\n".join((*head[:2], *sent, *head[2:])).encode())
        with contextlib.suppress(ConnectionError):
            for _ in range(20):
                connection.sendall(chunk)
        assert connection.recv(100).startswith(b"HTTP/1.1 413")


def test_hostile_names_are_text(server: Server) -> None:
    listed = {one["path"]: one["kind"] for one in server.api("GET", "files")["files"]}
    assert listed[HOSTILE] == "model" and listed["lift/study.yaml"] == "study"
    assert not [path for path in listed if "ff" in path or "link" in path or "pipe" in path or "hidden" in path]
    text = (server.root / "lift/model.yaml").read_text()
    changed = text.replace("dark", "'<script>x</script>'").replace("p1:", "'<b onload=x>':")
    found = server.api("POST", "check", changed, path=HOSTILE)
    assert len(found["drawings"]) == 3
    assert not any(word in one["svg"] for one in found["drawings"] for word in ("<script", "<b ", "style="))


def test_findings_are_those_of_the_commands(server: Server) -> None:
    text = (server.root / "lift/model.yaml").read_text()
    for changed in (text, text.replace("initial:", "initiall:"), text.replace("to: lit", "to: litt"), text + "{"):
        found = server.api("POST", "check", changed, path="lift/model.yaml")
        expected = check_text(changed, "lift/model.yaml")
        assert found["findings"] == [dataclasses.asdict(one) for one in expected.findings]
        assert len(found["drawings"]) == (0 if expected.model is None else 3)
    study = (server.root / "lift/study.yaml").read_text().replace("model:", "modell:")
    [first, *_] = server.api("POST", "check", study, path="lift/study.yaml")["findings"]
    assert (first["rule"], first["line"], first["file"]) == ("unknown-key", 5, "lift/study.yaml")
    [data] = server.api("POST", "check", "parcours: data/1\n", path="lift/domains.yaml")["findings"]
    assert data["severity"] == "error"


def test_bindings_and_worlds_are_checked_and_drawn_as_they_are_edited(server: Server) -> None:
    text = (server.root / "nodes/binding.yaml").read_text()
    found = server.api("POST", "check", text, path="nodes/binding.yaml")
    assert found["findings"] == [] and "Planner" in {one["component"] for one in found["drawings"]}
    changed = text.replace("channels:", "chanels:")
    wrong = server.api("POST", "check", changed, path="nodes/binding.yaml")["findings"]
    assert {(one["file"], one["rule"]) for one in wrong} >= {("nodes/binding.yaml", "unknown-key")}

    world = (server.root / "yard.yaml").read_text()
    found = server.api("POST", "check", world, path="yard.yaml")
    assert found["findings"] == [] and [one["title"] for one in found["drawings"]] == ["world yard, case 0"]
    twice = world.replace("radius: 20 cm", "radius: -1").replace("tolerance: 0.25 m", "tolerance: 3 kg")
    said = server.api("POST", "check", twice, path="yard.yaml")
    lines = twice.splitlines()
    places = {(one["file"], lines[one["line"] - 1].partition(":")[0]) for one in said["findings"]}
    assert places == {("yard.yaml", "robot"), ("yard.yaml", "task")} and said["drawings"] == []


def test_a_file_is_saved_unless_it_changed_meanwhile(server: Server) -> None:
    path = server.root / "notes.yaml"
    path.write_bytes(b"a: 1\r\nb: 2\r\n")
    opened = server.api("GET", "file", path="notes.yaml")
    assert opened["text"] == "a: 1\r\nb: 2\r\n"
    first = server.api("PUT", "file", "a: 3\nb: ü\n", path="notes.yaml", version=opened["version"])
    assert path.read_bytes() == "a: 3\r\nb: ü\r\n".encode()
    assert server.refused("PUT", "file", "a: 4\n", path="notes.yaml", version=opened["version"]) == "studio-changed"
    path.write_bytes(b"someone else's\n")
    assert server.refused("PUT", "file", "a: 5\n", path="notes.yaml", version=first["version"]) == "studio-changed"
    assert path.read_bytes() == b"someone else's\n"
    assert server.refused("PUT", "file", "new", path="new.yaml", version="") == "studio-file"
    assert [one.name for one in server.root.glob(".*partial")] == []


def test_paths_and_abstract_cases_are_those_of_the_commands(server: Server) -> None:
    [panel, *_] = server.api("POST", "paths", path="lift/model.yaml", criterion="prime")
    assert panel["component"] == "Panel" and panel["paths"][0]["transitions"] == ["p1", "p2", "p1", "p2"]
    assert server.refused("POST", "paths", path="lift/model.yaml", criterion="--help") == "studio-refused"
    cases = [one["id"] for one in server.api("POST", "cases", path="lift/model.yaml")]
    assert cases[0] == "ITP1-tp21.tp11.tp21-0.0.0" and len(cases) == 4


def test_a_case_of_a_model_is_stepped_through_in_the_order_that_it_demands(server: Server) -> None:
    found = server.api("POST", "step", path="lift/model.yaml", case="ITP1-tp21.tp11.tp21-0.0.0")
    assert found["verdict"] == "" and len(found["events"]) == 10
    known = {name for one in found["drawings"] for name in one["transitions"]}
    assert {one["transition"] for one in found["events"]} <= known
    assert server.refused("POST", "step", path="lift/model.yaml", case="none") == "unknown-abstract"


def test_looking_at_a_folder_runs_none_of_its_code(server: Server) -> None:
    run = server.root / "foreign"
    run.mkdir()
    head = {"parcours": "run/1", "study": "x", "where": f"{server.root}/lift/lift.py:STUDY", "question": {"seed": 1}}
    for where in (
        f"{server.root}/lift/lift.py:STUDY",
        "lift.lift:STUDY",
        "../secret.yaml",
        "/etc/passwd",
        "linked/secret.yaml",
    ):
        (run / "run.json").write_text(json.dumps(head | {"where": where}))
        status, _, content = server.ask("GET", "/api/watch", run="foreign")
        assert status == 200 and b"event: refused" in content
        assert (b"studio-code" if "lift.py:" in where else b"studio-study") in content
    for path in ("lift/study.yaml", "parking/study.yaml"):
        assert server.api("POST", "check", (server.root / path).read_text(), path=path)["findings"] == []
    assert server.api("POST", "cases", path="lift/study.yaml")
    assert not (server.root.parent / "imported").exists() and not (server.root.parent / "executed").exists()


@pytest.fixture(scope="module")
def run(server: Server) -> str:
    """A run that the studio has started, finished."""
    started = str(server.api("POST", "run", path="parking/study.yaml", cases="60")["run"])
    *_, last = events(server, started, until=60)
    assert last["run"] == started
    return started


def test_a_run_is_watched_and_compared(server: Server, run: str) -> None:
    last = next(events(server, run))
    results = find(str(server.root / "parking/study.yaml")).read(server.root / run)
    failed = [one for one in results.cases() if str(one.verdict) == "fail"]
    counts = {one["verdict"]: one for one in last["verdicts"]}
    assert last["finished"] == last["planned"] == 60 and counts["fail"]["cases"] == len(failed)
    narrow = wilson(len(failed), 60)  # an interval that holds at all times is wider than one that holds once
    assert counts["fail"]["low"] < narrow.low and narrow.high < counts["fail"]["high"]
    assert len(last["latest"]) == min(20, len(failed))
    assert {one["id"]: one["why"] for one in last["latest"]}.items() <= {one.id: one.why for one in failed}.items()
    compared = server.api("POST", "compare", before=run, now=run)
    assert compared["shared"] == 60 and not any(row["worse"] for row in compared["rows"])
    assert (server.root.parent / "executed").exists() and not (server.root.parent / "imported").exists()


def test_a_study_in_python_is_run_and_read_by_processes_of_their_own(server: Server) -> None:
    (server.root / "own.py").write_text(
        "import os\nfrom dataclasses import replace\nfrom parcours.study.finding import find\n"
        "open('read by', 'a').write(f'{os.getpid()}\\n')\nSTUDY = replace(find('parking'), where='')\n"
    )
    started = str(server.api("POST", "run", path="own.py:STUDY", cases="8", settings="delay=0.2")["run"])
    assert b"studio-code" in server.ask("GET", "/api/watch", run=started)[2]  # and ends
    counts = next(one for one in events(server, started, until=8, code="1") if one["finished"] == 8)
    assert counts["planned"] == 8
    assert server.process.pid not in map(int, (server.root / "read by").read_text().split())
    for settings in ("out=/tmp/elsewhere", "delay", "--delay=1", "junit=/tmp/x"):
        assert server.refused("POST", "run", path="own.py:STUDY", settings=settings) == "studio-setting"
    assert server.refused("POST", "run", path="../own.py:STUDY") == "studio-file"
    assert server.refused("POST", "run", path="json:STUDY") == "studio-file"


def test_a_case_of_a_study_is_executed_and_stepped_through(server: Server) -> None:
    found = server.api("POST", "step", path="lift/study.yaml", case="ITP1-tp21.tp11.tp21-0.0.0")
    assert found["verdict"] == "pass" and sum(one["kind"] == "take" for one in found["events"]) == 10
    assert next(one["text"] for one in found["events"] if one["kind"] == "take") == "floor = 0, target = 1"
    assert server.refused("POST", "step", path="parking/study.yaml", case="x") == "studio-step"


def test_each_new_shard_comes_as_an_event_and_only_it_is_read(server: Server, run: str) -> None:
    whole = server.root / run
    store = open_results(whole)
    growing = create(server.root / "growing", store.campaign)
    shutil.copy(whole / "run.json", server.root / "growing")
    stream = events(server, "growing")
    assert next(stream)["finished"] == 0
    done = 0
    for shard in store.shards:
        growing.write(shard, store.read(shard))
        done += len(store.campaign.cases(shard))
        if shard:  # what was read is not needed again
            growing.path(shard - 1).unlink()
        found = next(stream)
        assert (found["finished"], found["planned"]) == (done, 60)
    stream.close()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGHUP])
def test_signals_end_it_with_its_runs_and_streams(tmp_path: Path, how: signal.Signals) -> None:
    shutil.copytree(EXAMPLES / "parking", tmp_path / "parking")
    (tmp_path / "parking/parking.py").write_text(
        "import os, time\ndef simulate(case):\n    open('pid', 'w').write(str(os.getpid())); time.sleep(60)\n"
        "def trace(case):\n    pass\n"
    )
    server = start(tmp_path)
    try:
        run = server.api("POST", "run", path="parking/study.yaml", cases="2")["run"]
        stream = events(server, run)
        next(stream)
        assert server.api("GET", "state", run=run)["running"]
        assert server.refused("POST", "run", path="parking/study.yaml") == "studio-running"
    finally:
        server.process.send_signal(how)
    assert server.process.wait(20) == 0
    assert list(stream) == []
    ours = [path for path in Path("/proc").glob("[0-9]*/cmdline") if str(tmp_path).encode() in _read(path)]
    assert ours == []


def _read(path: Path) -> bytes:
    with contextlib.suppress(OSError):
        return path.read_bytes()
    return b""


def test_a_port_in_use_is_an_error_that_says_so(server: Server) -> None:
    command = [sys.executable, "-m", "parcours", "studio", str(server.root), "--no-open", "--port", str(server.port)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "Address already in use" in done.stderr and "[studio-port]" in done.stderr


def test_once_a_study_is_loaded_the_first_look_at_a_run_loads_nothing(server: Server, run: str) -> None:
    code = (
        "import sys; from pathlib import Path; from parcours.studio.folder import Folder;"
        "from parcours.studio.watching import Watched; folder = Folder(Path(sys.argv[1]));"
        "Watched(folder, sys.argv[2]).load(); loaded = set(sys.modules);"
        "known = Watched(folder, sys.argv[2]).news(); assert known['finished'], known;"
        "print([one for one in sys.modules if one not in loaded and not one.startswith('encodings.')])"
    )
    said = subprocess.run(
        [sys.executable, "-P", "-c", code, str(server.root), run], capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == "[]", said.stdout
