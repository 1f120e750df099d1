"""Measurements beside other programs: functions that ``harness.benchmark`` registers, run by ``benchmarks.run``."""
