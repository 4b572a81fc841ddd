"""Messages on their way from planner to control: kept in order until they are due, however long they take."""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel

ROOM = 128  # Messages that can be on their way at once: those of 6 s at 20 Hz
FAR = 1 << 62  # The time of what will not happen [ns]

MAILBOX = np.dtype(
    [
        ("n", "i8"),  # messages on their way
        ("first", "i8"),  # where the oldest is
        ("next", "i8"),  # when it is due [ns]; FAR if there is none
        ("due", "i8", (ROOM,)),
        ("value", "f8", (ROOM,)),
    ]
)  # A channel that keeps the order of its messages


@kernel
def clear(box: Record) -> None:
    """Forget all messages."""
    box.n = box.first = 0
    box.next = FAR


@kernel
def post(box: Record, due: int, value: float) -> None:
    """Send a value that arrives at `due` [ns], or with the one before if that comes later.

    A full box replaces its newest message.
    """
    if box.n == ROOM:
        box.n -= 1
    if box.n > 0:
        due = max(due, box.due[(box.first + box.n - 1) % ROOM])
    box.due[(box.first + box.n) % ROOM] = due
    box.value[(box.first + box.n) % ROOM] = value
    box.n += 1
    box.next = box.due[box.first]


@kernel
def take(box: Record) -> float:
    """Return the oldest message and take it out."""
    value = box.value[box.first]
    box.first = (box.first + 1) % ROOM
    box.n -= 1
    box.next = box.due[box.first] if box.n > 0 else FAR
    return float(value)
