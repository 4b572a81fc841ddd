"""Grounds drawn by seed: the same seed and parameters give the same bits on every machine."""
