"""Scalar operations -> one hash-consed expression graph, with derivatives, values, counts and schedules.

SymPy enters and leaves through :mod:`eomgen.expr.sympy_bridge`, which work without SymPy does not load.
"""
