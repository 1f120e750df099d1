"""Stage reading, functions of time: names -> SymPy's dynamicsymbols and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ..describe.input_names import split_rate
from ..kinematics import Kinematics
from ..kinematics.state import acceleration_name
from .names_of_unknowns import momentum_names


def dynamic_symbols(kinematics: Kinematics) -> Callable[[str], Any]:
    """Name -> SymPy: ``theta`` is theta(t), ``theta_dot`` its derivative, ``theta_ddot`` the second one.

    Velocities that are no rates of coordinates (``ball_wx``), inputs, momenta and multipliers are functions of time as
    well; parameters are plain symbols; t is ``dynamicsymbols._t``.
    """
    orders: dict[str, tuple[str, int]] = {name: (name, 0) for name in kinematics.names}
    loop = kinematics.loop_coordinates.names
    for name in (*kinematics.names, *loop):
        orders |= {name: (name, 0), f"{name}_dot": (name, 1), f"{name}_ddot": (name, 2)}
    for velocity in (*kinematics.velocity_names, *kinematics.state_names):
        base, order = orders.setdefault(velocity, (velocity, 0))
        orders[acceleration_name(velocity)] = (base, order + 1)
    inputs = kinematics.input_names
    for name in inputs:
        base, order = split_rate(name)
        orders[name] = (base, order) if base in inputs else (name, 0)
    orders |= {name: (name, 0) for name in momentum_names(kinematics)}

    return partial(_function_of_time, orders)


def _function_of_time(orders: Mapping[str, tuple[str, int]], name: str) -> Any:
    import sympy
    from sympy.physics.mechanics import dynamicsymbols

    if name == "t":
        return dynamicsymbols._t
    if name not in orders:
        return sympy.Symbol(name)
    base, order = orders[name]
    return dynamicsymbols(base, order)
