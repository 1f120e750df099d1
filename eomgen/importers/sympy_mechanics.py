"""Importers, SymPy's mechanics: KanesMethod, LagrangesMethod, System -> their equations in one form, all in SymPy.

Kane's equations are taken of all generalized speeds, dependent ones included, before SymPy eliminates any: M of them is
symmetric and small, constraints stay constraints, and none of their choices of dependent speeds can go bad.  Equations
of auxiliary speeds are solved for the noncontributing forces, wherever these act.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..describe.sympy_face import function_name, is_sympy, name_of, sympy_name
from ..errors import ModelError, Problem, ill_typed, incomplete

KNOWN = "KanesMethod, LagrangesMethod, System, JointsMethod"


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
    """The equations of a method object.

    Raises
    ------
    UsageError
        Another object, or its equations are not formed yet.
    """
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
    raise ill_typed(f"from_sympy takes SymPy's {KNOWN} with its equations formed, not {type(method).__name__}")


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
    order = _paired(method._qdot, v, rates)
    kinetic = kinetic.xreplace(rates).xreplace(auxiliary).xreplace(named)
    rates = {dq: rate.xreplace(auxiliary).xreplace(named) for dq, rate in rates.items()}
    matrix, forcing = (x.xreplace(auxiliary).xreplace(named) for x in (whole.mass_matrix, whole.forcing))
    return Forms(
        q=q,
        v=[v[k] for k in order],
        rates=rates,
        mass_matrix=[[matrix[i, j] for j in order] for i in order],
        forcing=[forcing[k] for k in order],
        configuration=list(method._f_h),
        motion=_constraints_of_speeds(method, auxiliary),
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


def _constraints_of_speeds(method: Any, auxiliary: dict[Any, Any]) -> list[Any]:
    """SymPy keeps them after it has put its own q' in, as matrices."""
    if not len(method._udep):
        return []
    return [row.xreplace(auxiliary) for row in method._k_nh * method.u + method._f_nh]


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


def _paired(q_dot: Sequence[Any], v: Sequence[Any], rates: dict[Any, Any]) -> list[int]:
    """Places of the speeds in the order of the coordinates whose rates they are; their own unless all are rates."""
    first = [v.index(rate) for rate in (rates[x] for x in q_dot) if rate in v]
    return first if sorted(first) == list(range(len(v))) else list(range(len(v)))


# -- noncontributing forces --------------------------------------------------------------------------------------------
def replaced(value: Any, given: Mapping[Any, Any]) -> Any:
    """SymPy expressions, or lists and mappings of them, with functions of time and their derivatives replaced."""
    if isinstance(value, Mapping):
        return {key: replaced(part, given) for key, part in value.items()}
    if isinstance(value, list):
        return [replaced(part, given) for part in value]
    if not given or not is_sympy(value) or not value.has(*given):
        return value
    from sympy import Derivative

    rates = {d: d.subs(given).doit() for d in value.atoms(Derivative) if d.has(*given)}
    return value.xreplace(rates).xreplace(dict(given))


def solve_auxiliary(forms: Forms, given: Collection[str], constants: Collection[str]) -> dict[Any, Any]:
    """The noncontributing forces, solved from the equations of the auxiliary speeds A F + B u' + c = 0.

    They are replaced in the equations of motion M u' = f + G F.  Where they depend on u' (B is not 0), F follows from
    (A + B M^-1 G) F = -(c + B M^-1 f), so that M stays symmetric.  No such forces are the names of ``given``
    (coordinates, speeds, inputs) and of ``constants`` with a value.  The result has the expression of each force in q,
    u and u', by its function or symbol.
    """
    import sympy
    from sympy.solvers.solveset import NonlinearError

    unknown = _unknown_forces(forms, given, constants)
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
        found = A.LUsolve(right - B * sympy.Matrix(rates))
    except NonlinearError:
        raise _refusal(unknown, "the equations are not linear in them") from None
    except ValueError:
        raise _refusal(unknown, "the equations do not determine them") from None
    forces = dict(zip(unknown, found, strict=True))
    others = {key: value for key, value in vars(forms).items() if key != "noncontributing"}
    vars(forms).update(replaced(others, forces))
    return forces


def _refusal(forces: Collection[Any], why: str) -> ModelError:
    names = ", ".join(sorted(str(sympy_name(force)) for force in forces))
    message = f"the forces {names} of the auxiliary speeds do not follow from their equations: {why}"
    remedy = "name those that are known in inputs= or specified=, or form the equations without u_auxiliary"
    return ModelError([Problem("equations", message, remedy, code="EG-UNDETERMINED")])


def _unknown_forces(forms: Forms, given: Collection[str], constants: Collection[str]) -> list[Any]:
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
    functions = [f for f in parts(AppliedUndef, rows) if (name := function_name(f)) is not None and name not in given]
    if len(functions) > len(rows):  # what acts elsewhere too may be driven
        only = set(functions) - parts(AppliedUndef, others)
        functions = list(only) if len(only) == len(rows) else functions
    rest = [row for row in rows if row != 0 and not row.has(*functions)]
    acting = parts(sympy.Symbol, [*others, *forms.configuration, *forms.motion])
    symbols = {x for x in parts(sympy.Symbol, rest) - {*forms.masses} if x.name not in {*given, *constants, "t"}}
    symbols = {x for x in symbols if not any(row.diff(x).has(*forms.masses) for row in rest if forms.masses)}
    free = symbols - acting
    used = [row.atoms(sympy.Symbol, AppliedUndef) - {*forms.q, *forms.v, sympy.Symbol("t")} for row in rest]
    used = [part for part in used if part & free or not any(sympy_name(x) in given for x in part)]
    if len(free) == len(used):
        return sorted([*functions, *free], key=str)
    for part in used:
        if (possible := part & symbols) and possible <= acting:
            raise _refusal(possible, "they are symbols that act elsewhere too; write forces as functions of time")
        names = ", ".join(sorted(str(x) for x in possible or part))
        forms.notes.append(f"auxiliary equations with {names} are not used; write the force as a function of time")
    return sorted(functions, key=str)
