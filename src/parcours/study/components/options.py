"""The parameters that every component study has: where its cases run, and how often."""

from __future__ import annotations

from parcours.run.hosts import HOSTS
from parcours.study.components.results import PER_CASE, PER_VISIT
from parcours.study.parameters import Parameter


def host_parameters(*more: Parameter) -> tuple[Parameter, ...]:
    """Return the parameters that every component study has, and others after them."""
    return (
        Parameter("host", "text", "simulated", "where the components run", choices=HOSTS),
        Parameter("graph", "text", "", "address of a running ROS 1 master, or a ROS 2 domain; else one of its own",
                  decides=False),
        Parameter("record", "text", "", "keep a recording of every case", choices=("", "mcap", "bag"), decides=False),
        Parameter("instances", "text", PER_CASE, "of a component: one per case, which is answered, or one per visit",
                  choices=(PER_VISIT, PER_CASE)),
        Parameter("orders", "text", "", "of each case to try beside its own: all, N, or pct:d or pct:d:N"),
        Parameter("repeats", "int", 60, "of a timing case", low=1, high=100_000),
        *more,
    )  # fmt: skip
