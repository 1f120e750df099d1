"""eomgen: symbolic equations of motion of mechanisms, emitted as compiled modules.

Model -> Equations -> Module -> Trajectory.  ``import eomgen`` costs almost nothing: every name loads on first use, and
SymPy, SciPy and the compiler tools only where a call needs them.
"""

from __future__ import annotations

from importlib import import_module
from time import time

TYPE_CHECKING = False  # as in typing, which takes longer to import than all of this
if TYPE_CHECKING:
    from typing import Any

    from . import errors as errors
    from .api.equations import Equations as Equations
    from .api.loading import load as load
    from .api.loading import load_example as load_example
    from .api.model import Model as Model
    from .api.model import from_sympy as from_sympy
    from .errors import *  # noqa: F403
    from .module import Module as Module
    from .runtime.inputs import Signal as Signal
    from .runtime.trajectory import Trajectory as Trajectory
    from .runtime.trajectory import load_trajectory as load_trajectory

__version__ = "0.1.0"
_STARTED = time()  #: files of eomgen that are newer than this are not the code that runs

_HOMES = {"Model": "api.model", "from_sympy": "api.model", "load": "api.loading", "load_example": "api.loading"}
#: For annotations: what calls return, so no name that a misspelt one stands for.
_TYPES = {"Equations": "api.equations", "Module": "module", "Trajectory": "runtime.trajectory"}
_HOMES |= _TYPES
_MODULES = {"errors": ".errors", "rotations": ".elements.rotations"}
_HOMES |= {"Signal": "runtime.inputs", "load_trajectory": "runtime.trajectory"}
_ERRORS = (
    *("AssemblyError", "EomgenError", "EquilibriumError", "EvaluationError", "ExpressionError"),
    *("MissingDependencyError", "ModelError", "NoDerivativeError", "NonFiniteError", "ParameterError"),
    *("PartitionError", "ProjectionError", "SimulationError", "SimulationInterrupted", "SingularMassMatrixError"),
    *("ToolchainError", "UnavailableError", "UnsolvedError", "UsageError", "ZenoError"),
)
_HOMES |= dict.fromkeys(_ERRORS, "errors")

__all__ = [
    "Equations",
    "Model",
    "Module",
    "Signal",
    "Trajectory",
    "__version__",
    "errors",
    "from_sympy",
    "load",
    "load_example",
    "load_trajectory",
    *_ERRORS,
]


def _lazy(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name in _MODULES:
        return import_module(_MODULES[name], __name__)
    home = _HOMES.get(name)
    if home is None:
        near = (
            ""
            if name.startswith("_")
            else import_module(".base.texts", __name__).hint(name, [n for n in __all__ if n not in _TYPES])
        )
        text = f"module {__name__!r} has no attribute {name!r}; {near}".removesuffix("; ")
        raise import_module(".errors", __name__).UnavailableError(text)
    value = getattr(import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


if not TYPE_CHECKING:  # type checkers know all names
    __getattr__ = _lazy


def __dir__() -> list[str]:
    return sorted(__all__)
