"""Components that are programs in any language, which speak the component protocol (docs/programs.md).

One JSON object per line, on the program's standard streams or on a Unix socket. It speaks only when asked:

    tester                              program
      | hello -------------------------->|
      |<--------------------------- hello|
      | reset -------------------------->|
      |<--------------------------- reset|
      | inputs ------------------------->|
      | deliver, ask or time ----------->|  work begins
      | permit ------------------------->|
      |<----------------- sent, sent, ...|  one transition ...
      |<---------------------------- took|
      | permit ------------------------->|
      |<---------------------- took: null|  ... and the work is over
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import msgspec

from parcours.errors import HostFailure, one_of
from parcours.model.structure import Component as Modelled
from parcours.run.port import Send, Step
from parcours.study.components.process import ComponentProcess, begun, command_of, failure, keep, quoted, take_kept
from parcours.study.components.simple import MOST_SENDS, Took

if TYPE_CHECKING:
    from parcours.study.components.systems import ProgramPart

PROTOCOL = "component/1"
MOST = 64_000_000  # most bytes of all lines that answer one permit
_MAY_HAVE = {"reset": "wake", "took": "wake"}
_QUOTED = 80


class ProgramComponent:
    """A program as a component. Once it has failed it is ended, and every later call raises the same again."""

    def __init__(self, modelled: Modelled, part: ProgramPart, values: Mapping[str, object], case_id: str, seed: int,
                 patience: float) -> None:  # fmt: skip
        self.name = modelled.name
        self._transitions = sorted(transition.id for transition in modelled.transitions())
        self._part, self._patience = part, patience
        self._case = {"case": case_id, "seed": seed, "values": dict(values)}
        self._key = (part.command, part.folder, tuple(sorted(part.environment.items())), part.socket, self.name)
        self._command = command_of(part, self.name)
        self._process: ComponentProcess | None = None
        self.reset()

    def reset(self) -> None:
        """Start the program, or return it to its start."""
        self._wake: int | None = None
        self._failure: HostFailure | None = None
        try:
            begun(self._process or take_kept(self._key), self._started, self._begin)
        except HostFailure:
            if self._failure is None:  # it could not even be started
                raise
            # raised again when the first transition is asked for

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Deliver a message; with channel None, ask for whatever the program can do with nothing present."""
        if channel is None:
            return self._work("ask", {"transition": None, "time": now})
        return self._work("deliver", {"channel": channel, "message": message, "time": now})

    def prompt(self, transition: str, now: int) -> Iterator[Step]:
        """Ask the program for a transition that no message starts."""
        return self._work("ask", {"transition": transition, "time": now})

    def next_wake(self) -> int | None:
        """Return the time at which the program wants to be woken [ns]; None is never."""
        return self._wake

    def wake(self, now: int) -> Iterator[Step]:
        """Tell the program the time, and let it do what that demands."""
        return self._work("time", now)

    def set_inputs(self, values: Mapping[str, object]) -> None:
        """Tell the program its input variables."""
        if self._process is not None:
            self._process.say("inputs", values)

    def close(self) -> None:
        """Keep the program for a later case; one that has failed was ended at once."""
        process, self._process = self._process, None
        if process is not None:
            self._failure = failure(self.name, "must not be used after it was closed", "program-ended")
            keep(self._key, process)

    def _started(self) -> ComponentProcess:
        return ComponentProcess(self._command, self._part, self.name, self._patience)

    def _begin(self, process: ComponentProcess, is_new: bool) -> None:
        self._process = process
        if is_new:
            with self._exchange("hello", {"protocol": PROTOCOL, "component": self.name}):
                given, line = self._answer(process, "hello")
                if given["hello"] != {"component": self.name}:
                    raise self._bad(f"must say that it is the component {self.name}", line)
        else:
            process.forget_words()
        with self._exchange("reset", self._case):
            given, line = self._answer(process, "reset")
            if given["reset"] is not True:
                raise self._bad("must answer `reset` with true", line)
            self._wake = self._time(given.get("wake"), line)

    def _work(self, word: str, content: object) -> Iterator[Step]:
        if self._process is not None:
            self._process.say(word, content)
        while (step := self._step()) is not None:
            yield step

    def _step(self) -> Took | None:
        """Permit one transition and return it; None if there is nothing more to do."""
        sends: list[Send] = []
        size = 0
        with self._exchange("permit", True) as process:
            while True:
                given, line = self._answer(process, "sent", "took")
                size += len(line)
                if "took" in given:
                    break
                match given["sent"]:
                    case {"channel": str(channel), "message": message, **rest} if not rest:
                        sends.append((channel, message))
                    case _:
                        raise self._bad("must send with a channel and a message", line)
                if len(sends) > MOST_SENDS or size > MOST:
                    most = f"at most {MOST_SENDS} messages and {MOST} bytes for one `permit`"
                    raise failure(self.name, f"must send {most}, but sent more", "program-flood")
            self._wake = self._time(given.get("wake"), line)
            taken = given["took"]
            if taken is None and not sends:
                return None
            if not isinstance(taken, str) or taken not in self._transitions:
                rule = f"must take a transition that the model gives {self.name}"
                raise self._bad(rule, line, one_of(str(taken)[:_QUOTED], self._transitions))
            return Took(taken, tuple(sends))

    def _time(self, wake: Any, line: bytes) -> int | None:
        if wake is None:
            return None
        if isinstance(wake, bool) or not isinstance(wake, int | float) or not 0 <= wake < 2**63 or wake != int(wake):
            raise self._bad("must give `wake` in whole nanoseconds", line)
        return int(wake)

    @contextlib.contextmanager
    def _exchange(self, word: str, content: object) -> Iterator[ComponentProcess]:
        """Say a word and hear the answer; whatever goes wrong meanwhile ends the program."""
        process = self._process
        if process is None:
            assert self._failure is not None
            raise self._failure
        try:
            with process.exchange(word, content):
                yield process
        except BaseException as error:
            why = f", but {type(error).__name__} came first: {error}"
            self._failure = error if isinstance(error, HostFailure) else process.unanswered(why, "program-silent")
            self._process = None
            if isinstance(error, Exception) and error is not self._failure:  # an alarm, which does not know who is late
                raise self._failure from error
            raise

    def _answer(self, process: ComponentProcess, *words: str) -> tuple[dict[str, Any], bytes]:
        """Return the next line, which holds one of the words, and perhaps the time of the next wake."""
        line = process.line()
        try:
            given = msgspec.json.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            raise self._bad("must print JSON, one object per line", line) from None
        for word in words:
            if isinstance(given, dict) and word in given and given.keys() <= {word, _MAY_HAVE.get(word)}:
                return given, line
        raise self._bad(f"must answer with {' or '.join(f'`{word}`' for word in words)}", line)

    def _bad(self, rule: str, line: bytes, remedy: str = "write other output to standard error") -> HostFailure:
        return failure(self.name, f"{rule}, but printed {quoted(line)}", "program-words", remedy)
