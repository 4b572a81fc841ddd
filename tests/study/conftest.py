"""Programs that play the bolt of a small lock, written by each test in a few lines of Python."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from parcours.errors import HostFailure
from parcours.model.model_file import parse_model
from parcours.model.structure import Cefsm
from parcours.run.port import Component
from parcours.study.components.process import end_programs
from parcours.study.components.program import ProgramComponent
from parcours.study.components.systems import ProgramPart

GENEROUS = 60.0
"""Patience where nothing hangs [s]."""

LOCK = """
parcours: model/1
name: lock
messages:
  Word: {fields: {word: {type: int}}}
channels:
  turn: {from: environment, to: Key, message: Word}
  push: {from: Key, to: Bolt, message: Word}
  done: {from: Bolt, to: Key, message: Word}
components:
  Key:
    machines:
      hand:
        initial: free
        transitions:
          k1: {from: free, to: busy, event: turn(it), message: push(it)}
          k2: {from: busy, to: free, event: done(it)}
  Bolt:
    variables: {stuck: {type: bool, role: input}}
    machines:
      slide:
        initial: open
        transitions:
          b1: {from: open, to: shut, event: push(it), message: done(it)}
          b2: {from: shut, to: open}
"""

_PRELUDE = """
import json, os, signal, socket, subprocess, sys, time

def say(**words):
    print(json.dumps(words), flush=True)

def hear(word):
    while True:
        line = sys.stdin.readline()
        if not line:
            sys.exit(0)
        said = json.loads(line)
        if word in said:
            return said[word]

def greet():
    say(hello={"component": hear("hello")["component"]})
    return reset()

def reset():
    given = hear("reset")
    say(reset=True)
    return given

"""


@dataclass(frozen=True, slots=True)
class Workshop:
    """Makes programs in a folder, which speak the protocol by the functions of the prelude."""

    folder: Path
    lock: Cefsm

    def part(self, source: str, name: str = "bolt.py") -> ProgramPart:
        """Return how the program of this source is started."""
        (self.folder / name).write_text(_PRELUDE + textwrap.dedent(source))
        return ProgramPart((sys.executable, name), self.folder)

    def bolt(
        self, source: str, patience: float = GENEROUS, values: Mapping[str, object] | None = None, **options: object
    ) -> ProgramComponent:
        """Return the bolt that the program of this source is."""
        part = replace(self.part(source), **options)  # type: ignore[arg-type]
        return ProgramComponent(self.lock.component("Bolt"), part, values or {}, "a case", 7, patience)

    def reason(self, component: Component) -> str:
        """Return why the component fails when a message is delivered."""
        with pytest.raises(HostFailure) as caught:
            list(component.handle("push", "now", 5))
        return str(caught.value)


@pytest.fixture(scope="session")
def lock() -> Cefsm:
    """Return the model of a lock: a key that is turned pushes the bolt, which says when it is done."""
    return parse_model(LOCK, "lock.yaml")


@pytest.fixture
def workshop(tmp_path: Path, lock: Cefsm) -> Iterator[Workshop]:
    """Yield a workshop whose programs end with the test."""
    yield Workshop(tmp_path, lock)
    end_programs()
