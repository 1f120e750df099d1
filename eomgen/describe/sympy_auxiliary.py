"""Stage describe, SymPy's auxiliary speeds: their equations -> the noncontributing forces, wherever these act."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ..errors import ModelError, Problem
from .sympy_face import function_name, is_sympy, sympy_name
from .sympy_forms import Forms


def put(value: Any, given: Mapping[Any, Any]) -> Any:
    """SymPy expressions, or lists and mappings of them, with functions of time and their derivatives replaced."""
    if isinstance(value, Mapping):
        return {key: put(part, given) for key, part in value.items()}
    if isinstance(value, list):
        return [put(part, given) for part in value]
    if not given or not is_sympy(value) or not value.has(*given):
        return value
    from sympy import Derivative

    rates = {d: d.subs(given).doit() for d in value.atoms(Derivative) if d.has(*given)}
    return value.xreplace(rates).xreplace(dict(given))


def solve_auxiliary(forms: Forms, given: Collection[str], constants: Collection[str]) -> dict[Any, Any]:
    """The noncontributing forces, solved from the equations of the auxiliary speeds A F + B u' + c = 0.

    They are replaced in the equations of motion M u' = f + G F.  Where they depend on u' (B is not 0), F follows from
    (A + B M^-1 G) F = -(c + B M^-1 f), so that M stays symmetric.

    Parameters
    ----------
    forms : Forms
    given : collection of str
        Names that are no such forces: coordinates, speeds, inputs.
    constants : collection of str
        Names of constants that have a value.

    Returns
    -------
    dict
        SymPy's function or symbol of each force -> its expression, in q, u and u'.

    Raises
    ------
    ModelError
        The forces do not follow from the equations.
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
    vars(forms).update({key: put(value, forces) for key, value in vars(forms).items() if key != "noncontributing"})
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
