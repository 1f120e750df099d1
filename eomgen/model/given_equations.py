"""Equations of motion: what Python gives -> Description; the section ``equations`` -> GivenEquations on the graph."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..base.limits.numbers import TENSOR
from ..elements import kinds
from ..elements.kinds import MOTION
from ..expr.core import Expr, substitute, symbols_of
from ..expr.differentiate import jacobian
from ..expr.evaluate import evaluate
from ..expr.shown import quoted, shown
from .checks import check_keys
from .description import Description, Faults, items
from .expressions import names_in
from .fields import EQUATIONS
from .mechanism import GivenEquations, Output
from .names import fault_of_name, nearest
from .printed_names import give_latex, take_coordinates_latex
from .scope import ENERGIES, RATES
from .sympy_face import free_names, function_names, is_sympy, name_of, named, names_of
from .values import Reader


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
    known.add("t")
    declared = ("coordinates", "velocities", "multipliers")
    found = {part for key in given if key not in declared for part in _names_in(given[key])}
    own = {name: value for name, value in values.items() if name not in known}
    description.declare(own, driven, sorted(found - known))
    give_latex(description, "equations", latex)
    return description


def _names_in(value: Any) -> Iterator[str]:
    """Names in all expressions that a value holds; functions of time are coordinates."""
    if isinstance(value, str):
        yield from names_in(value)
    elif is_sympy(value):
        yield from set(free_names([value])) - set(function_names([value]))
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _names_in(part)
    else:
        for part in items(value) or ():
            yield from _names_in(part)


PATH = "equations"
LINEAR = "write it as a sum of terms a(q, t)*v and b(q, t), with each velocity to the first power"


def declare_equations(reader: Reader, given: Any, has_others: bool) -> dict[str, Any] | None:
    """Check the section and take its names into the namespace; None if there is no section."""
    faults = reader.faults
    if given is None:
        return None
    if not isinstance(given, Mapping):
        reader.wrong(PATH, given, kinds.Table)
        return {}
    if has_others:
        remedy = "describe only one: bodies, a Lagrangian, equations"
        faults.add(PATH, "the model has bodies, joints or a Lagrangian too", remedy, "EG-CONFLICT")
    check_keys(PATH, given, EQUATIONS, faults)
    values = dict(given)
    q = values["coordinates"] = _names(reader, values, "coordinates", ())
    v = values["velocities"] = _names(reader, values, "velocities", [f"{name}_dot" for name in q])
    values["multipliers"] = _names(reader, values, "multipliers", ())
    if not q and "coordinates" in given:
        faults.add(f"{PATH}.coordinates", "there are no coordinates", "name at least one", "EG-MISSING")
    if not v and q:
        faults.add(f"{PATH}.velocities", "there are no velocities", "name at least one", "EG-MISSING")
    for k, name in enumerate(q):  # the rate of one that no velocity is follows from the velocities
        kind = "coordinate" if f"{name}_dot" in v else "parameter of rotation"
        reader.names.declare(kind, name, f"{PATH}.coordinates[{k}]")
    own = {f"{name}_dot" for name in q}
    for k, name in enumerate(v):
        if name not in own:
            reader.names.declare("velocity", name, f"{PATH}.velocities[{k}]")
    for k, name in enumerate(values["multipliers"]):
        reader.names.declare("multiplier", name, f"{PATH}.multipliers[{k}]")
    others = [name for name in (*v, *values["multipliers"]) if name not in q]
    take_coordinates_latex(reader, f"{PATH}.latex", q, values.get("latex", ()), others)
    return values


def _names(reader: Reader, values: Mapping[str, Any], key: str, default: Sequence[str]) -> list[str]:
    given = values.get(key)
    if given is None:
        return list(default)
    listed = items(given)
    if listed is None:
        reader.wrong(f"{PATH}.{key}", given, kinds.Names)
        return list(default)
    return [str(name_of(item)) for item in listed]


def build_equations(reader: Reader, values: dict[str, Any] | None) -> GivenEquations | None:
    """The equations of a checked section."""
    if values is None:
        return None
    graph, faults = reader.graph, reader.faults
    q, v, named = values.get("coordinates", []), values.get("velocities", []), values.get("multipliers", [])
    local: dict[str, Expr] = {}
    parts = values.get("intermediates", {})
    if not isinstance(parts, Mapping):
        reader.wrong(f"{PATH}.intermediates", parts, kinds.Rates)
        parts = {}
    for name, part in parts.items():
        fault = fault_of_name(name, symbol=True)
        if fault:
            faults.add(f"{PATH}.intermediates.{name}", *fault, "EG-NAME-FORM")
        elif name in reader.names.kinds:
            message = f"the name is already used by the {reader.names.kinds[name]}"
            faults.add(f"{PATH}.intermediates.{name}", message, "rename one", "EG-NAME-TAKEN")
        local[name] = reader.expression(f"{PATH}.intermediates.{name}", part, MOTION, local)
    rates = _rates(reader, values.get("rates"), q, v, local)
    derived = {f"{name}_dot": rate for name, rate in zip(q, rates, strict=True) if f"{name}_dot" not in v}
    mapping = {graph.symbol(name): rate for name, rate in derived.items()}

    def read(path: str, value: Any) -> Expr:
        expression = reader.expression(path, value, MOTION, local)
        return substitute([expression], mapping)[0] if not symbols_of([expression]).isdisjoint(derived) else expression

    def listed(key: str, size: int | None) -> tuple[Expr, ...]:
        path, given = f"{PATH}.{key}", values.get(key, ())
        parts = items(given)
        if parts is None:
            reader.wrong(path, given, kinds.Scalars)
            return ()
        if size is not None and len(parts) != size and key in values:
            faults.add(
                path, f"{len(parts)} expressions for {size} velocities", "give one for each, in order", "EG-SHAPE"
            )
        return tuple(read(f"{path}[{k}]", part) for k, part in enumerate(parts))

    rows: list[tuple[Expr, ...]] = []
    given = values.get("mass_matrix", ())
    lines = items(given)
    if lines is None or any(items(line) is None for line in lines):
        reader.wrong(f"{PATH}.mass_matrix", given, kinds.Matrix)
        lines = []
    for i, line in enumerate(lines):
        parts = items(line) or []
        rows.append(tuple(read(f"{PATH}.mass_matrix[{i}][{j}]", part) for j, part in enumerate(parts)))
    if "mass_matrix" in values and {len(rows), *map(len, rows)} != {len(v)}:
        if not faults.under(f"{PATH}.mass_matrix"):
            shape = f"{len(rows)} x {max(map(len, rows), default=0)}"
            remedy = f"give {len(v)} rows of {len(v)}"
            faults.add(f"{PATH}.mass_matrix", f"is {shape} for {len(v)} velocities", remedy, "EG-SHAPE")
    elif not faults.under(f"{PATH}.mass_matrix"):
        _check_mass_matrix(reader, rows, v)
    constraints = listed("constraints", None)
    for k, constraint in enumerate(constraints):
        _check_linear(reader, f"{PATH}.constraints[{k}]", constraint, v)
        if constraint.is_zero:
            faults.add(
                f"{PATH}.constraints[{k}]",
                "is 0 for every motion, so it constrains nothing",
                "leave it out",
                "EG-REDUNDANT",
            )
    if named and len(named) != len(constraints):
        message = f"{len(named)} names for {len(constraints)} constraints"
        faults.add(f"{PATH}.multipliers", message, "name one for each constraint, in order", "EG-SHAPE")
    kinetic, potential = (read(f"{PATH}.{key}", values.get(key, 0)) for key in ("kinetic_energy", "potential_energy"))
    forcing = listed("forcing", len(v))
    return GivenEquations(
        tuple(q), tuple(v), rates, tuple(rows), forcing, constraints, tuple(named), kinetic, potential
    )


def check_energies(given: GivenEquations | None, outputs: Sequence[Output], faults: Faults) -> None:
    """Note outputs of an energy that given equations do not know."""
    if given is None or not given.kinetic_energy.is_zero:
        return
    for output in outputs:
        for name in sorted(symbols_of([output.expression]) & {f"{energy}()" for energy in ENERGIES}):
            message = f"{name.removesuffix('()')} is not known, because the equations are given without kinetic_energy"
            faults.add(f"outputs.{output.name}", message, f"give {PATH}.kinetic_energy", "EG-MISSING")


def _rates(
    reader: Reader, given: Any, q: Sequence[str], v: Sequence[str], local: Mapping[str, Expr]
) -> tuple[Expr, ...]:
    """q' in terms of the velocities."""
    path, faults = f"{PATH}.rates", reader.faults
    if given is None:
        if len(q) != len(v):
            faults.add(
                path, f"{len(v)} velocities for {len(q)} coordinates", "give the rate of each coordinate", "EG-SHAPE"
            )
        symbols = [reader.graph.symbol(name) for name in v[: len(q)]]
        return (*symbols, *(reader.stand_in,) * (len(q) - len(symbols)))
    if not isinstance(given, Mapping):
        reader.wrong(path, given, kinds.Rates)
        return (reader.stand_in,) * len(q)
    named = {name_of(key): value for key, value in given.items()}
    for name in named:
        if name not in q:
            remedy = nearest(shown(name), q, "coordinates")
            faults.add(f"{path}.{name}", f"no coordinate {quoted(name)}", remedy, "EG-NAME-UNKNOWN")
    result = []
    own = {f"{name}_dot" for name in q} - set(v)
    for name in q:
        value: Any = named.get(name, f"{name}_dot" if f"{name}_dot" in v else None)
        if value is None:
            faults.add(path, f"{name!r} has no rate", f"give the rate of {name!r}", "EG-MISSING")
        rate = reader.stand_in if value is None else reader.expression(f"{path}.{name}", value, MOTION, local)
        if not symbols_of([rate]).isdisjoint(own):
            faults.add(
                f"{path}.{name}", "depends on rates of coordinates", f"write it in {', '.join(v)}", "EG-EXPRESSION"
            )
        _check_linear(reader, f"{path}.{name}", rate, v)
        result.append(rate)
    return tuple(result)


