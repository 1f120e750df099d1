"""Constraints as functions of numbers -> assembled loops, ranks, curves of positions.

They serve the mobility analysis when a model is derived, and the assembly at run time; what calls of a model iterate is
in C (eomgen/native).  All of them work on scaled quantities (:class:`~.scales.Scales`), so that metres or millimetres
make no difference.
"""
