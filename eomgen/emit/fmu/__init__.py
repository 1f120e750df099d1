"""Stage emit, functional mock-up units: Program -> the files of an FMU, without its binary.

https://fmi-standard.org: version 2.0.3 and 3.0, model exchange and co-simulation in one unit.
"""

from .content import FmuFiles, emit_fmu

__all__ = ["FmuFiles", "emit_fmu"]
