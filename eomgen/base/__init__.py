"""The floor: what every other room may use, and what uses none: texts, names, files, operations, limits, positions.

Exported packages carry this folder whole, so nothing stands here that no run reaches.  Constraints as functions of
numbers become assembled loops, ranks and curves here, on scaled quantities (:class:`~.scales.Scales`).
"""
