"""L, coordinates, forces, ... -> Description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.notation import split_rate
from .description import Description, items
from .expressions import names_in
from .printed_names import give_latex
from .scope import RATES
from .sympy_face import derivative_names, free_names, function_names, is_sympy, named, names_of


def describe_lagrangian(
    name: str,
    L: Any,
    coordinates: Sequence[Any],
    forces: Sequence[Any] | Mapping[Any, Any] | None = None,
    dissipation: Any = None,
    constraints: Sequence[Any] = (),
    parameters: Mapping[Any, Any] | None = None,
    inputs: Mapping[Any, Any] | None = None,
    latex: Mapping[Any, str] | None = None,
) -> Description:
    """Describe a system by its Lagrangian L = T - V.

    Parameters
    ----------
    name : str
        Identifier; the generated module bears it.
    L : sympy.Expr or str
        T - V in coordinates, velocities and t.
    coordinates : sequence
        Generalized coordinates: functions of time ``q(t)`` (``dynamicsymbols``), whose velocities are their
        derivatives, or plain symbols (or names) ``q``, whose velocities are the symbols ``q_dot``.
    forces : sequence or mapping, optional
        Generalized forces, one for each coordinate in order, or by coordinate.
    dissipation : sympy.Expr, optional
        Rayleigh's dissipation function D(q, q_dot); it adds the forces -dD/dq_dot.
    constraints : sequence of sympy.Expr, optional
        Constraints, each = 0: of coordinates and t (holonomic), or linear in the velocities (nonholonomic).
    parameters : mapping, optional
        Values by symbol or name.  Every other free symbol becomes a parameter without a value.
    inputs : mapping, optional
        Quantities given over time, by symbol or name: the value that holds while none is given.
    latex : mapping, optional
        How formulas and plots print coordinates, parameters and inputs, by symbol or name: ``{q: r"\\varphi"}``; also
        velocities, ``"q_dot"``, and the multipliers of the constraints, ``"lambda_1"``.

    Returns
    -------
    Description

    Raises
    ------
    ModelError
        A coordinate is neither a symbol nor a function of time ``q(t)``.
    """
    names = names_of("lagrangian.coordinates", coordinates, "a coordinate")
    given: dict[str, Any] = {"coordinates": names, "expression": L}
    if forces is not None:
        given["forces"] = named("forces", forces) if isinstance(forces, Mapping) else forces
    if dissipation is not None:
        given["dissipation"] = dissipation
    if items(constraints) or not isinstance(constraints, list | tuple):
        given["constraints"] = constraints

    description = Description(values={"name": name, "lagrangian": given})
    values, driven = named("parameters", parameters), named("inputs", inputs)
    known = {q + rate for q in names for rate in RATES} | set(driven)
    stems = {split_rate(source)[0] for source in driven}
    others = [name for name in _symbols(given, rates=True) if name not in {*known, *values}]
    rates = [name for name in others if split_rate(name)[0] in stems]
    known |= set(rates)
    for parameter in [*values, *(p for p in _symbols(given) if p not in values)]:
        if parameter not in known:
            value = values.get(parameter)
            description.add("parameters", parameter, {} if value is None else {"value": value})
    for source, value in driven.items():
        description.add("inputs", source, {} if value is None else {"value": value})
    for rate in rates:
        description.add("inputs", rate, {})
    give_latex(description, "lagrangian", latex)
    return description


def _symbols(given: Mapping[str, Any], rates: bool = False) -> list[str]:
    """Plain symbols of everything given; functions of time are coordinates or faults, never parameters.

    With ``rates`` also derivatives of functions of time.
    """
    parts: list[Any] = [given["expression"], given.get("dissipation")]
    forces = given.get("forces", ())
    parts += list(forces.values()) if isinstance(forces, Mapping) else items(forces) or []
    constraints = given.get("constraints", ())
    parts += items(constraints) or []
    found = {name for part in parts if isinstance(part, str) for name in names_in(part)}
    parts = [part for part in parts if is_sympy(part)]
    if parts:
        found |= set(free_names(parts)) - set(function_names(parts))
    if rates:
        found |= set(derivative_names(parts))
    return sorted(found - {"t"})
