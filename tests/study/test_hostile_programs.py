"""Programs that die, hang, flood or talk nonsense: each fails with its reason, and none holds its tester up."""

from __future__ import annotations

import re
import signal
import tempfile
from typing import TYPE_CHECKING

import pytest

from parcours.errors import HostFailure
from parcours.study.components.program import ProgramComponent
from parcours.study.components.systems import ProgramPart

if TYPE_CHECKING:
    from tests.study.conftest import Workshop

PERMITTED = "greet()\nhear('permit')\n"
WAITS = "\nhear('what never comes')"


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("sys.exit(3)", r"must answer `hello`, but ended \(exit status 3\) \[program-ended\]"),
        ("sys.exit(0)", r"must answer `hello`, but ended \(exit status 0\) \[program-ended\]"),
        ("raise ValueError('no bolt')", r"ended \(exit status 1\); its last words: 'ValueError: no bolt'"),
        ("hear('hello'); say(hello={'component': 'Bolt'}); sys.exit(1)", r"`reset`, but ended \(exit status 1\)"),
        (
            PERMITTED + "print('first\\nthe bolt is jammed\\n', file=sys.stderr); os.kill(os.getpid(), signal.SIGSEGV)",
            r"must answer `permit`, but ended \(killed by SIGSEGV\); its last words: 'the bolt is jammed'",
        ),
        (PERMITTED + "os._exit(0)", r"must answer `permit`, but ended \(exit status 0\) \[program-ended\]"),
        (
            PERMITTED + 'os.write(1, b\'{"took": "b\'); os._exit(4)',
            r"ended \(exit status 4\); it had printed part of a line: '{\"took\": \"b' \[program-ended\]",
        ),
        (  # its helper holds the pipe open, which therefore does not end with the program
            PERMITTED + "subprocess.Popen(['sleep', '1000']); os._exit(5)",
            r"must answer `permit`, but ended \(exit status 5\)",
        ),
        (PERMITTED + "os.close(1); time.sleep(0.2); os._exit(7)", r"must answer `permit`, but ended \(exit status 7\)"),
    ],
)
def test_a_program_that_dies_is_reported_with_how_and_its_last_words(workshop: Workshop, source: str, why: str) -> None:
    component = workshop.bolt(source)
    text = workshop.reason(component)
    assert text.startswith("component Bolt: its program ")
    assert re.search(why, text), text
    assert workshop.reason(component) == text  # a program that has failed stays failed


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("print('Hello', flush=True)", "must print JSON, one object per line, but printed 'Hello'; write other output"),
        ("os.write(1, bytes([0, 255, 10]))", r"must print JSON, one object per line, but printed '\\x00\\\\xff'"),
        ("os.write(1, b'\\n')", "must print JSON, one object per line, but printed ''"),
        ("os.write(1, b'[' * 90000 + b'\\n')", r"must print JSON, one object per line, but printed '\[{70,}\.\.\.'"),
        ("print('NaN', flush=True)", "must print JSON, one object per line, but printed 'NaN'"),
        ("say(tok='b1')", 'must answer with `sent` or `took`, but printed \'{"tok": "b1"}\''),
        ("print('[]', flush=True)", r"must answer with `sent` or `took`, but printed '\[\]'"),
        ("say(took='b1', woke=1)", "must answer with `sent` or `took`, but printed"),
        ("say(sent={'channel': 'done', 'message': 1}, took='b1')", "must answer with `sent` or `took`, but printed"),
        ("say(took='k1')", 'a transition that the model gives Bolt, but printed \'{"took": "k1"}\'.*Known: b1, b2'),
        ("say(took='')", "must take a transition that the model gives Bolt"),
        ("say(took=['b1'])", "must take a transition that the model gives Bolt"),
        ("say(sent={'channel': 'done', 'message': 1}); say(took=None)", "must take a transition that the model gives"),
        ("say(sent={'channel': 'done'})", "must send with a channel and a message"),
        ("say(sent={'channel': 1, 'message': 1})", "must send with a channel and a message"),
        ("say(sent=['done', 1])", "must send with a channel and a message"),
        ("say(took='b1', wake='soon')", "must give `wake` in whole nanoseconds"),
        ("say(took='b1', wake=1.5)", "must give `wake` in whole nanoseconds"),
        ("say(took='b1', wake=-1)", "must give `wake` in whole nanoseconds"),
        ("say(took='b1', wake=1e300)", "must give `wake` in whole nanoseconds"),
        ("say(took='b1', wake=True)", "must give `wake` in whole nanoseconds"),
        (
            'os.write(1, b\'{"took": "b1"}\\n\' * 2)',
            'must print nothing after its answer to `permit`, but printed \'{"took"',
        ),
    ],
)
def test_a_program_that_talks_nonsense_is_quoted(workshop: Workshop, answer: str, why: str) -> None:
    text = workshop.reason(workshop.bolt(PERMITTED + answer + WAITS))
    assert re.search(why, text), text
    assert text.endswith("[program-words]")
    assert len(text) < 300


def test_a_program_that_says_more_than_its_answer_fails_at_once_and_not_in_the_next_case(workshop: Workshop) -> None:
    component = workshop.bolt(PERMITTED + 'os.write(1, b\'{"took": "b1"}\\n{"took"\')' + WAITS)
    with pytest.raises(HostFailure, match="must print nothing after its answer to `permit`"):
        next(component.handle("push", "", 0))


