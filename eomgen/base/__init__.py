"""The floor: what every other package may use, and what uses no other: texts, names, files, operations, limits.

Exported packages carry this folder whole.
"""