def _check_linear(reader: Reader, path: str, expression: Expr, v: Sequence[str]) -> None:
    if symbols_of([expression]).isdisjoint(v):
        return
    slopes = jacobian([expression], [reader.graph.symbol(name) for name in v])
    if not symbols_of(list(slopes.values())).isdisjoint(v):
        reader.faults.add(path, "is not linear in the velocities", LINEAR, "EG-EXPRESSION")


def _check_mass_matrix(reader: Reader, rows: Sequence[Sequence[Expr]], v: Sequence[str]) -> None:
    """Note a mass matrix that depends on velocities or is not symmetric."""
    flat = [entry for row in rows for entry in row]
    used = symbols_of(flat)
    moving = sorted(used & set(v))
    if moving:
        reader.faults.add(
            f"{PATH}.mass_matrix", f"depends on {', '.join(moving)}", "allowed are q, t and parameters", "EG-EXPRESSION"
        )
        return
    n = len(rows)
    values = {name: 0.37 + 0.61 * ((k * 0.618033988749895) % 1.0) for k, name in enumerate(sorted(used))}
    numbers = [float(x) for x in evaluate(flat, values)]
    size = max((abs(x) for x in numbers if math.isfinite(x)), default=0.0)
    for i in range(n):
        for j in range(i):
            gap = abs(numbers[i * n + j] - numbers[j * n + i])
            if gap > TENSOR * size:  # false where an entry is not finite there
                message = f"is not symmetric: entries ({i}, {j}) and ({j}, {i}) differ"
                remedy = "give the symmetric M of M v' = f, where f contains all forces"
                reader.faults.add(f"{PATH}.mass_matrix", message, remedy, "EG-INERTIA")
                return
