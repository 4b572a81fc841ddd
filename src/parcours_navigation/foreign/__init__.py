"""Foreign nodes, tested through a binding file: abstract cases, system cases, timing, liveness."""
