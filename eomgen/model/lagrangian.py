"""A bare Lagrangian: what Python gives -> Description; the section ``lagrangian`` -> Lagrangian on the graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.notation import split_rate
from ..elements import kinds
from ..elements.kinds import MOTION
from ..expr.core import Expr, symbols_of
from ..expr.differentiate import jacobian
from ..expr.shown import quoted, shown
from .checks import check_keys
from .description import Description, items
from .expressions import names_in
from .fields import LAGRANGIAN
from .mechanism import Lagrangian
from .names import nearest
from .printed_names import MULTIPLIERS, give_latex, numbered, take_coordinates_latex
from .scope import RATES
from .sympy_face import derivative_names, free_names, function_names, in_order, is_sympy, name_of, named, names_of
from .values import Reader


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
    own = {name: value for name, value in values.items() if name not in known}
    description.declare(own, driven | dict.fromkeys(rates), [name for name in _symbols(given) if name not in known])
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


def declare_lagrangian(reader: Reader, given: Any, has_bodies: bool) -> dict[str, Any] | None:
    """Check the section and take its coordinates into the namespace; None if there is no section."""
    faults = reader.faults
    if given is None:
        return None
    if not isinstance(given, Mapping):
        reader.wrong("lagrangian", given, kinds.Table)
        return {}
    if has_bodies:
        remedy = "describe only one of them: bodies or a Lagrangian"
        faults.add("lagrangian", "the model has bodies or joints too", remedy, "EG-CONFLICT")
    check_keys("lagrangian", given, LAGRANGIAN, faults)
    values = dict(given)
    listed = items(values.get("coordinates", ()))
    if listed is None:
        reader.wrong("lagrangian.coordinates", given["coordinates"], kinds.Names)
        listed = []
    elif not listed and "coordinates" in given:
        faults.add("lagrangian.coordinates", "there are no coordinates", "name at least one", "EG-MISSING")
    values["coordinates"] = [name_of(q) for q in listed]
    for k, name in enumerate(values["coordinates"]):
        reader.names.declare("coordinate", name, f"lagrangian.coordinates[{k}]")
    others = [f"{name}_dot" for name in values["coordinates"]]
    count = len(items(values.get("constraints", ())) or ())
    multipliers = [name for word in MULTIPLIERS for name in numbered(word, count)]
    others += [name for name in multipliers if name not in reader.names.kinds]
    take_coordinates_latex(reader, "lagrangian.latex", values["coordinates"], values.get("latex", ()), others)
    return values


def build_lagrangian(reader: Reader, values: dict[str, Any] | None) -> Lagrangian | None:
    """The Lagrangian of a checked section."""
    if values is None:
        return None
    path = "lagrangian"
    names = [str(q) for q in values.get("coordinates", ())]
    zero = reader.graph.zero
    expression = (
        reader.expression(f"{path}.expression", values["expression"], MOTION) if "expression" in values else zero
    )
    _require_quadratic(reader, f"{path}.expression", expression, names)
    dissipation = reader.expression(f"{path}.dissipation", values.get("dissipation", 0), MOTION)
    constraints = items(values.get("constraints", ()))
    if constraints is None:
        reader.wrong(f"{path}.constraints", values["constraints"], kinds.Scalars)
        constraints = []
    return Lagrangian(
        tuple(names),
        expression,
        _forces(reader, f"{path}.forces", values.get("forces", ()), names),
        dissipation,
        tuple(_constraint(reader, f"{path}.constraints[{k}]", c, names) for k, c in enumerate(constraints)),
    )


def _require_quadratic(reader: Reader, path: str, expression: Expr, names: list[str]) -> None:
    """Refuse a Lagrangian whose mass matrix d2L/(dq_dot dq_dot) depends on velocities: kernels take M(q, t)."""
    rates = {name + "_dot": reader.graph.symbol(name + "_dot") for name in names}
    momenta = list(jacobian([expression], list(rates.values())).values())
    inertia = list(jacobian(momenta, list(rates.values())).values()) if momenta else []
    found = [rate for rate in rates if rate in symbols_of(inertia)] if inertia else []
    if found:
        reader.faults.add(
            path,
            "is not quadratic in the velocities: the mass matrix (its second derivatives by them) depends on "
            + ", ".join(found),
            "write T as a sum of terms m(q, t)*a_dot*b_dot, b(q, t)*a_dot and c(q, t), with all products expanded; for "
            "another kind of Lagrangian give the equations of motion: `equations:` of a model file, with mass_matrix "
            "1 and the accelerations as forcing",
            "EG-EXPRESSION",
        )


def _constraint(reader: Reader, path: str, given: Any, names: list[str]) -> Expr:
    """A constraint: of coordinates and t, or linear in the velocities."""
    expression = reader.expression(path, given, MOTION)
    rates = {name + "_dot": reader.graph.symbol(name + "_dot") for name in names}
    if not symbols_of([expression]).isdisjoint(rates):
        slopes = jacobian([expression], list(rates.values()))
        if not symbols_of(list(slopes.values())).isdisjoint(rates):
            remedy = "write it as a sum of terms a(q, t)*q_dot and b(q, t), with each velocity to the first power"
            reader.faults.add(path, "is not linear in the velocities", remedy, "EG-EXPRESSION")
    return expression


def _forces(reader: Reader, path: str, given: Any, names: list[str]) -> tuple[Expr, ...]:
    """One generalized force for each coordinate; those not given are 0."""
    result = dict.fromkeys(names, reader.graph.zero)
    if isinstance(given, Mapping):
        for name, value in in_order(given, names):
            if name not in result:
                remedy = nearest(shown(name), names, "coordinates")
                reader.faults.add(f"{path}.{name}", f"no coordinate {quoted(name)}", remedy, "EG-NAME-UNKNOWN")
            else:
                result[name] = reader.expression(f"{path}.{name}", value, MOTION)
        return tuple(result.values())
    listed = items(given)
    if listed is None:
        reader.wrong(path, given, kinds.CoordinateForces)
    elif listed and len(listed) != len(names):
        reader.faults.add(
            path, f"{len(listed)} forces for {len(names)} coordinates", "give one for each, in order", "EG-SHAPE"
        )
    elif listed:
        return tuple(reader.expression(f"{path}[{k}]", value, MOTION) for k, value in enumerate(listed))
    return tuple(result.values())
