"""Stage runtime: a compiled or NumPy core -> Module; Module -> Trajectory.

Importing it costs NumPy; SciPy, pandas, matplotlib and rich load inside the calls that need them.
"""

from __future__ import annotations

from .kernels import Core
from .minimal import Minimal
from .module import Module
from .numpy_core import NumpyCore
from .storage import load_trajectory
from .trajectory import Trajectory

__all__ = ["Core", "Minimal", "Module", "NumpyCore", "Trajectory", "load_trajectory"]
