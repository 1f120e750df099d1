"""The core of a model -> BoundModel; BoundModel -> Trajectory.

Importing it costs NumPy and little more; SciPy, pandas, matplotlib and rich load inside the calls that need them.
"""
