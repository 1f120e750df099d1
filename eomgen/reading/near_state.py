"""The embedded equations near a state -> x' = A x + B u as expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import correlated, partition
from ..base.limits.numbers import LEAST, SINGULAR
from ..errors import NonFiniteError, PartitionError, SingularMassMatrixError, UnavailableError
from ..expr import vectors as vec
from ..expr.core import Expr, substitute, symbols_of
from ..expr.differentiate import jacobian, jvp
from ..expr.evaluate import evaluate
from ..expr.tensors import dot, solve_symmetric
from ..mechanics.methods.reduction import solve_velocities
from .quantities import Formed, Quantities, Row, Rows
from .symbols import substitute_values

# -- states without a linearization ------------------------------------------------------------------------------------

# Symbols that are left have any values, so a matrix is singular there if it is at every one of a few samples of them:
# the declared numbers with other positions, then numbers that are made up.


def require_inverse(quantities: Quantities, mass: Sequence[Sequence[Expr]], at: Mapping[str, Any]) -> None:
    """Refuse a state at which no acceleration of the independent coordinates follows.

    Either the mass matrix is not finite, as the independent velocities do not determine the others, or has no inverse.
    """
    n, mobility = len(mass), quantities.mobility
    if n == 0:
        return
    samples = [np.reshape(x, (n, n)) for x in _samples(quantities, [x for row in mass for x in row])]
    finite = [M for M in samples if np.abs(M).max(initial=0.0) * SINGULAR < 1.0]  # 1/0 is large by rounding
    if samples and not finite:
        names = ", ".join(mobility.independent)
        raise PartitionError(
            f"linearize: the velocities of {names} do not determine the others {here(at)}: constraint_jacobian without "
            "their columns has no inverse there (a dead centre), so mass_matrix is not finite; linearize at another "
            "state, or derive with independent=[...] of another coordinate"
        )
    if not finite or any(_least(M)[0] > LEAST for M in finite):
        return
    motion = np.abs(_least(finite[0])[1])
    still = [name for name, x in zip(mobility.independent, motion, strict=True) if x > 0.1 * motion.max()]
    raise SingularMassMatrixError(
        f"linearize: mass_matrix ({n}, {n}) has no inverse {here(at)}: moving {', '.join(still)} meets no inertia, so "
        "no acceleration follows; linearize at another state, or give the bodies behind the named coordinates mass or "
        "inertia"
    )


def require_finite(
    quantities: Quantities, matrices: Mapping[str, Sequence[Sequence[Expr]]], at: Mapping[str, Any]
) -> None:
    """Refuse a state at which an entry of a matrix has no value, by the name of the first."""
    for letter, rows in matrices.items():
        for i, row in enumerate(rows):
            samples = list(_samples(quantities, row))
            for j in range(len(row)):
                if samples and not any(np.isfinite(sample[j]) for sample in samples):
                    raise NonFiniteError(
                        f"linearize: {letter}[{i}, {j}] has no finite value {here(at)}; a force, a constraint or a "
                        "rotation has no derivative there, such as a spring of length 0: linearize at another state"
                    )


def _least(M: Any) -> tuple[float, Any]:
    """The smallest size of an eigenvalue of M with its diagonal scaled to 1, and the motion that belongs to it."""
    values, motions = algebra.eigh(correlated(M))
    k = int(np.abs(values).argmin())
    return float(abs(values[k])), motions[:, k]


def _samples(quantities: Quantities, expressions: Sequence[Expr]) -> Iterator[Any]:
    """The expressions at a few values of their symbols; none where they hold functions that are not known here."""
    if quantities.graph.functions:
        return
    left, declared = sorted(symbols_of(expressions)), quantities.numbers_elsewhere
    for first in (0.7, 0.4, 1.3):
        made_up = {name: first + 0.17 * k for k, name in enumerate(left)}
        with np.errstate(all="ignore"):
            yield np.array(evaluate(expressions, made_up | declared if first == 0.7 else made_up), dtype=float)


def here(at: Mapping[str, Any]) -> str:
    """The state as text."""
    return f"at {', '.join(f'{name} = {value}' for name, value in at.items())}" if at else "at any state"


# -- linearization -----------------------------------------------------------------------------------------------------

# States are displacements of independent coordinates, then independent velocities; dependent ones follow the
# constraints, as in ``Module.linearize``.  With M v_i' = f: M dv_i' = df - dM v_i' along each direction.


class SymbolicLinearization(NamedTuple):
    """x' = A x + B u near a state, in displacements, velocities and changes of inputs.

    Attributes
    ----------
    A, B : sympy.Matrix
        (n, n), (n, n_u).
    states, inputs : tuple of str
        What the entries of x and u are called, as in ``Module.linearize``.
    intermediates : list of (sympy.Symbol, sympy.Expr)
        Named parts of large matrices, in order.
    """

    A: Any
    B: Any
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    intermediates: Sequence[tuple[Any, Any]] = ()


def linearize(quantities: Quantities, at: Mapping[str, Any], equilibrium: bool) -> Formed:
    """The entries of A, then of B, at a state, and names of the states; velocities that ``at`` does not name are 0.

    ``equilibrium`` tells that the accelerations vanish there.
    """
    kinematics, graph = quantities.kinematics, quantities.graph
    if kinematics.state_names:
        raise UnavailableError("the model has first-order states; use linearize of the module")
    if kinematics.general_rates:
        raise UnavailableError("rates of coordinates are given as functions of velocities; use linearize of the module")
    inputs = kinematics.input_names
    if not symbols_of([*kinematics.constraints.velocity, *kinematics.constraints.gamma]).isdisjoint(inputs):
        raise UnavailableError("constraints depend on inputs; use linearize of the module")
    named = at
    at = {name: 0.0 for name in kinematics.velocity_names if name not in at} | dict(at)
    free = [kinematics.velocity_labels.index(name) for name in quantities.mobility.independent]
    positions, Z = _displacements(quantities)
    moves = [_move(quantities, column) for column in zip(*Z, strict=True)]
    moves += [_Move({}, column) for column in zip(*quantities.transformation.matrix, strict=True)]
    a = [graph.symbol(f"a({k})") for k in range(len(free))]
    residual = [f - dot(row, a) for f, row in zip(quantities.force, quantities.mass_matrix, strict=True)]
    changes = [jvp(residual, move.along(kinematics.v)) for move in moves]
    slopes = jacobian(residual, [graph.symbol(name) for name in inputs])
    changes += [[slopes.get((i, k), graph.zero) for i in range(len(free))] for k in range(len(inputs))]
    flat = substitute_values([x for row in quantities.mass_matrix for x in row], at)
    mass = [flat[k * len(free) : (k + 1) * len(free)] for k in range(len(free))]
    require_inverse(quantities, mass, named)
    rates = [graph.zero] * len(free) if equilibrium else solve_symmetric(mass, substitute_values(quantities.force, at))
    still = dict(zip(a, rates, strict=True))
    columns = [solve_symmetric(mass, substitute(substitute_values(change, at), still)) for change in changes]
    lower = list(zip(*columns, strict=True)) if columns else []
    shifts = [_shift(quantities, move, column) for move, column in zip(moves, [*zip(*Z, strict=True)], strict=False)]
    shifts += [move.velocities for move in moves[len(shifts) :]]
    upper = [tuple(substitute_values([shift[k] for shift in shifts], at)) for k in positions]
    n = len(moves)
    A: Rows = (*upper, *(row[:n] for row in lower))
    B: Rows = (*((graph.zero,) * len(inputs) for _ in upper), *(row[n:] for row in lower))
    require_finite(quantities, {"A": A, "B": B}, named)
    states = (*(_displacement_name(quantities, k) for k in positions), *(kinematics.velocity_names[k] for k in free))
    return Formed([x for matrix in (A, B) for row in matrix for x in row], extra=states)


FACTORED = 120  #: operations of an entry up to which it is factored


def over_one_denominator(x: Any) -> Any:
    """An entry as a textbook writes it, factored over one denominator, where that is shorter."""
    import sympy

    if not 1 < sympy.count_ops(x) <= FACTORED or not x.is_algebraic_expr(*x.free_symbols):
        return x
    return min((sympy.factor(x), x), key=lambda form: sympy.count_ops(form) + str(form).count("/"))


class _Move(NamedTuple):
    """A direction on the constraints: changes of coordinates and of velocities (n_v)."""

    coordinates: dict[Expr, Expr]
    velocities: Row

    def along(self, v: Sequence[Expr]) -> dict[Expr, Expr]:
        """As the direction of a derivative."""
        return self.coordinates | dict(zip(v, self.velocities, strict=True))


def _displacement_name(quantities: Quantities, k: int) -> str:
    """The coordinate whose rate is velocity k, or ``ball_rx`` for the angular velocity ``ball_wx``."""
    label = quantities.kinematics.velocity_labels[k]
    return f"{label[:-2]}r{label[-1]}" if label == quantities.kinematics.velocity_names[k] else label


def _displacements(quantities: Quantities) -> tuple[list[int], Rows]:
    """Independent displacements and Z (n_v, n_z): all that the holonomic equations allow."""
    kinematics, mobility = quantities.kinematics, quantities.mobility
    n, c = len(kinematics.v), kinematics.constraints
    free = [kinematics.velocity_labels.index(name) for name in mobility.independent]
    if not c.nonholonomic:
        return free, quantities.transformation.matrix
    rows = [c.jacobian[i] for i in mobility.independent_rows if i < len(c.values)]
    order = [*free, *(j for j in range(n) if j not in free)]
    at = quantities.numbers | dict(zip(kinematics.names, mobility.q_reference, strict=True))
    if rows:
        J = np.array([[float(x) for x in evaluate(list(row), at)] for row in rows])
        free = [int(k) for k in partition(J, len(rows), order).independent]
    else:
        free = order
    solved = solve_velocities(kinematics, mobility, rows, free, quantities.numbers)
    return free, tuple(tuple(row[k] for k in free) for row in solved)


def _move(quantities: Quantities, column: Row) -> _Move:
    """A displacement with the independent velocities as they are: the others follow from v = B v_i + b."""
    kinematics, graph = quantities.kinematics, quantities.graph
    still = substitute(list(kinematics.rates), dict.fromkeys(kinematics.v, graph.zero))
    moved = substitute(list(kinematics.rates), dict(zip(kinematics.v, column, strict=True)))
    dq = {q: x - rest for q, x, rest in zip(kinematics.q, moved, still, strict=True) if x != rest}
    result = quantities.transformation
    independent = [kinematics.v[kinematics.velocity_labels.index(name)] for name in quantities.mobility.independent]
    v = [dot(row, independent) + b if independent else b for row, b in zip(result.matrix, result.offset, strict=True)]
    return _Move(dq, tuple(jvp(v, dq)) if dq else (graph.zero,) * len(v))


def _shift(quantities: Quantities, move: _Move, column: Row) -> Row:
    """Rates of displacements for a displacement: dv, and r x w of small rotations r about turning axes."""
    result = list(move.velocities)
    for _, j in quantities.kinematics.quaternion_slots:
        w, r = (vec.vector(quantities.graph, x[j : j + 3]) for x in (quantities.kinematics.v, column))
        linear = vec.vector(quantities.graph, result[j : j + 3])
        result[j : j + 3] = vec.add(linear, vec.cross(r, w))
    return tuple(result)
