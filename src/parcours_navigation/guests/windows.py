"""Views of memory that lead to nothing but what they show."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Window:
    """A contiguous part of an array of floats, to be shown to strangers.

    What an array of NumPy's is a view of can be reached by its `base`; here that ends at the part itself.

    >>> memory = np.arange(6.0)
    >>> seen = Window(memory[2:4]).array()
    >>> seen[0] = 7.0
    >>> float(memory[2]), len(seen.base)
    (7.0, 2)
    """

    def __init__(self, view: Floats) -> None:
        kind: Any = type("Part", (ctypes.Array,), {"_type_": ctypes.c_double, "_length_": view.size})
        self._part, self._shape = kind.from_address(view.ctypes.data), view.shape
        self._part.memory = view  # which must not be freed as long as anybody has an array of it

    def array(self) -> Floats:
        """Return a new array of it, whatever was done to the shape of an earlier one."""
        return np.frombuffer(self._part).reshape(self._shape) if self._part else np.zeros(self._shape)
