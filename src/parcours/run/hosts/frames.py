"""What the tester and a node say to each other beside the messages under test, as MessagePack.

Times are nanoseconds of the machine's monotonic clock, which all processes of one machine read alike. On sockets a
message travels within its frame; where it travels on a topic or service of its own, the frame only announces it.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from parcours.errors import HostFailure
from parcours.run.instance import Manner

Scalar = bool | int | float | str


class Frame(msgspec.Struct, frozen=True, array_like=True, tag=True):
    """Anything said; an array that begins with its name."""


class Wire(msgspec.Struct, frozen=True, array_like=True):
    """A message: its channel and its bytes, which are empty where it travels by itself."""

    channel: str
    data: bytes = b""


class OfferedTurn(msgspec.Struct, frozen=True, array_like=True):
    """One transition that an instance may take.

    `awaits` is the number of the message to take up first, -1 for none. If it awaits none and is idle, it is moved by
    the message `given`, or by the prompt of that name. `settle` are messages to take up before, unrecorded.
    """

    transition: str
    awaits: int = -1
    prompt: str = ""
    given: Wire | None = None
    settle: tuple[Wire, ...] = ()


class Begin(Frame, frozen=True):
    """Driven: make a fresh instance for each reference of the case, and forget those before."""

    case: bytes
    references: tuple[int, ...]
    zero: int


class Grant(Frame, frozen=True):
    """Driven: take these turns one after the other; stop at the first that comes out otherwise."""

    reference: int
    turns: tuple[OfferedTurn, ...]


class Look(Frame, frozen=True):
    """Driven: tell what the instance shows of itself."""

    reference: int


class RunFreely(Frame, frozen=True):
    """Free: make a fresh component for the case and let it run by itself; its time began at `zero`."""

    case: bytes
    zero: int


class Deliver(Frame, frozen=True):
    """A message to the node, with its number."""

    number: int
    message: Wire


class Rest(Frame, frozen=True):
    """Stop what is under way and forget it; answered by Ready."""


class Quit(Frame, frozen=True):
    """End the process."""


Command = Begin | Grant | Look | RunFreely | Deliver | Rest | Quit


class Ready(Frame, frozen=True):
    """The node has started, has made its instances, or has come to rest: all commands before are done."""


class Idle(Frame, frozen=True):
    """Free: there is nothing to do unless a message comes; `taken` messages have been worked off."""

    taken: int


class Turned(Frame, frozen=True):
    """Driven: what came of a turn (see `Outcome`)."""

    reference: int
    manner: Manner
    time: int
    transition: str = ""
    sends: tuple[Wire, ...] = ()
    received: int = -1
    asides: tuple[tuple[int, Wire], ...] = ()
    text: str = ""
    variables: dict[str, Scalar] | None = None
    operations: tuple[str, ...] | None = None
    settled: tuple[tuple[int, Wire, tuple[Wire, ...]], ...] = ()


class ViewShown(Frame, frozen=True):
    """Driven: what an instance shows of itself; no message if nothing."""

    reference: int
    message: Wire | None


class Received(Frame, frozen=True):
    """Free: the message with that number was taken up."""

    number: int
    time: int


class Dropped(Frame, frozen=True):
    """Free: the message with that number was dropped, since newer ones filled its queue, or it could not be read."""

    number: int
    time: int
    why: str = "overrun"


class TransitionTaken(Frame, frozen=True):
    """Free: a transition was taken (empty for a step that the model does not name), and these messages left."""

    time: int
    transition: str
    sends: tuple[Wire, ...] = ()
    variables: dict[str, Scalar] | None = None
    operations: tuple[str, ...] | None = None


class Broke(Frame, frozen=True):
    """The component raised; the node is of no more use."""

    time: int
    text: str


class Died(Frame, frozen=True):
    """The process has ended, with an exit status or by a signal (negative). The host says so, not the node."""

    time: int
    status: int


Report = Ready | Idle | Turned | ViewShown | Received | Dropped | TransitionTaken | Broke | Died

_UNREADABLE = msgspec.MsgspecError, ValueError, RecursionError  # text that is no UTF-8 is a ValueError

_encoder = msgspec.msgpack.Encoder()
_commands: msgspec.msgpack.Decoder[Command] = msgspec.msgpack.Decoder(Command)
_reports: msgspec.msgpack.Decoder[Report] = msgspec.msgpack.Decoder(Report)


def packed(frame: Command | Report) -> bytes:
    """Return the frame's bytes.

    >>> command(packed(Look(3)))
    Look(reference=3)
    """
    return _encoder.encode(frame)


def command(data: bytes) -> Command:
    """Return the command. Raises HostFailure if these bytes are not one."""
    try:
        return _commands.decode(data)
    except _UNREADABLE as error:
        raise _foreign("command", error) from error


def report(data: bytes) -> Report:
    """Return the report. Raises HostFailure if these bytes are not one."""
    try:
        return _reports.decode(data)
    except _UNREADABLE as error:
        raise _foreign("report", error) from error


def _foreign(what: Literal["command", "report"], error: Exception) -> HostFailure:
    return HostFailure("node", f"each frame must be a {what} of this version, but: {error}",
                       "let nobody else write to a node's channels", slug="frame-foreign")  # fmt: skip
