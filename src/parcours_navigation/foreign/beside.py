"""Work that a relay must not wait for, such as writing to a disk, done in a thread beside it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Beside(Generic[T]):
    """Does something with each item, soon and in order.

    Args:
        do: what is done with an item; what it raises is raised by `close`.
        name: of the thread.
    """

    def __init__(self, do: Callable[[T], None], name: str) -> None:
        self._do = do
        self._queue: queue.SimpleQueue[T | None] = queue.SimpleQueue()
        self._failed: list[BaseException] = []
        self._is_late = False
        self._thread = threading.Thread(target=self._work, daemon=True, name=name)
        self._thread.start()

    def _work(self) -> None:
        try:
            while (item := self._queue.get()) is not None and not self._is_late:
                self._do(item)
        except BaseException as error:
            self._failed.append(error)

    def put(self, item: T) -> None:
        """Add an item."""
        self._queue.put(item)

    def close(self, patience: float | None = None) -> bool:
        """Wait until all is done, and return whether it is, within the patience [s]; the rest is left undone."""
        self._queue.put(None)
        self._thread.join(patience)
        self._is_late = self._thread.is_alive()
        if self._failed:
            raise self._failed.pop()
        return not self._is_late
