"""Models without bodies: equations M v' = f, or a Lagrangian, whose equations follow -> GivenEquations on the graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base.limits.numbers import TENSOR
from ..base.operations import CONDITION, operations_with
from ..elements import kinds
from ..elements.constraints.constraint import NO_EQUATION, POSITION, Constraint, Equation
from ..elements.constraints.drivers import Driver
from ..elements.kinds import MOTION, Fields
from ..expr.core import Expr, Graph, is_comparison, reachable, substitute, symbols_of
from ..expr.differentiate import gradient, hessian, jacobian, jvp
from ..expr.evaluate import evaluate
from ..expr.identity import vanishes
from ..expr.notation import rate_of, split_rate
from .checks import check_keys
from .description import Description, Faults, items
from .expressions import names_in
from .fields import EQUATIONS, LAGRANGIAN
from .mechanism import Event, GivenEquations, Input, Lagrangian, Output, Switched
from .names import ENERGIES, RATES, fault_of_name
from .sympy_face import (
    SympyNames,
    derivative_names,
    free_names,
    function_names,
    in_order,
    name_of,
    named,
    names_of,
    one_or_several,
    values_in,
)
from .values import MULTIPLIERS, Reader, give_latex, numbered, take_coordinates_latex

# -- what Python gives -------------------------------------------------------------------------------------------------


#: Keys of names, and what each is.
_NAMES = {"coordinates": "a coordinate", "velocities": "a velocity", "multipliers": "a multiplier"}


def describe(name: str, section: str, raw: Mapping[str, Any]) -> Description:
    """Describe a system by a Lagrangian or by equations; ``raw`` has values of the section and of other arguments.

    Of the names in the section those that it does not declare are parameters, unless they are inputs.
    """
    coordinates = one_or_several(raw["coordinates"])
    changed = SympyNames({key: x for key, x in raw.items() if key != "latex"}, coordinates)
    raw, latex = changed.put({**raw, "coordinates": coordinates}), changed.latex(raw.get("latex"))
    values: dict[str, Any] = {}
    for key, field in (LAGRANGIAN if section == "lagrangian" else EQUATIONS).items():
        value = _raw_value(section, key, raw.get(key))
        empty = isinstance(value, list | tuple | dict) and not value and not field.required
        if key != "latex" and value is not None and not empty:
            values[key] = value
    parameters, inputs = named("parameters", raw.get("parameters")), named("inputs", raw.get("inputs"))
    known = {part + rate for key in ("coordinates", "velocities") for part in values.get(key, ()) for rate in RATES}
    known |= {*values.get("intermediates", ()), *values.get("multipliers", ())}
    if section == "lagrangian":  # which contains derivatives of inputs by time
        stems = {split_rate(source)[0] for source in inputs}
        used = {*_names_of_section(values), *derivative_names([*values_in(values)])} - {*known, *parameters, *inputs}
        inputs |= dict.fromkeys(name for name in sorted(used) if split_rate(name)[0] in stems)
    known |= {*inputs}
    description = Description(values={"name": name, section: values})
    declared = {name: value for name, value in parameters.items() if name not in known}
    description.declare(declared, inputs, [name for name in _names_of_section(values) if name not in known])
    give_latex(description, section, latex)
    return changed.noted(description)


def _raw_value(section: str, key: str, value: Any) -> Any:
    """A value as a model file would write it: names as texts, arrays as lists."""
    if key in _NAMES:
        return names_of(f"{section}.{key}", value, _NAMES[key])
    if isinstance(value, Mapping) or key in ("rates", "intermediates"):
        return named(key, value)
    listed = items(value)
    if key != "mass_matrix" or not listed:
        return listed or value
    rows = [items(row) for row in listed]
    return rows if any(row is not None for row in rows) else [listed]  # SymPy's 1 x 1 matrix counts as a plain list


def _names_of_section(raw: Mapping[str, Any]) -> list[str]:
    """Names in the expressions of a section; functions of time are coordinates or faults, never parameters."""
    declared = ("coordinates", "velocities", "multipliers")
    result: set[str] = set()
    for part in values_in({key: value for key, value in raw.items() if key not in declared}):
        result |= names_in(part) if isinstance(part, str) else {*free_names([part])} - {*function_names([part])}
    return sorted(result - {"t"})


# -- the sections of a model file --------------------------------------------------------------------------------------
def _section(reader: Reader, path: str, raw: Any, has_others: bool, fields: Fields) -> dict[str, Any] | None:
    """A checked section, its coordinates by name; empty if it is no mapping, None if there is none."""
    if raw is None:
        return None
    if not isinstance(raw, Mapping):
        reader.wrong(path, raw, kinds.Table)
        return {}
    if has_others:
        remedy = "describe only one: bodies, a Lagrangian, equations"
        reader.fault(path, "the model has bodies, joints or another such section too", remedy, "EG-CONFLICT")
    check_keys(path, raw, fields, reader.faults)
    values = dict(raw)
    values["coordinates"] = _names(reader, path, values, "coordinates", ())
    if not values["coordinates"] and "coordinates" in raw:
        reader.fault(f"{path}.coordinates", "there are no coordinates", "name at least one", "EG-MISSING")
    return values


def _names(reader: Reader, path: str, values: Mapping[str, Any], key: str, default: Sequence[str]) -> list[str]:
    raw = values.get(key)
    if raw is None:
        return list(default)
    listed = items(raw)
    if listed is None:
        reader.wrong(f"{path}.{key}", raw, kinds.Names)
        return list(default)
    return [str(name_of(item)) for item in listed]


def _expressions(reader: Reader, path: str, raw: Any, read: Callable[[str, Any], Expr]) -> tuple[Expr, ...]:
    """The expressions of a list."""
    listed = items(raw)
    if listed is None:
        reader.wrong(path, raw, kinds.Scalars)
    return tuple(read(f"{path}[{k}]", part) for k, part in enumerate(listed or ()))


def _check_constraint(reader: Reader, path: str, expression: Expr, v: Sequence[str]) -> None:
    """Note a comparison, or an expression of velocities that is not linear in them."""
    if is_comparison(expression):
        reader.fault(path, *NO_EQUATION)
    else:
        _check_linear(reader, path, expression, v)


def _check_linear(reader: Reader, path: str, expression: Expr, v: Sequence[str]) -> None:
    if symbols_of([expression]).isdisjoint(v):
        return
    slopes = jacobian([expression], [reader.graph.symbol(name) for name in v])
    if not symbols_of(list(slopes.values())).isdisjoint(v):
        remedy = "write it as a sum of terms a(q, t)*v and b(q, t), with each velocity v to the first power"
        reader.fault(path, "is not linear in the velocities", remedy, "EG-EXPRESSION")


# -- a Lagrangian ------------------------------------------------------------------------------------------------------
def declare_lagrangian(reader: Reader, raw: Any, has_bodies: bool) -> dict[str, Any] | None:
    """Check the section and take its coordinates into the namespace; None if there is no section."""
    values = _section(reader, "lagrangian", raw, has_bodies, LAGRANGIAN)
    if not values:
        return values
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

    def read(place: str, value: Any) -> Expr:
        return reader.expression(place, value, MOTION)

    expression = read(f"{path}.expression", values["expression"]) if "expression" in values else reader.graph.zero
    dissipation = read(f"{path}.dissipation", values.get("dissipation", 0))
    forces = _forces(reader, f"{path}.forces", values.get("forces", ()), names)
    rows = _expressions(reader, f"{path}.constraints", values.get("constraints", ()), read)
    for k, row in enumerate(rows):
        _check_constraint(reader, f"{path}.constraints[{k}]", row, [f"{name}_dot" for name in names])
    return Lagrangian(tuple(names), expression, forces, dissipation, rows)


def _forces(reader: Reader, path: str, raw: Any, names: list[str]) -> tuple[Expr, ...]:
    """One generalized force for each coordinate; those not given are 0."""
    result = dict.fromkeys(names, reader.graph.zero)
    if isinstance(raw, Mapping):
        for name, value in in_order(raw, names):
            if name not in result:
                reader.unknown(f"{path}.{name}", "coordinate", name, names, "coordinates")
            else:
                result[name] = reader.expression(f"{path}.{name}", value, MOTION)
        return tuple(result[name] for name in names)
    listed = items(raw)
    if listed is None:
        reader.wrong(path, raw, kinds.CoordinateForces)
    elif listed and len(listed) != len(names):
        reader.fault(
            path, f"{len(listed)} forces for {len(names)} coordinates", "give one for each, in order", "EG-SHAPE"
        )
    elif listed:
        return tuple(reader.expression(f"{path}[{k}]", value, MOTION) for k, value in enumerate(listed))
    return tuple(result[name] for name in names)


def momenta_and_rates(bare: Lagrangian, q: Sequence[Expr], v: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
    """p = dL/dv and p' = dL/dq + Q - dD/dv."""
    slopes, drag = gradient(bare.expression, list(q)), gradient(bare.dissipation, list(v))
    rates = [s + (f - d) for s, f, d in zip(slopes, bare.forces, drag, strict=True)]
    return gradient(bare.expression, list(v)), rates


