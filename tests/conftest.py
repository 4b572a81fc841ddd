"""Settings of all tests: none fails because the machine is slow, or because a shell runs it in the background."""

from __future__ import annotations

import signal

from hypothesis import HealthCheck, settings

settings.register_profile(
    "parcours", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True, print_blob=True
)
settings.load_profile("parcours")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # shells start background jobs like this
    signal.signal(signal.SIGINT, signal.default_int_handler)