@pytest.mark.parametrize(
    ("answers", "why"),
    [
        ("say(hello={'component': 'Key'})", "must say that it is the component Bolt, but printed"),
        ("say(hello='Bolt')", "must say that it is the component Bolt, but printed"),
        ("say(reset=True)", "must answer with `hello`, but printed"),
        ("say(hello={'component': 'Bolt'}); hear('reset'); say(reset=False)", "must answer `reset` with true"),
        ("print('Bolt 1.0', flush=True)", "must print JSON, one object per line, but printed 'Bolt 1.0'"),
    ],
)
def test_a_program_that_greets_in_another_way_is_quoted(workshop: Workshop, answers: str, why: str) -> None:
    assert re.search(why, workshop.reason(workshop.bolt("hear('hello')\n" + answers + WAITS)))


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (
            "[say(sent={'channel': 'done', 'message': 1}) for _ in range(10_001)]",
            "must send at most 10000 messages and 64000000 bytes for one `permit`, but sent more",
        ),
        ("[say(sent={'channel': 'done', 'message': 'x' * 900_000}) for _ in range(99)]", "but sent more"),
        (
            "os.write(1, b'x' * 2_000_000)",
            r"must print lines of at most 1000000 bytes, but printed a longer one: 'x{70,}\.\.\.'",
        ),
        ("say(took='x' * 1_000_000)", r"must print lines of at most 1000000 bytes"),
    ],
)
def test_a_program_that_floods_is_stopped(workshop: Workshop, answer: str, why: str) -> None:
    text = workshop.reason(workshop.bolt(PERMITTED + answer + WAITS))
    assert re.search(why, text), text
    assert text.endswith("[program-flood]")


@pytest.mark.parametrize(
    "source",
    [
        "time.sleep(1000)",
        PERMITTED + "time.sleep(1000)",
        PERMITTED + "os.write(1, b'{'); time.sleep(1000)",
        PERMITTED + "os.close(1); time.sleep(1000)",
        PERMITTED + "while True: os.write(2, b'x' * 65536)",
        PERMITTED + "while True: say(sent={'channel': 'done', 'message': 1}); time.sleep(0.2)",
        "signal.signal(signal.SIGTERM, signal.SIG_IGN); greet(); time.sleep(1000)",
    ],
)
def test_a_program_that_hangs_is_given_up(workshop: Workshop, source: str) -> None:
    # On a busy machine it may be given up before it comes to where it hangs: then at an earlier word.
    text = workshop.reason(workshop.bolt(source, patience=0.5))
    assert re.search(r"its program must answer `\w+` within 0.5 s, but did not.*\[program-silent\]", text), text


def test_a_program_that_never_reads_does_not_hold_its_tester_up(workshop: Workshop) -> None:
    component = workshop.bolt("greet(); time.sleep(1000)", patience=1.0)
    with pytest.raises(HostFailure, match=r"must answer `\w+` within 1 s, but did not"):
        list(component.handle("push", "x" * 3_000_000, 0))


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (("./nothing",), "'./nothing' cannot be executed; build it in"),
        (("no-such-program-anywhere",), "cannot be executed; install it"),
        (("./notes.txt",), "make it executable"),
        (("notes.txt",), r"write \./notes.txt"),
        (("./script",), "cannot be executed in"),
        ((), "'' cannot be executed"),
    ],
)
def test_a_program_that_cannot_be_started_is_refused_at_once(
    workshop: Workshop, command: tuple[str, ...], why: str
) -> None:
    (workshop.folder / "notes.txt").write_text("text")
    (workshop.folder / "script").write_text("#!/no/such/interpreter\n")
    (workshop.folder / "script").chmod(0o755)
    with pytest.raises(HostFailure, match=rf"component Bolt: its program must .*{why}.*\[program-missing\]"):
        ProgramComponent(workshop.lock.component("Bolt"), ProgramPart(command, workshop.folder), {}, "", 0, 60.0)


@pytest.mark.parametrize(
    ("source", "patience", "why"),
    [
        ("time.sleep(1000)", 0.5, "`hello` within 0.5 s, but did not connect to the socket PARCOURS_SOCKET"),
        ("print('no'); sys.exit(2)", 60.0, r"`hello`, but ended \(exit status 2\); its last words: 'no'"),
    ],
)
def test_a_program_that_does_not_come_to_its_socket_is_given_up(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, source: str, patience: float, why: str
) -> None:
    sockets = workshop.folder / "sockets"
    sockets.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(sockets))
    assert re.search(why, workshop.reason(workshop.bolt(source, patience, socket=True)))
    assert not list(sockets.iterdir())


@pytest.mark.parametrize(("kind", "raised"), [(TimeoutError, HostFailure), (KeyboardInterrupt, KeyboardInterrupt)])
def test_an_exception_while_a_program_is_waited_for_ends_it(
    workshop: Workshop, kind: type[BaseException], raised: type[BaseException]
) -> None:
    def ring(number: int, frame: object) -> None:
        raise kind("too late")

    component = workshop.bolt(PERMITTED + "time.sleep(1000)")
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(raised, match="too late"):
            list(component.handle("push", "", 0))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert f"must answer `permit`, but {kind.__name__} came first: too late" in workshop.reason(component)
