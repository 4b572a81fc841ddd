"""When each transition of a sequence with durations and clocks can be taken, or what contradicts what."""

from parcours.paths.timing.network import TimeWindow
from parcours.paths.timing.schedules import Contradiction, Schedule, Unscheduled, schedule
from parcours.paths.timing.time_constraints import is_timed

__all__ = ["Contradiction", "Schedule", "TimeWindow", "Unscheduled", "is_timed", "schedule"]
