"""Robots: bodies that follow commands as their drive allows, and what they believe of their own way."""
