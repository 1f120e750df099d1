"""The core of a model -> BoundModel; BoundModel -> Trajectory.

Importing it costs NumPy and little more; SciPy, pandas and matplotlib load inside the calls that need them.
"""
