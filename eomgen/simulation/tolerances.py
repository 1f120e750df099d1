"""Simulation: tolerances and limits of steps as a user gives them -> checked values that every solver takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.limits.runs import LEAST_RTOL
from ..base.texts import shown
from ..errors import ill_shaped, no_number, off_range
from ..runtime.room import as_real, read_flag, read_number

IMPLICIT = ("jac", "jac_sparsity")  #: options of SciPy's implicit methods: the Jacobian, if not the model's own


def check_tolerances(n: int, span: float, options: Mapping[str, Any]) -> dict[str, Any]:
    """The options with every tolerance and limit checked.

    Parameters
    ----------
    n : int
        Number of states.
    span : float
        Length of the run (s), the longest first step.
    options : mapping
        rtol and atol (a number or n of them), max_step, first_step, min_step, vectorized; others are left as they are.

    Returns
    -------
    dict of str to object
        rtol and atol as a float or an (n,) array, rtol at least 100 times the spacing of floating-point numbers; the
        steps as floats, without those that are None.

    Raises
    ------
    UsageError
        A value that cannot be.
    """
    checked = {name: value for name, value in options.items() if value is not None or not name.endswith("_step")}
    for name in ("rtol", "atol"):
        if name in checked:
            checked[name] = _tolerance(name, checked[name], n)
    if "rtol" in checked:
        rtol = checked["rtol"]
        checked["rtol"] = max(rtol, LEAST_RTOL) if isinstance(rtol, float) else np.maximum(rtol, LEAST_RTOL)
    for name in ("max_step", "first_step"):
        if name in checked:
            checked[name] = check_step(name, checked[name])
    if "vectorized" in checked:
        checked["vectorized"] = read_flag("vectorized", checked["vectorized"])
    if "min_step" in checked:
        checked["min_step"] = read_number("min_step", checked["min_step"])
        if checked["min_step"] < 0.0:
            raise off_range(f"min_step must not be negative, not {checked['min_step']:.6g}")
    if checked.get("first_step", 0.0) > span:
        raise off_range(f"first_step must not exceed the span of {span:.6g} s, not {checked['first_step']:.6g}")
    return checked


def _tolerance(name: str, given: Any, n: int) -> Any:
    if type(given) is float and 0.0 <= given < np.inf:
        return given
    values = as_real(read_number(name, given) if isinstance(given, str) else given)
    if values is None:
        raise no_number(f"{name} must be a number, or one for each of the {n} states, not {shown(given)}")
    if values.shape not in ((), (n,)):
        raise ill_shaped(f"{name} must be a number or have shape ({n},), one for each state, not {values.shape}")
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise off_range(f"{name} must not be negative and must be finite, not {shown(given)}")
    return values if values.ndim else float(values)


def check_step(name: str, given: Any) -> float:
    """A length of steps (s), or a UsageError that names it."""
    if type(given) is float and 0.0 < given < np.inf:
        return given
    found = as_real(read_number(name, given) if isinstance(given, str) else given)
    if found is None or found.ndim:
        raise no_number(f"{name} must be a number of seconds, not {shown(given)}")
    value = float(found)
    if not value > 0.0 or (name == "first_step" and not np.isfinite(value)):
        raise off_range(f"{name} must be greater than 0 s{' and finite' * (name == 'first_step')}, not {given}")
    return value