def differentiate(graph: Graph, bare: Lagrangian, clock: Mapping[Expr, Expr]) -> GivenEquations:
    """Lagrange's equations d/dt (dL/dv) - dL/dq = Q - dD/dv as M v' = f (Shabana, Computational Dynamics, sec. 4.4).

    T holds the terms of L of second degree in the velocities, and V = -L(v = 0): T + V is then the energy
    v . dL/dv - L, in which terms linear in the velocities cancel.  ``clock`` has the rates of all that is prescribed.
    """
    L, velocities = bare.expression, tuple(f"{name}_dot" for name in bare.coordinates)
    q, v = ([graph.symbol(name) for name in names] for names in (bare.coordinates, velocities))
    momenta, rates = momenta_and_rates(bare, q, v)
    drift = jvp(momenta, {**dict(zip(q, v, strict=True)), **clock})
    mass = hessian(momenta, v)
    kinetic = potential = graph.zero
    if symbols_of([x for row in mass for x in row]).isdisjoint(velocities):  # else it is refused
        at_rest, *first_degree = substitute([L, *momenta], dict.fromkeys(v, graph.zero))
        kinetic, potential = L - at_rest, -at_rest
        if not all(vanishes(first_degree)):
            kinetic = graph.zero
            for rate, inertial in zip(v, jvp(momenta, dict(zip(v, v, strict=True))), strict=True):  # M v
                kinetic = kinetic + 0.5 * (rate * inertial)
    forcing = tuple(-(d - r) for d, r in zip(drift, rates, strict=True))
    return GivenEquations(
        bare.coordinates, velocities, tuple(v), mass, forcing, bare.constraints, (), kinetic, potential
    )


