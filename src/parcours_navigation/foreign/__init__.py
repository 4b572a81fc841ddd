"""Systems that nobody here wrote, tested through a binding file: abstract cases, system cases, timing, liveness."""
