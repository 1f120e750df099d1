"""Equations -> a module of functions that CasADi or JAX trace, differentiate and compile, made in this process."""

from __future__ import annotations

from hashlib import sha256
from types import ModuleType
from typing import TYPE_CHECKING

from . import pipeline
from .base.files import find_module, load_source
from .emit.traced import LIBRARIES, emit_traced
from .errors import MissingDependencyError

if TYPE_CHECKING:
    from .derivation import Derivation


def traced_functions(equations: Derivation, library: str) -> ModuleType:
    """The functions of a model for a library.

    Parameters
    ----------
    equations : Derivation
    library : {'casadi', 'jax'}

    Returns
    -------
    module
        The same as the package that ``eomgen generate --target`` writes: functions such as ``rhs(t, x, u, p)``, the
        names ``x_names``, ``u_names``, ``p_names``, and the values ``x0``, ``u_values``, ``p_values``.

    Raises
    ------
    UsageError
        Something in the model has no form that the library can trace: functions in C, or a method that solves by
        pivoting.
    MissingDependencyError
        The library is not installed.
    """
    text = emit_traced(pipeline.with_start(equations, pipeline.build(equations, library)), library)
    name = f"{equations.name}_{library}_{sha256(text.encode()).hexdigest()[:16]}"
    found = find_module(name)
    if found is not None:
        return found
    title, requirement = LIBRARIES[library]
    try:
        return load_source(name, f"<{name}>", text.encode())
    except ImportError as error:
        raise MissingDependencyError(f"{title} is not installed; pip install '{requirement}'") from error