def require_quadratic(reader: Reader, raw: GivenEquations) -> None:
    """Refuse a Lagrangian whose mass matrix d2L/(dq_dot dq_dot) depends on velocities: kernels take M(q, t)."""
    used = symbols_of([x for row in raw.mass_matrix for x in row])
    result = [rate for rate in raw.velocities if rate in used]
    if result:
        reader.fault(
            "lagrangian.expression",
            "is not quadratic in the velocities: the mass matrix (its second derivatives by them) depends on "
            + ", ".join(result),
            "write T as a sum of terms m(q, t)*a_dot*b_dot, b(q, t)*a_dot and c(q, t), with all products expanded; for "
            "another kind of Lagrangian give the equations of motion: `equations:` of a model file, with mass_matrix "
            "1 and the accelerations as forcing",
            "EG-EXPRESSION",
        )


# -- equations ---------------------------------------------------------------------------------------------------------
PATH = "equations"


def declare_equations(reader: Reader, raw: Any, has_others: bool) -> dict[str, Any] | None:
    """Check the section and take its names into the namespace; None if there is no section."""
    faults, values = reader.faults, _section(reader, PATH, raw, has_others, EQUATIONS)
    if not values:
        return values
    q = values["coordinates"]
    v = values["velocities"] = _names(reader, PATH, values, "velocities", [f"{name}_dot" for name in q])
    values["multipliers"] = _names(reader, PATH, values, "multipliers", ())
    if not v and q:
        faults.add(f"{PATH}.velocities", "there are no velocities", "name at least one", "EG-MISSING")
    for k, name in enumerate(q):  # the rate of one that no velocity is follows from the velocities
        kind = "coordinate" if f"{name}_dot" in v else "parameter of rotation"
        reader.names.declare(kind, name, f"{PATH}.coordinates[{k}]")
    rates = {f"{name}_dot" for name in q}
    for k, name in enumerate(v):
        if name not in rates:
            reader.names.declare("velocity", name, f"{PATH}.velocities[{k}]")
    for k, name in enumerate(values["multipliers"]):
        reader.names.declare("multiplier", name, f"{PATH}.multipliers[{k}]")
    others = [name for name in (*v, *values["multipliers"]) if name not in q]
    take_coordinates_latex(reader, f"{PATH}.latex", q, values.get("latex", ()), others)
    return values


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

    raw = values.get("mass_matrix", ())
    lines = items(raw)
    if lines is None or any(items(line) is None for line in lines):
        reader.wrong(f"{PATH}.mass_matrix", raw, kinds.Matrix)
        lines = []
    rows = tuple(_expressions(reader, f"{PATH}.mass_matrix[{i}]", line, read) for i, line in enumerate(lines))
    if "mass_matrix" in values and {len(rows), *map(len, rows)} != {len(v)}:
        if not faults.under(f"{PATH}.mass_matrix"):
            shape = f"{len(rows)} x {max(map(len, rows), default=0)}"
            remedy = f"give {len(v)} rows of {len(v)}"
            faults.add(f"{PATH}.mass_matrix", f"is {shape} for {len(v)} velocities", remedy, "EG-SHAPE")
    elif not faults.under(f"{PATH}.mass_matrix"):
        _check_mass_matrix(reader, rows, v)
    constraints = _expressions(reader, f"{PATH}.constraints", values.get("constraints", ()), read)
    for k, constraint in enumerate(constraints):
        _check_constraint(reader, f"{PATH}.constraints[{k}]", constraint, v)
        if constraint.is_zero:
            message = "is 0 for every motion, so it constrains nothing"
            faults.add(f"{PATH}.constraints[{k}]", message, "leave it out", "EG-REDUNDANT")
    if named and len(named) != len(constraints):
        message = f"{len(named)} names for {len(constraints)} constraints"
        faults.add(f"{PATH}.multipliers", message, "name one for each constraint, in order", "EG-SHAPE")
    kinetic, potential = (read(f"{PATH}.{key}", values.get(key, 0)) for key in ("kinetic_energy", "potential_energy"))
    forcing = _expressions(reader, f"{PATH}.forcing", values.get("forcing", ()), read)
    if len(forcing) != len(v) and items(values.get("forcing")) is not None:
        message = f"{len(forcing)} expressions for {len(v)} velocities"
        faults.add(f"{PATH}.forcing", message, "give one for each, in order", "EG-SHAPE")
    return GivenEquations(tuple(q), tuple(v), rates, rows, forcing, constraints, tuple(named), kinetic, potential)


