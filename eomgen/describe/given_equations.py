"""M, f, coordinates, ... -> Description."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from .description import Description, items
from .expressions import names_in
from .printed_names import give_latex
from .scope import RATES
from .sympy_face import free_names, function_names, is_sympy, named, names_of


def describe_equations(
    name: str,
    coordinates: Sequence[Any],
    mass_matrix: Any,
    forcing: Any,
    *,
    velocities: Sequence[Any] | None = None,
    rates: Mapping[Any, Any] | None = None,
    intermediates: Mapping[Any, Any] | None = None,
    constraints: Sequence[Any] = (),
    multipliers: Sequence[Any] = (),
    kinetic_energy: Any = None,
    potential_energy: Any = None,
    parameters: Mapping[Any, Any] | None = None,
    inputs: Mapping[Any, Any] | None = None,
    latex: Mapping[Any, str] | None = None,
) -> Description:
    """Describe a system by its equations of motion M v' = f, as the section ``equations`` of a model file does.

    Values are numbers, texts or SymPy expressions in symbols or functions of time.

    Parameters
    ----------
    name : str
        Identifier; the generated module bears it.
    coordinates : sequence
        Generalized coordinates q, in order.
    mass_matrix : (n, n) array or SymPy matrix
        M(q, t), symmetric.
    forcing : sequence of n
        f(q, v, t, inputs).
    velocities : sequence of n, optional
        Generalized velocities v; ``<coordinate>_dot`` unless given.
    rates : mapping, optional
        q' by coordinate, linear in v; the velocities in order unless given.
    intermediates : mapping, optional
        Named parts of the expressions; each may use those before it.
    constraints : sequence, optional
        Expressions that are 0: functions of coordinates and t, or linear in the velocities.
    multipliers : sequence of str, optional
        Names of the multipliers of the constraints, for outputs: M v' + C_q^T l = f.
    kinetic_energy, potential_energy : optional
        In J, for the balance of energy.
    parameters : mapping, optional
        Values by symbol or name.  Every other free symbol becomes a parameter without a value.
    inputs : mapping, optional
        Quantities given over time, by symbol or name: the value that holds while none is given.
    latex : mapping, optional
        How formulas and plots print coordinates, parameters and inputs, by symbol or name: ``{q: r"\\varphi"}``.

    Returns
    -------
    Description
    """
    names = names_of("equations.coordinates", coordinates, "a coordinate")
    speeds = names_of("equations.velocities", velocities, "a velocity")
    given: dict[str, Any] = {"coordinates": names}
    if speeds:
        given["velocities"] = speeds
    for key, table in (("rates", rates), ("intermediates", intermediates)):
        if values := named(key, table):
            given[key] = values
    rows = [items(row) for row in items(mass_matrix) or ()]
    if rows and all(row is None for row in rows):  # one coordinate: SymPy's 1 x 1 matrix counts as a plain list
        rows = [items(mass_matrix)]
    given |= {"mass_matrix": rows or mass_matrix, "forcing": items(forcing) or forcing}
    if items(constraints):
        given["constraints"] = items(constraints)
    if forces := names_of("equations.multipliers", multipliers, "a multiplier"):
        given["multipliers"] = forces
    for key, energy in (("kinetic_energy", kinetic_energy), ("potential_energy", potential_energy)):
        if energy is not None:
            given[key] = energy
    description = Description(values={"name": name, "equations": given})
    values, driven = named("parameters", parameters), named("inputs", inputs)
    known = {part + rate for part in (*names, *speeds) for rate in RATES}
    known |= {*driven, *given.get("intermediates", ()), *given.get("multipliers", ())}
    declared = ("coordinates", "velocities", "multipliers")
    found = sorted({part for key in given if key not in declared for part in _names(given[key])})
    for parameter in [*values, *(part for part in found if part not in values)]:
        if parameter not in known and parameter != "t":
            value = values.get(parameter)
            description.add("parameters", parameter, {} if value is None else {"value": value})
    for source, value in driven.items():
        description.add("inputs", source, {} if value is None else {"value": value})
    give_latex(description, "equations", latex)
    return description


def _names(value: Any) -> Iterator[str]:
    """Names in all expressions that a value holds; functions of time are coordinates."""
    if isinstance(value, str):
        yield from names_in(value)
    elif is_sympy(value):
        yield from set(free_names([value])) - set(function_names([value]))
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _names(part)
    else:
        for part in items(value) or ():
            yield from _names(part)
