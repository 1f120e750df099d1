"""Stage describe, SymPy's mechanics: KanesMethod, LagrangesMethod, System -> their equations in one form.

Kane's equations are taken of all generalized speeds, dependent ones included, before SymPy eliminates any: M of them is
symmetric and small, constraints stay constraints, and none of their choices of dependent speeds can go bad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import UsageError

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
    masses: list[Any] = field(default_factory=list)  #: symbols of the masses of the bodies


def read_forms(method: Any) -> Forms:
    """The equations of a method object.

    Raises
    ------
    UsageError
        Another object, or its equations are not formed yet.
    """
    from sympy.physics.mechanics import JointsMethod, KanesMethod, LagrangesMethod, System

    if isinstance(method, System):
        if method.eom_method is None:
            raise UsageError("the System has no equations yet; call form_eoms() on it first")
        return read_forms(method.eom_method)
    if isinstance(method, JointsMethod):
        if method.method is None:
            raise UsageError("the JointsMethod has no equations yet; call form_eoms() on it first")
        return read_forms(method.method)
    if isinstance(method, KanesMethod):
        return _read_kane(method)
    if isinstance(method, LagrangesMethod):
        return _read_lagrange(method)
    raise UsageError(f"from_sympy takes SymPy's {KNOWN} with its equations formed, not {type(method).__name__}")


def _read_lagrange(method: Any) -> Forms:
    """SymPy forms M q'' = f + lam_coeffs^T lam, lam_coeffs = -d(constraints')/dq'."""
    from sympy import Matrix, S

    if method.eom is None:
        raise UsageError("the LagrangesMethod has no equations yet; call form_lagranges_equations() on it first")
    q = list(method.q)
    v = list(method._qdots)
    n, holonomic = len(q), list(method._hol_coneqs)
    lagrangian = method._L[0]  # there is no public name for it
    still = dict.fromkeys(v, S.Zero)
    at_rest = lagrangian.xreplace(still)
    mass, kinetic = method.mass_matrix[:, :n], lagrangian - at_rest
    if not all(lagrangian.diff(x).xreplace(still).is_zero for x in v):  # terms linear in v are no energy
        kinetic = (Matrix(v).T * mass * Matrix(v))[0] / 2
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
    )


def _read_kane(method: Any) -> Forms:
    from sympy import S, sympify

    if method._fr is None or method._frstar is None:
        raise UsageError("the KanesMethod has no equations yet; call kanes_equations(bodies, loads) on it first")
    q, v = list(method.q), list(method.u)
    whole = method
    if len(method._udep) or not method._k_kqdot_implicit.is_diagonal():
        whole = _of_all_speeds(method)
    rates = whole.kindiffdict()
    auxiliary = dict.fromkeys([*method._uaux, *(x.diff(*x.args) for x in method._uaux)], S.Zero)
    bodies = list(method.bodies)
    kinetic = sum((body.kinetic_energy(method._inertial) for body in bodies), S.Zero)
    potential = sum((body.potential_energy for body in bodies), S.Zero)
    order = _paired(method._qdot, v, rates)
    matrix, forcing = whole.mass_matrix.xreplace(auxiliary), whole.forcing.xreplace(auxiliary)
    return Forms(
        q=q,
        v=[v[k] for k in order],
        rates={dq: rate.xreplace(auxiliary) for dq, rate in rates.items()},
        mass_matrix=[[matrix[i, j] for j in order] for i in order],
        forcing=[forcing[k] for k in order],
        configuration=list(method._f_h),
        motion=_constraints_of_speeds(method, rates, auxiliary),
        kinetic=kinetic.xreplace(rates).xreplace(auxiliary),
        potential=potential,
        noncontributing=list(method.auxiliary_eqs.xreplace(auxiliary)) if len(method._uaux) else [],
        masses=[symbol for body in bodies for symbol in sympify(body.mass).free_symbols],
    )


def _of_all_speeds(method: Any) -> Any:
    """The same system without its constraints, every speed independent."""
    from sympy.physics.mechanics import KanesMethod

    left, right, rest = method._k_kqdot_implicit, method._k_ku_implicit, method._f_k_implicit
    whole = KanesMethod(
        method._inertial,
        q_ind=list(method.q),
        u_ind=list(method.u),
        kd_eqs=list(left * method._qdot + right * method.u + rest),
        u_auxiliary=list(method._uaux) or None,
        kd_eqs_solver=_solve_blocks,
    )
    whole._form_fr(method.loads)  # not kanes_equations: the auxiliary ones are had already
    whole._form_frstar(method.bodies)
    return whole


def _constraints_of_speeds(method: Any, rates: dict[Any, Any], auxiliary: dict[Any, Any]) -> list[Any]:
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