def check_energies(raw: GivenEquations | None, outputs: Sequence[Output], faults: Faults) -> None:
    """Note outputs of an energy that given equations do not know."""
    if raw is None or not raw.kinetic_energy.is_zero:
        return
    for output in outputs:
        for name in sorted(symbols_of([output.expression]) & {f"{energy}()" for energy in ENERGIES}):
            message = f"{name.removesuffix('()')} is not known, because the equations are given without kinetic_energy"
            faults.add(f"outputs.{output.name}", message, f"give {PATH}.kinetic_energy", "EG-MISSING")


def _rates(reader: Reader, raw: Any, q: Sequence[str], v: Sequence[str], local: Mapping[str, Expr]) -> tuple[Expr, ...]:
    """q' in terms of the velocities."""
    path, faults = f"{PATH}.rates", reader.faults
    if raw is None:
        if len(q) != len(v):
            faults.add(
                path, f"{len(v)} velocities for {len(q)} coordinates", "give the rate of each coordinate", "EG-SHAPE"
            )
        symbols = [reader.graph.symbol(name) for name in v[: len(q)]]
        return (*symbols, *(reader.stand_in,) * (len(q) - len(symbols)))
    if not isinstance(raw, Mapping):
        reader.wrong(path, raw, kinds.Rates)
        return (reader.stand_in,) * len(q)
    named = {name_of(key): value for key, value in raw.items()}
    for name in named:
        if name not in q:
            reader.unknown(f"{path}.{name}", "coordinate", name, q, "coordinates")
    result = []
    rates = {f"{name}_dot" for name in q} - set(v)
    for name in q:
        value: Any = named.get(name, f"{name}_dot" if f"{name}_dot" in v else None)
        if value is None:
            faults.add(path, f"{name!r} has no rate", f"give the rate of {name!r}", "EG-MISSING")
        rate = reader.stand_in if value is None else reader.expression(f"{path}.{name}", value, MOTION, local)
        if not symbols_of([rate]).isdisjoint(rates):
            faults.add(
                f"{path}.{name}", "depends on rates of coordinates", f"write it in {', '.join(v)}", "EG-EXPRESSION"
            )
        _check_linear(reader, f"{path}.{name}", rate, v)
        result.append(rate)
    return tuple(result)


