"""Every reader of a file from outside, given damaged and made-up files: a model or one error, soon, and nothing else.

Run as a script, `python tests/fuzz/test_fuzz_readers.py --seconds 60`, it gives each reader so many seconds and prints
what it tried; the tests here are a short run of the same.
"""

from __future__ import annotations

import importlib
import random
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import parse_input_model
from parcours.errors import ParcoursError
from parcours.model import read_model
from parcours.model.formats import formats, write_as
from parcours_formats.pict import parse_pict

SEEDS = Path(__file__).parent / "seeds"
DOMAINS = Path(__file__).parents[2] / "src" / "parcours_navigation" / "cases" / "domains.yaml"
SOON = 10.0
"""Longest that a reader may take for a file of this size [s], on a machine that does other things too."""

NUMBERS = ("0", "-1", "1", "7", "255", "65536", "2147483648", "1e308", "0.1", "-0.0", "9" * 26)
SIGNS = "\x00\t\n\r \ufeff\u2028\xe9\U0001f600\ud800'\"\\()[]{}<>&;,.:=|/*#@%!?"
PIECES = [*(Path(__file__).parent / "hostile.txt").read_text("utf-8").split(), *NUMBERS, *SIGNS, ""]
"""What may be put anywhere: words of every language that is read, and what its readers must refuse."""

WORDS = re.compile(r"\w+|\s+|[^\w\s]")


def _readers() -> dict[str, Callable[[str, str], object]]:
    found: dict[str, Callable[[str, str], object]] = {}
    for name, each in formats().items():
        if each.reads:
            found[name] = importlib.import_module(each.module).read
    return {**found, "data": parse_input_model, "pict": parse_pict}


READERS = _readers()


def _seeds() -> dict[str, list[str]]:
    suffixes = {name: each.suffixes[0] for name, each in formats().items()} | {"pict": ".pict"}
    own = {path.name: path.read_text("utf-8") for path in sorted(SEEDS.iterdir())}
    found = {name: [text for file, text in own.items() if Path(file).suffix == suffixes.get(name)] for name in READERS}
    found["data"] = [DOMAINS.read_text("utf-8")]
    lift = read_model(SEEDS / "lift.yaml")
    for name, each in formats().items():
        if each.reads and each.writes and name != "aut":  # which holds one machine
            found[name].append(write_as(lift, name).text)
    return found


TEXTS = _seeds()


def mutated(name: str, source: random.Random) -> str:
    """Return a seed of a reader, damaged in one to eight places; now and then two seeds, or no seed at all."""
    if source.random() < 0.05:
        return "".join(source.choice(PIECES) + source.choice(" \n") for _ in range(source.randrange(60)))
    parts = WORDS.findall(source.choice(TEXTS[name]))
    for _ in range(source.randint(1, 8)):
        at = source.randrange(len(parts) or 1)
        end = at + int(source.paretovariate(0.8)) % 200
        match source.randrange(9):
            case 0:
                del parts[at:end]
            case 1:
                parts[at:at] = parts[at:end]
            case 2:
                parts[at:at] = parts[at:end] * source.randrange(20)
            case 3 | 4:
                parts[at : at + source.randrange(2)] = [source.choice(PIECES)]
            case 5:
                parts[at : at + 1] = [source.choice(parts or [""])]
            case 6:
                numbers = [index for index, part in enumerate(parts) if part.isdecimal()]
                if numbers:
                    parts[source.choice(numbers)] = source.choice(NUMBERS)
            case 7:
                other = WORDS.findall(source.choice(TEXTS[source.choice(list(TEXTS))]))
                start = source.randrange(len(other) or 1)
                parts[at:at] = other[start : start + end - at]
            case _:
                names = [index for index, part in enumerate(parts) if part.isidentifier()] or [at]
                one, two = source.choice(names), source.choice(names)
                if parts:
                    parts[one], parts[two] = parts[two], parts[one]
        del parts[20_000:]
    return "".join(parts)


class SlowError(Exception):
    """A reader took too long."""


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Raise SlowError if the block takes longer."""

    def late(*_: object) -> None:
        raise SlowError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def attempt(name: str, text: str) -> bool:
    """Return whether a reader made something of a text; raise what it should not."""
    try:
        with within(SOON):
            READERS[name](text, "fuzz")
    except ParcoursError as error:
        assert str(error).startswith("fuzz"), f"an error must say the file, but is: {error}"
        assert len(str(error)) < 200_000
        return False
    return True


@pytest.mark.parametrize("name", READERS)
def test_every_seed_is_read(name: str) -> None:
    assert TEXTS[name]
    for text in TEXTS[name]:
        assert attempt(name, text)


@pytest.mark.parametrize("name", READERS)
@given(st.integers(0, 2**64))
@settings(max_examples=40, deadline=None)
def test_a_damaged_file_is_a_model_or_one_error(name: str, seed: int) -> None:
    attempt(name, mutated(name, random.Random(seed)))


@click.command()
@click.option("--seconds", type=click.FloatRange(0), default=60.0, show_default=True, help="For each reader.")
@click.option("--seed", type=int, default=None, help="Start of the seeds; by default the time.")
@click.option("--reader", "only", multiple=True, type=click.Choice(list(READERS)), help="Only these.")
def main(seconds: float, seed: int | None, only: tuple[str, ...]) -> None:
    """Give each reader damaged files; exit code 1 if one did anything but read or complain.

    Example: python tests/fuzz/test_fuzz_readers.py --seconds 60
    """
    first, failed = time.time_ns() if seed is None else seed, False
    for name in only or READERS:
        count, read, slowest, end = 0, 0, (0.0, first), time.monotonic() + seconds
        while time.monotonic() < end:
            text, began = mutated(name, random.Random(first + count)), time.monotonic()
            try:
                read += attempt(name, text)
            except Exception as error:
                failed = True
                click.echo(f"{name}: seed {first + count}: {type(error).__name__}: {str(error)[:300]}")
            slowest = max(slowest, (time.monotonic() - began, first + count))
            count += 1
        said = f"{count} files, {read} read, {count - read} refused"
        click.echo(f"{name}: {said}, slowest {slowest[0]:.2f} s (seed {slowest[1]})")
    sys.exit(failed)


if __name__ == "__main__":
    main()
