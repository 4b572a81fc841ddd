"""Covering arrays: few rows that hold every wanted combination of blocks, each array verified."""