def _check_mass_matrix(reader: Reader, rows: Sequence[Sequence[Expr]], v: Sequence[str]) -> None:
    """Note a mass matrix that depends on velocities or is not symmetric."""
    flat = [entry for row in rows for entry in row]
    used = symbols_of(flat)
    moving = sorted(used & set(v))
    if moving:
        reader.fault(
            f"{PATH}.mass_matrix", f"depends on {', '.join(moving)}", "allowed are q, t and parameters", "EG-EXPRESSION"
        )
        return
    values = {name: 0.37 + 0.61 * ((k * 0.618033988749895) % 1.0) for k, name in enumerate(sorted(used))}
    numbers = [float(x) for x in evaluate(flat, values)]
    size = max((abs(x) for x in numbers if math.isfinite(x)), default=0.0)
    for i, j in ((a, b) for a in range(len(rows)) for b in range(a)):
        gap = abs(numbers[i * len(rows) + j] - numbers[j * len(rows) + i])
        if gap > TENSOR * size:  # false where an entry is not finite there
            message = f"is not symmetric: entries ({i}, {j}) and ({j}, {i}) differ"
            remedy = "give the symmetric M of M v' = f, where f contains all forces"
            reader.fault(f"{PATH}.mass_matrix", message, remedy, "EG-INERTIA")
            return


# -- rates of inputs ---------------------------------------------------------------------------------------------------


#: Expressions, how often they are differentiated by time, what they are, and where they stand.
Differentiated = tuple[list[Expr], int, str, str | None]


def jumps_in_time(expressions: Sequence[Expr]) -> bool:
    """Whether an expression jumps where a comparison, linear in t and free of coordinates, changes.

    Comparisons that are not linear in t, or that look at coordinates, are not judged.
    """
    if not expressions:
        return False
    graph = expressions[0].graph
    t = graph.symbol("t")
    compared = operations_with(lambda row: row.kind == CONDITION and row.jumps)
    for i in reachable(graph, [x.id for x in expressions]):
        operation, *operands = graph.nodes[i]
        if operation not in compared:
            continue
        apart = Expr(graph, operands[0]) - Expr(graph, operands[1])
        slope = gradient(apart, [t])[0]
        if slope.is_zero or "t" in symbols_of([slope]):
            continue
        when = t - apart / slope  # without t: apart is linear in it
        before, after = (substitute(list(expressions), {Expr(graph, i): x}) for x in (graph.zero, graph.one))
        changes = [a - b for a, b in zip(after, before, strict=True)]
        there = substitute(changes, {t: substitute([when], {t: graph.zero})[0]})
        if not all(vanishes(there, pieces=True, unknown=True)):
            return True
    return False


def clock(graph: Graph, inputs: Sequence[Input]) -> dict[Expr, Expr]:
    """The direction of d/dt of what is prescribed: t' = 1, and the rate of every input."""
    rates = {graph.symbol(u.name): graph.symbol(rate_of(u.name)) for u in inputs}
    return {graph.symbol("t"): graph.one, **rates}


def add_rates(reader: Reader, inputs: tuple[Input, ...], differentiated: Sequence[Differentiated]) -> tuple[Input, ...]:
    """The inputs, and those rates of them that the equations need; all rates with their expressions over time.

    A rate that is declared as an input already stays where it is.  Faults are noted: a name that is taken, a rate that
    would need accelerations.
    """
    needed: dict[str, str] = {}
    for expressions, _, why, place in differentiated:
        if place is not None and jumps_in_time(expressions):
            message = f"{why} must have a derivative by time, and a condition on t makes it jump"
            reader.fault(
                place, message, "such a jump is an impact: write it smoothly, or as an event with a reset", "EG-JUMP"
            )
    for expressions, times, why, _ in differentiated:
        for name in sorted(symbols_of(expressions) & {u.name for u in inputs}):
            for k in range(1, times + 1):
                needed.setdefault(rate_of(name, k), f"input {name!r}, whose rate {why} needs")
    names = {u.name for u in inputs}
    added = []
    for rate, why in needed.items():
        if rate in names:
            continue
        base = next(u for u in inputs if split_rate(u.name)[0] == split_rate(rate)[0])
        kind = reader.names.kinds.get(rate)
        if kind is not None:
            message = f"the name is reserved for the rate of {why}"
            reader.fault(reader.names.places[rate], message, f"rename the {kind}, or the input", "EG-NAME-TAKEN")
            continue
        reader.names.declare("input", rate, f"inputs.{base.name}")
        unit = f"{base.unit}/s^{k}" if (k := split_rate(rate)[1]) > 1 else f"{base.unit}/s"
        doc = f"rate of {base.name}" if k == 1 else f"derivative {k} of {base.name} by time"
        added.append(Input(rate, 0.0, unit if base.unit else "", doc))
    return _with_signals(reader, (*inputs, *added))


