"""Benchmarks: eomgen timed beside SymPy in one run; ``python -m benchmarks.run [names] [--quick]``."""
