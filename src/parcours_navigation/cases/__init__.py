"""Numbered cases: three obstacles of unforeseen motion, drawn by seed from the input domains of the paper."""