def list_differentiated(
    reader: Reader,
    lagrangian: Lagrangian | None,
    raw: GivenEquations | None,
    constraints: Sequence[Constraint],
    switched: Sequence[Switched],
    events: Sequence[Event],
    outputs: Sequence[Output],
) -> list[Differentiated]:
    """Expressions that the equations differentiate by time.

    The place is None for drivers, whose jumps are told by the runs that they lead, and for constraints that close for a
    time, whose errors die away.
    """
    symbol = reader.graph.symbol
    result: list[Differentiated] = []
    if lagrangian is not None:
        v = [symbol(f"{name}_dot") for name in lagrangian.coordinates]
        result.append((gradient(lagrangian.expression, v), 1, "d/dt (dL/dq_dot)", "lagrangian"))
    if raw is not None:
        rates = {f"{name}_dot" for name in raw.coordinates} | set(raw.velocities)
        positions = [e for e in raw.constraints if symbols_of([e]).isdisjoint(rates)]
        velocities = [e for e in raw.constraints if not symbols_of([e]).isdisjoint(rates)]
        section = f"{'equations' if lagrangian is None else 'lagrangian'}.constraints"
        result += [(positions, 2, "a constraint", section), (velocities, 1, "a constraint of velocities", section)]
    if raw is not None and lagrangian is None:
        seconds = {f"{name}_ddot" for name in raw.coordinates}
        in_outputs = not symbols_of([o.expression for o in outputs]).isdisjoint(seconds)
        if positions or in_outputs:
            result.append((list(raw.rates), 1, "q'' of the given rates", "equations.rates"))
    for_a_time = [switch.constraint for switch in switched if switch.constraint is not None]
    for c in (*constraints, *for_a_time):
        if isinstance(c, Driver):
            result.append(([c.value], 2, f"the driver {c.name!r}", None))
        elif isinstance(c, Equation):
            times = 2 if c.level == POSITION else 1
            place = None if c in for_a_time else f"constraints.{c.name}"
            result.append(([c.expression], times, f"the constraint {c.name!r}", place))
    hits = [e for e in events if e.restitution is not None]
    result += [([e.expression], 1, f"the gap {e.name!r}", f"events.{e.name}") for e in hits]
    return result


def _with_signals(reader: Reader, inputs: tuple[Input, ...]) -> tuple[Input, ...]:
    """Rates of inputs with an expression over time get its derivative, where they have none of their own."""
    signals = {u.name: u.signal for u in inputs if u.signal is not None}
    for base, rates in chains([u.name for u in inputs]).items():
        last = base
        for rate in rates if base in signals else ():
            if rate not in signals:
                result: Expr | None = signals[last]
                for k in range(split_rate(rate)[1] - split_rate(last)[1]):
                    result = None if result is None else _rate_of_signal(reader, result, last, k)
                if result is None:
                    return inputs
                signals[rate] = result
            last = rate
    return tuple(replace(u, signal=signals[u.name]) if u.name in signals else u for u in inputs)


def _rate_of_signal(reader: Reader, signal: Expr, name: str, order: int) -> Expr | None:
    """The derivative by time of an expression of t, coordinates, velocities and parameters; faults are noted."""
    kinds, symbol = reader.names.kinds, reader.graph.symbol
    along: Mapping[str, str] = {
        n: f"{n}_dot" for n in symbols_of([signal]) if kinds.get(n) not in ("time", "parameter", None)
    }
    for state in sorted(along):
        if kinds.get(along[state]) != "velocity":
            message = (
                f"{rate_of(name, order + 1)} is needed, but the signal depends on {state!r}, whose rate is not "
                "a velocity"
            )
            reader.fault(f"inputs.{name}.signal", message, "write it in t and parameters", "EG-UNSUPPORTED")
            return None
    direction = {symbol(n): symbol(rate) for n, rate in along.items()}
    return jvp([signal], {symbol("t"): reader.graph.one, **direction})[0]


def chains(names: Iterable[str]) -> dict[str, list[str]]:
    """The rates that are inputs too, by the name of each input that has some, in order: first, second, ..."""
    known = list(names)
    orders: dict[str, dict[int, str]] = {}
    for name in known:
        stem, order = split_rate(name)
        orders.setdefault(stem, {})[order] = name
    return {
        by_order[k]: [by_order[j] for j in sorted(by_order) if j > k]
        for by_order in orders.values()
        for k in sorted(by_order)[:-1]
    }
