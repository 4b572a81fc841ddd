"""Which requirements of a criterion a set of paths, or a recorded run, meets."""

from parcours.paths.measuring.coverage import Coverage, measure
from parcours.paths.measuring.tours import Tours, toured

__all__ = ["Coverage", "Tours", "measure", "toured"]
