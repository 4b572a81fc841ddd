"""Requirements with guards, data and time: covered by paths that run, proven infeasible, or undecided."""

from parcours.paths.solving.deciding import solve
from parcours.paths.solving.sequences import solve_sequence, solved_schedule
from parcours.paths.solving.verdicts import Covered, Executability, Infeasible, Path, Undecided, Verdict

__all__ = [
    "Covered", "Executability", "Infeasible", "Path", "Undecided", "Verdict", "solve", "solve_sequence",
    "solved_schedule",
]  # fmt: skip
