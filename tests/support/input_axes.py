"""Inputs of every kind, for searches that move them."""

AXES = """
parcours: data/1
name: axes
parameters:
  a: {unit: m, edges: [0, 1, 4]}
  b: {unit: m, edges: [0, 2]}
  c: {unit: rad, kind: angle, edges: [-1.0, 1.0]}
  n: {unit: "1", kind: integer, edges: [0, 5]}
"""
