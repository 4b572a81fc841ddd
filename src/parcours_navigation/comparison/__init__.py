"""Planners compared on the same cases: results, one analysis of them, and its page, tables and document."""
