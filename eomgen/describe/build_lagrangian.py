"""The lagrangian section -> Lagrangian on the graph."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..elements import kinds
from ..elements.kinds import MOTION
from ..graph.core import Expr, symbols_of
from ..graph.differentiate import jacobian
from ..graph.shown import quoted, shown
from .checks import check_keys
from .description import items
from .fields import LAGRANGIAN
from .mechanism import Lagrangian
from .names import nearest
from .printed_names import MULTIPLIERS, numbered, take_coordinates_latex
from .sympy_face import in_order, name_of
from .values import Reader


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
