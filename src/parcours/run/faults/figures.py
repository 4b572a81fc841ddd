"""Times and shares as people write them -> exact numbers, and back without loss."""

from __future__ import annotations

from decimal import Decimal

NANOSECONDS: dict[str, int] = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Unit of time -> how many nanoseconds it has."""


def time_text(time: int) -> str:
    """Return a time [ns] in the greatest unit of which it is at least one.

    >>> time_text(2_000_000_000), time_text(1_500_000), time_text(33_333_333), time_text(0)
    ('2 s', '1.5 ms', '33.333333 ms', '0 s')
    """
    for unit, size in NANOSECONDS.items():
        if time >= size:
            return f"{plain(Decimal(time) / size)} {unit}"
    return "0 s"


def time_of(number: str, unit: str) -> int | None:
    """Return the time [ns], or None if it is no whole number of nanoseconds.

    >>> time_of("1.5", "ms"), time_of("0.5", "ns")
    (1500000, None)
    """
    time = Decimal(number) * NANOSECONDS[unit]
    return int(time) if time == int(time) else None


def percent_text(share: float) -> str:
    """Return a share of one in percent.

    >>> percent_text(0.3), percent_text(0.07)
    ('30 %', '7 %')
    """
    return f"{plain(Decimal(repr(share)) * 100)} %"


def share_of(number: str) -> float:
    """Return the share of one that so many percent are.

    >>> share_of("30")
    0.3
    """
    return float(Decimal(number) / 100)


def plain(number: Decimal) -> str:
    """Return the number without exponent and without zeros that say nothing.

    >>> plain(Decimal("5.0")), plain(Decimal("1E+2"))
    ('5', '100')
    """
    text = f"{number:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
