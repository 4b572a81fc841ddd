"""Parcours turns a model of behaviour into executed, judged, replayable tests of real-time components."""

__version__ = "0.1.0"
