"""Importers, SymPy's mechanics: a formed method or a System -> Description of its equations."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base import algebra
from ..base.limits.constraints import FURTHER_ROWS as SMALL
from ..base.limits.numbers import ROUNDED
from ..errors import ExpressionError, ModelError, Problem, ill_typed, incomplete
from ..expr.core import Expr, Graph, substitute, symbols_of
from ..expr.differentiate import jacobian, jvp
from ..expr.evaluate import evaluate
from ..expr.identity import with_bounds
from ..expr.notation import rate_of
from ..model.description import Description
from ..model.names import RATES, nearest
from ..model.sympy_face import (
    SympyNames,
    function_name,
    is_sympy,
    lower_sympy,
    name_of,
    named,
    names_of,
    one_or_several,
    sympy_name,
    with_sympy,
)
from ..model.values import give_latex


@dataclass
class Forms:
    """M v' + C_q^T l = f, q' in terms of v, configuration constraints and constraints of velocities, all in SymPy."""

    q: list[Any]
    v: list[Any]
    rates: dict[Any, Any]  #: q' -> expression
    mass_matrix: list[list[Any]]
    forcing: list[Any]
    configuration: list[Any]
    motion: list[Any]
    kinetic: Any
    potential: Any
    multipliers: list[str] = field(default_factory=list)  #: SymPy's own names
    noncontributing: list[Any] = field(default_factory=list)  #: equations of auxiliary speeds, each = 0
    intermediates: dict[Any, Any] = field(default_factory=dict)  #: symbol -> part of the equations
    masses: list[Any] = field(default_factory=list)  #: symbols of the masses of the bodies
    notes: list[str] = field(default_factory=list)


def read_forms(method: Any) -> Forms:
    """The equations of a method object; UsageError for another object, or equations that are not formed yet."""
    from sympy.physics.mechanics import JointsMethod, KanesMethod, LagrangesMethod, System

    for kind, part in ((System, "eom_method"), (JointsMethod, "method")):
        if isinstance(method, kind):
            if (inner := getattr(method, part)) is None:
                raise incomplete(f"the {kind.__name__} has no equations yet; call form_eoms() on it first")
            return read_forms(inner)
    if isinstance(method, KanesMethod):
        return _read_kane(method)
    if isinstance(method, LagrangesMethod):
        return _read_lagrange(method)
    known = "KanesMethod, LagrangesMethod, System, JointsMethod"
    raise ill_typed(f"from_sympy takes SymPy's {known} with its equations formed, not {type(method).__name__}")


def _read_lagrange(method: Any) -> Forms:
    """SymPy forms M q'' = f + lam_coeffs^T lam, lam_coeffs = -d(constraints')/dq'."""
    from sympy import Matrix, S

    if method.eom is None:
        raise incomplete("the LagrangesMethod has no equations yet; call form_lagranges_equations() on it first")
    q = list(method.q)
    v = list(method._qdots)
    n, holonomic = len(q), list(method._hol_coneqs)
    lagrangian = method._L[0]  # there is no public name for it
    still = dict.fromkeys(v, S.Zero)
    at_rest = lagrangian.xreplace(still)
    mass, kinetic, notes = method.mass_matrix[:, :n], lagrangian - at_rest, list[str]()
    if not all(lagrangian.diff(x).xreplace(still).is_zero for x in v):  # terms linear in v are no energy
        kinetic = (Matrix(v).T * mass * Matrix(v))[0] / 2
        notes.append(
            "L has terms linear in the velocities; T, momenta and lagrangian of the equations are without them"
        )
    return Forms(
        q=q,
        v=v,
        rates=dict(zip(v, v, strict=True)),
        mass_matrix=mass.tolist(),
        forcing=list(method.forcing),
        configuration=holonomic,
        motion=list(method.coneqs)[len(holonomic) :],
        kinetic=kinetic,
        potential=-at_rest,
        multipliers=[x.func.__name__ for x in method.lam_vec],
        notes=notes,
    )


def _read_kane(method: Any) -> Forms:
    from sympy import S, Symbol

    if method._fr is None or method._frstar is None:
        raise incomplete("the KanesMethod has no equations yet; call kanes_equations(bodies, loads) on it first")
    q, v = list(method.q), list(method.u)
    whole, parts = method, dict[Any, Any]()
    if len(method._udep) or not method._k_kqdot_implicit.is_diagonal():
        whole, parts = _of_all_speeds(method)
    rates = whole.kindiffdict()
    named = {x: Symbol(name_of(x)) for x in parts}
    auxiliary = dict.fromkeys([*method._uaux, *(x.diff(*x.args) for x in method._uaux)], S.Zero)
    bodies = list(method.bodies)
    kinetic = sum((body.kinetic_energy(method._inertial) for body in bodies), S.Zero)
    potential = sum((body.potential_energy for body in bodies), S.Zero)
    order = [v.index(rate) for rate in (rates[x] for x in method._qdot) if rate in v]  # of q, where all v are rates
    order = order if sorted(order) == list(range(len(v))) else list(range(len(v)))
    kinetic = kinetic.xreplace(rates).xreplace(auxiliary).xreplace(named)
    rates = {dq: rate.xreplace(auxiliary).xreplace(named) for dq, rate in rates.items()}
    motion = []
    if len(method._udep):  # SymPy keeps them after it has put its own q' in, as matrices
        motion = [row.xreplace(auxiliary) for row in method._k_nh * method.u + method._f_nh]
    matrix, forcing = (x.xreplace(auxiliary).xreplace(named) for x in (whole.mass_matrix, whole.forcing))
    return Forms(
        q=q,
        v=[v[k] for k in order],
        rates=rates,
        mass_matrix=[[matrix[i, j] for j in order] for i in order],
        forcing=[forcing[k] for k in order],
        configuration=list(method._f_h),
        motion=motion,
        kinetic=kinetic,
        potential=potential,
        noncontributing=list(method.auxiliary_eqs.xreplace(auxiliary)) if len(method._uaux) else [],
        intermediates={named[x]: part.xreplace(named) for x, part in parts.items()},
        masses=[symbol for body in bodies for symbol in getattr(body.mass, "free_symbols", ())],
    )


def _of_all_speeds(method: Any) -> tuple[Any, dict[Any, Any]]:
    """The same system without its constraints, every speed independent, and the parts of its q' = Z u + z.

    Z = -W K_u, z = -W f of K q' + K_u u + f = 0, W = K^-1.  SymPy puts q' in everywhere, so what varies of W, Z, z and
    their rates Z' = -W (K' Z + K_u'), z' = -W (K' z + f') are functions of time, whose values stand beside.
    """
    from sympy import Function, eye
    from sympy.physics.mechanics import KanesMethod, dynamicsymbols

    left, right, rest = method._k_kqdot_implicit, method._k_ku_implicit, method._f_k_implicit
    n, t, parts = len(method.q), dynamicsymbols._t, dict[Any, Any]()

    def named(word: str, matrix: Any) -> Any:
        result = matrix.copy()
        for i, j in ((i, j) for i in range(matrix.rows) for j in range(matrix.cols)):
            if not (value := matrix[i, j]).is_Atom and value.diff(t) != 0:
                result[i, j] = Function(f"{word}_{i + 1}_{j + 1}")(t)
                parts[result[i, j]] = value
        return result

    known = right.row_join(rest)
    inverse = named("kindiff_inverse", _solve_blocks(left, eye(n)))
    forward = named("kindiff_matrix", -inverse * known)
    changes = -inverse * (left.diff(t) * forward + known.diff(t))
    parts |= {
        forward[i, j].diff(t): changes[i, j] for i in range(n) for j in range(forward.cols) if forward[i, j] in parts
    }
    whole = KanesMethod(
        method._inertial,
        q_ind=list(method.q),
        u_ind=list(method.u),
        kd_eqs=list(method._qdot - forward[:, :-1] * method.u - forward[:, -1]),
        u_auxiliary=list(method._uaux) or None,
    )
    whole._form_fr(method.loads)  # not kanes_equations: the auxiliary ones are had already
    whole._form_frstar(method.bodies)
    return whole, parts


def _solve_blocks(left: Any, right: Any) -> Any:
    """left^-1 right, block by block, by Cramer's rule: singular where left is, unlike elimination in a fixed order."""
    from sympy import zeros

    result = zeros(*right.shape)
    for block in left.connected_components():
        part = left.extract(block, block)
        rows = right.extract(block, list(range(right.cols)))
        solved = rows / part[0] if len(block) == 1 else part.cramer_solve(rows)
        for i, k in enumerate(block):
            result[k, :] = solved[i, :]
    return result


# -- noncontributing forces --------------------------------------------------------------------------------------------
def replaced(value: Any, raw: Mapping[Any, Any]) -> Any:
    """SymPy expressions, or lists and mappings of them, with functions of time and their derivatives replaced."""
    from sympy import Derivative

    def put(expression: Any) -> Any:
        rates = {d: d.subs(raw).doit() for d in expression.atoms(Derivative) if d.has(*raw)}
        return expression.xreplace(rates).xreplace(dict(raw))

    return with_sympy(value, lambda x: put(x) if raw and x.has(*raw) else x)


def solve_auxiliary(forms: Forms, raw: Collection[str], constants: Collection[str]) -> dict[Any, Any]:
    """The noncontributing forces, solved from the equations of the auxiliary speeds A F + B u' + c = 0.

    They are replaced in the equations of motion M u' = f + G F.  Where they depend on u' (B is not 0), F follows from
    (A + B M^-1 G) F = -(c + B M^-1 f), so that M stays symmetric.  No such forces are the names of ``raw``
    (coordinates, speeds, inputs) and of ``constants`` with a value.  The result has the expression of each force in q,
    u and u', by its function or symbol.
    """
    import sympy
    from sympy.solvers.solveset import NonlinearError

    unknown = _unknown_forces(forms, raw, constants)
    rows = [row for row in forms.noncontributing if row.has(*unknown)] if unknown else []
    if not rows:
        return {}
    if len(rows) != len(unknown):
        raise _refusal(unknown, f"their number is {len(unknown)}, and {len(rows)} auxiliary equations contain them")
    rates = [v.diff(*v.args) for v in forms.v]
    try:
        A, right = sympy.linear_eq_to_matrix(rows, unknown)
        B, right = sympy.linear_eq_to_matrix([-x for x in right], rates)
        acting = sympy.Matrix(forms.forcing).has(*unknown)
        if acting and any(not x.is_zero for x in B):  # F enters M u' = f, and u' enters F
            if forms.motion or forms.configuration:
                raise _refusal(unknown, "they depend on accelerations and act on speeds that constraints bind")
            G, f = sympy.linear_eq_to_matrix(forms.forcing, unknown)
            solved = sympy.Matrix(forms.mass_matrix).LUsolve(G.row_join(-f))
            s = len(unknown)
            A, right = A + B * solved[:, :s], right - B * solved[:, s:]
            B = 0 * B
        result = A.LUsolve(right - B * sympy.Matrix(rates))
    except NonlinearError:
        raise _refusal(unknown, "the equations are not linear in them") from None
    except ValueError:
        raise _refusal(unknown, "the equations do not determine them") from None
    forces = dict(zip(unknown, result, strict=True))
    others = {key: value for key, value in vars(forms).items() if key != "noncontributing"}
    vars(forms).update(replaced(others, forces))
    return forces


def _refusal(forces: Collection[Any], why: str) -> ModelError:
    names = ", ".join(sorted(str(sympy_name(force)) for force in forces))
    message = f"the forces {names} of the auxiliary speeds do not follow from their equations: {why}"
    remedy = "name those that are known in inputs= or specified=, or form the equations without u_auxiliary"
    return ModelError([Problem("equations", message, remedy, code="EG-UNDETERMINED")])


def _unknown_forces(forms: Forms, raw: Collection[str], constants: Collection[str]) -> list[Any]:
    """Functions of time that stand in the auxiliary equations and are not given.

    In equations without one, the forces may be symbols: those without a value that stand in these equations alone and
    are multiplied by no mass, as gravity is.  Equations that are not used are noted.
    """
    import sympy
    from sympy.core.function import AppliedUndef

    def parts(kind: Any, expressions: list[Any]) -> set[Any]:
        return {x for e in expressions if is_sympy(e) for x in e.atoms(kind)}

    rows = forms.noncontributing
    others = [*forms.forcing, *(x for row in forms.mass_matrix for x in row), forms.kinetic, forms.potential]
    functions = [f for f in parts(AppliedUndef, rows) if (name := function_name(f)) is not None and name not in raw]
    if len(functions) > len(rows):  # what acts elsewhere too may be driven
        only = set(functions) - parts(AppliedUndef, others)
        functions = list(only) if len(only) == len(rows) else functions
    rest = [row for row in rows if row != 0 and not row.has(*functions)]
    acting = parts(sympy.Symbol, [*others, *forms.configuration, *forms.motion])
    symbols = {x for x in parts(sympy.Symbol, rest) - {*forms.masses} if x.name not in {*raw, *constants, "t"}}
    symbols = {x for x in symbols if not any(row.diff(x).has(*forms.masses) for row in rest if forms.masses)}
    free = symbols - acting
    used = [row.atoms(sympy.Symbol, AppliedUndef) - {*forms.q, *forms.v, sympy.Symbol("t")} for row in rest]
    used = [part for part in used if part & free or not any(sympy_name(x) in raw for x in part)]
    if len(free) == len(used):
        return sorted([*functions, *free], key=str)
    for part in used:
        if (possible := part & symbols) and possible <= acting:
            raise _refusal(possible, "they are symbols that act elsewhere too; write forces as functions of time")
        names = ", ".join(sorted(str(x) for x in possible or part))
        forms.notes.append(f"auxiliary equations with {names} are not used; write the force as a function of time")
    return sorted(functions, key=str)


TRIES = 5  #: places at which the rank of constraints is looked for


def describe_method(
    method: Any,
    name: str = "system",
    parameters: Mapping[Any, Any] | None = None,
    inputs: Mapping[Any, Any] | Sequence[Any] = (),
    outputs: Mapping[str, Any] | None = None,
    initial: Mapping[Any, Any] | None = None,
    specified: Mapping[Any, Any] | None = None,
    potential_energy: Any = None,
    guess: Mapping[Any, Any] | None = None,
) -> Description:
    """The description behind :func:`from_sympy`, which see."""
    forms = read_forms(method)
    if listed := not isinstance(inputs, Mapping):
        inputs = one_or_several(inputs)
    arguments = (parameters, inputs, outputs, initial, specified, potential_energy, guess)
    renamed = SympyNames([vars(forms), *arguments], forms.q)
    vars(forms).update(renamed.put(vars(forms)))
    parameters, inputs, outputs, initial, specified, potential_energy, guess = map(renamed.put, arguments)
    if potential_energy is not None:
        forms.potential = potential_energy
    extra = named("outputs", outputs)
    if specified is not None and named("specified", specified):
        for key in specified:
            if not is_sympy(key) or function_name(key) is None:
                raise ill_typed(f"specified takes functions of time f(t), not {key!r}")
        vars(forms).update(replaced(vars(forms), specified))
        extra = replaced(extra, specified)
    known = _Names(forms)
    given_parameters = named("parameters", parameters)
    given_inputs = dict.fromkeys(names_of("inputs", inputs, "an input"), 0.0) if listed else named("inputs", inputs)
    forces = solve_auxiliary(forms, {*known.motion, *given_inputs}, given_parameters)
    extra = {name: replaced(expression, forces) for name, expression in extra.items()}
    noncontributing = {str(name_of(force)): value for force, value in forces.items()}
    flat = [x for row in forms.mass_matrix for x in row]
    contents = [*forms.rates.values(), *flat, *forms.forcing, *forms.configuration, *forms.motion, forms.kinetic]
    contents += [forms.potential, *forms.intermediates.values(), *extra.values(), *noncontributing.values()]
    constants, functions = known.sort(contents, given_inputs)
    problems = known.problems
    for key in given_parameters:
        if key not in constants:
            near = nearest(str(key), constants, "constants")
            message = f"the equations have no constant {key!r}"
            problems.append(Problem(f"parameters.{key}", message, near, code="EG-NAME-UNKNOWN"))
    if problems:
        raise ModelError(problems)

    taken = {*constants, *functions, *known.names}
    kept, independent = _independent_rows(forms, constants, functions)
    rows = [*forms.configuration, *(forms.motion[k] for k in kept)]
    equations: dict[str, Any] = {
        "coordinates": [name_of(x) for x in forms.q],
        "velocities": [name_of(x) for x in forms.v],
        "rates": {name_of(x): rate for x, rate in zip(forms.q, forms.rates.values(), strict=True)},
        "mass_matrix": forms.mass_matrix,
        "forcing": forms.forcing,
        "kinetic_energy": forms.kinetic,
        "potential_energy": forms.potential,
    }
    description = Description(values={"name": name, "equations": equations}, notes=forms.notes)
    if rows:
        equations["constraints"] = rows
    if forms.intermediates:
        equations["intermediates"] = {symbol.name: part for symbol, part in forms.intermediates.items()}
    names = forms.multipliers or [f"lam{k + 1}" for k in range(len(rows))]
    if not independent or len(names) != len(rows):
        description.notes.append(
            "multipliers are no outputs: the constraints are redundant, or their rank cannot be judged"
        )
    elif not taken.isdisjoint(names):
        clash = ", ".join(sorted(taken.intersection(names)))
        description.notes.append(f"multipliers are no outputs: the equations use the names {clash}")
    elif rows:
        equations["multipliers"] = names
        extra |= {name: name for name in names if name not in extra}
    for constant in constants:
        value = given_parameters.get(constant)
        description.add("parameters", constant, {} if value is None else {"value": value})
    for function in functions:
        description.add("inputs", function, {"value": given_inputs.get(function, 0.0)})
    for output, expression in {**noncontributing, **extra}.items():
        description.add("outputs", output, {"expression": expression})
    for key, values in (("initial", initial), ("guess", guess)):
        if result := named(key, values):
            description.values[key] = result
    give_latex(description, "equations", renamed.latex())
    return renamed.noted(description)


class _Names:
    """Coordinates and speeds by name, and what else stands in expressions."""

    def __init__(self, forms: Forms) -> None:
        self.problems: list[Problem] = []
        self.intermediates = [symbol.name for symbol in forms.intermediates]
        self.names: dict[str, Any] = {}
        for k, x in enumerate([*forms.q, *forms.v]):
            name = name_of(x)
            if not isinstance(name, str):
                message = f"{x} is not a function of the time t"
                self.problems.append(Problem("equations", message, "use dynamicsymbols", code="EG-TYPE"))
            elif name in self.names:
                message = f"the name {name!r} is given twice"
                self.problems.append(Problem("equations", message, "rename one", code="EG-NAME-TAKEN"))
            self.names[str(name) if isinstance(name, str) else f"?{k}"] = x
        motion = [f"{name_of(x)}{suffix}" for x in forms.q for suffix in RATES]
        self.motion = {*motion, *(f"{name_of(x)}_dot" for x in forms.v), *self.names}

    def sort(self, expressions: Iterable[Any], inputs: Mapping[str, Any]) -> tuple[list[str], list[str]]:
        """Names of the constants, and of what is given over time."""
        import sympy
        from sympy.core.function import AppliedUndef

        symbols: dict[str, set[Any]] = {}
        functions: set[str] = set()
        for expression in expressions:
            if not is_sympy(expression):
                continue
            walk = sympy.preorder_traversal(expression)
            for part in walk:
                if isinstance(part, sympy.Symbol):
                    symbols.setdefault(part.name, set()).add(part)
                elif isinstance(part, AppliedUndef | sympy.Derivative) and (result := function_name(part)) is not None:
                    walk.skip()  # f' is not f
                    if result not in self.motion:
                        functions.add(result)
        for name in ("t", *self.intermediates):
            symbols.pop(name, None)
        for symbol, different in symbols.items():
            if symbol in self.names or symbol in functions:
                what = "a coordinate or speed" if symbol in self.names else "a function of time"
                message = f"{symbol!r} is both a constant and {what}"
                self.problems.append(Problem(f"equations.{symbol}", message, "rename one", code="EG-NAME-TAKEN"))
            elif len(different) > 1:
                message = f"{len(different)} different symbols are called {symbol!r}"
                remedy = "make one symbol and use it everywhere (assumptions such as positive=True make another)"
                self.problems.append(Problem(f"equations.{symbol}", message, remedy, code="EG-NAME-TAKEN"))
        driven = [name for name in symbols if name in inputs]
        for name in inputs:
            if name not in functions and name not in symbols:
                near = nearest(str(name), [*functions, *symbols], "known")
                message = f"the equations do not contain {name!r}"
                self.problems.append(Problem(f"inputs.{name}", message, near, code="EG-NAME-UNKNOWN"))
        constants = [name for name in symbols if name not in self.names and name not in driven]
        return sorted(set(constants) - functions), sorted({*functions, *driven})


def _independent_rows(forms: Forms, constants: Sequence[str], functions: Sequence[str]) -> tuple[list[int], bool]:
    """Which rows of ``forms.motion`` do not follow from others or from the configuration constraints.

    And whether these rows and the configuration constraints are independent of each other.  Judged on the graph at a
    generic place, where rows depend on each other only if they do everywhere.
    """
    if not forms.motion and not forms.configuration:
        return [], True
    graph = Graph()
    names = {name_of(x): graph.symbol(name_of(x)) for x in (*forms.q, *forms.v)}

    def resolve(name: str) -> Expr:
        return {**rates, **names}.get(name, graph.symbol(name))

    rates: dict[str, Expr] = {}
    try:
        for symbol, part in forms.intermediates.items():
            names[symbol.name] = lower_sympy(graph, part, resolve)
        slopes = [lower_sympy(graph, rate, resolve) for rate in forms.rates.values()]
        for x, rate in zip(forms.q, slopes, strict=True):
            rates[f"{name_of(x)}_dot"] = rate
        configuration = [lower_sympy(graph, row, resolve) for row in forms.configuration]
        motion = [lower_sympy(graph, row, resolve) for row in forms.motion]
    except ExpressionError:  # the check of the model tells what is wrong
        return list(range(len(forms.motion))), False
    along = {names[name_of(x)]: rate for x, rate in zip(forms.q, slopes, strict=True)}
    along |= {graph.symbol(f): graph.symbol(rate_of(f)) for f in functions} | {graph.symbol("t"): graph.one}
    rows = [*jvp(configuration, along), *motion]
    v = [names[name_of(x)] for x in forms.v]
    entries = jacobian(rows, v)
    constant = substitute(rows, dict.fromkeys(v, graph.zero))
    used = symbols_of([*constant, *entries.values()])
    random = np.random.default_rng(0)
    for _ in range(TRIES):  # a place may lie outside the domain of a root
        values = {name: float(random.uniform(0.3, 1.2)) for name in sorted(used)}
        matrix, rounding = np.zeros((len(rows), len(v))), np.zeros((len(rows), len(v)))
        for place, value, bound in zip(entries, *with_bounds(list(entries.values()), values), strict=True):
            matrix[place], rounding[place] = value, ROUNDED * bound
        right = np.array(evaluate(constant, values), dtype=float)
        if np.isfinite(matrix).all() and np.isfinite(right).all():
            break
    else:
        return list(range(len(motion))), False
    h, fresh_rows = len(configuration), list[int]()
    for k, row in enumerate(matrix):
        factors = algebra.lstsq(matrix[fresh_rows].T, row, rcond=None) if fresh_rows else np.empty(0)
        size = np.linalg.norm(row - factors @ matrix[fresh_rows])
        if size > SMALL * np.linalg.norm(row) and size > np.linalg.norm(rounding[k]):
            fresh_rows.append(k)
            continue
        largest = max(1.0, float(abs(right[k])), float(np.abs(factors).max(initial=0)))
        if abs(right[k] - factors @ right[fresh_rows]) > SMALL * largest:
            which = f"configuration constraint {k + 1}" if k < h else f"velocity constraint {k - h + 1}"
            message = (
                f"{which} contradicts the others: it has the same velocity terms as they have, but other "
                "remaining terms"
            )
            raise ModelError([Problem("equations.constraints", message, f"check the {which}", code="EG-REDUNDANT")])
    return [k - h for k in fresh_rows if k >= h], fresh_rows[:h] == [*range(h)]
