"""Stage explain, comparison: shown formulas through SymPy at random consistent states, against the module."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy

from ..base import algebra
from ..base.limits.numbers import EPS
from ..graph.core import Expr
from ..graph.evaluate import evaluate as of_graph
from ..graph.rounding_bounds import with_bounds
from ..graph.substitute import symbols_of
from ..runtime.constrained import multipliers
from .author import Author
from .shown_values import evaluate, random_state, state_values

STATES = 2
TIME = 0.137  #: between the states of a mechanism whose motion is prescribed (s)
SMALLEST = 4096 * EPS  #: entries that count as 0


class Difference(NamedTuple):
    """Differences of shown formulas from the compiled module, as shares of the largest entry or term.

    Attributes
    ----------
    each : dict of str to float
    states : int
    """

    each: Mapping[str, float]
    states: int

    @property
    def largest(self) -> float:
        """The largest of all."""
        return max(self.each.values(), default=0.0)


class StateNumbers(NamedTuple):
    """A consistent state of a module, and the numbers of all names there."""

    module: Any
    x: Any
    values: Mapping[str, float]
    free: list[int]
    t: float

    @property
    def q(self) -> Any:
        return self.x[: self.module.n_q]

    @property
    def v(self) -> Any:
        return self.x[self.module.n_q : self.module.n_q + self.module.n_v]

    @property
    def a(self) -> Any:
        return self.module.rhs(self.t, self.x)[self.module.n_q : self.module.n_q + self.module.n_v]


def compare(author: Author, module: Any) -> Difference:
    """Compare every shown formula: with what the module has for it, else with the derivation as it was formed."""
    found: dict[str, float] = {}
    equations = author.equations
    shown = {(s.name, s.part) for s in author.shown if s.name} | {("mass_matrix", None), ("force", None)}
    wanted = {name for name, _ in shown}
    moves = bool(equations.mobility.n_dof)
    for seed in range(STATES):
        t = 0.0 if moves else TIME * (seed + 1)  # the time alone tells where a mechanism is whose motion is prescribed
        x = random_state(module, seed + 1, t)
        free = module.layout.independent_moving.tolist()
        state = StateNumbers(module, x, state_values(module, x, t), free, t)
        for name, of_module in COMPARED.items():
            if name in wanted and (moves or name in OF_ALL):
                _note(found, name, _number(equations, name, None, state.values), *of_module(state))
        if "poses" in wanted:
            for body, pose in zip(module.body_names, module.poses(state.q, t=t), strict=True):
                if ("poses", body) in shown:
                    _note(found, f"poses[{body}]", _number(equations, "poses", body, state.values), pose.ravel(), 1.0)
        for name, compare_sum in SUMS.items():
            if name in wanted and (moves or name in OF_ALL):
                compare_sum(found, equations, state)
        compare_as_formed(found, author, {key for key in shown if key[0] not in COMPARED}, state.values)
    return Difference(found, STATES)


Wanted = tuple[Any, float]


def _energy(k: int) -> Callable[[StateNumbers], Wanted]:
    def wanted(s: StateNumbers) -> Wanted:
        energies = s.module.energy(s.x, t=s.t)
        return np.array([energies[k]]), float(np.abs(energies).sum())

    return wanted


def _force(s: StateNumbers) -> Wanted:
    terms = s.module.embedded_mass_matrix(s.q, t=s.t) * s.a[s.free]
    return terms.sum(axis=1), float(np.abs(terms).max(initial=0.0))


def _gamma(s: StateNumbers) -> Wanted:
    terms = s.module.constraint_jacobian(s.q, t=s.t) * s.a
    return -terms.sum(axis=1), float(np.abs(terms).max(initial=0.0))


def _velocity_constraints(s: StateNumbers) -> Wanted:
    terms = s.module.constraint_jacobian(s.q, t=s.t) * s.v
    return s.module.velocity_constraints(s.x, t=s.t), float(np.abs(terms).max(initial=0.0))


#: Quantity -> what the module has for it at a state, flat, and the size of the terms that it is a sum of.
COMPARED: dict[str, Callable[[StateNumbers], Wanted]] = {
    "T": _energy(0),
    "V": _energy(1),
    "mass_matrix": lambda s: (s.module.embedded_mass_matrix(s.q, t=s.t).ravel(), 0.0),
    "force": _force,
    "constraints": lambda s: (s.module.constraints(s.q, t=s.t), 1.0),
    "velocity_constraints": _velocity_constraints,
    "constraint_jacobian": lambda s: (s.module.constraint_jacobian(s.q, t=s.t).ravel(), 0.0),
    "gamma": _gamma,
}


def _number(equations: Any, name: str, part: str | None, values: Mapping[str, float]) -> Any:
    named, value = equations.written(name, part)
    columns = value if isinstance(value, tuple) else (value,)
    flat = [x for column in columns for x in (column if isinstance(column, sympy.MatrixBase) else [column])]
    return evaluate(named, flat, values)


def compare_as_formed(
    found: dict[str, float], author: Author, shown: Collection[tuple[str, str | None]], values: Mapping[str, float]
) -> None:
    """Formulas in SymPy against the expressions of the derivation, evaluated on their graph.

    What the state does not know, such as reactions, variations and momenta, gets numbers at random.
    """
    done = set()
    for name, part in sorted(shown, key=str):
        written = author.equations.as_formed(name, part)
        if id(written) in done:
            continue
        done.add(id(written))
        formed, given = written.formed()
        label = name if part is None else f"{name}[{part}]"
        _compare_formed(found, label, formed, given, (written.named, written.flat), values)
    for what, expressions, own in author.formed:
        _compare_formed(found, what, expressions, (), own, values)


def _compare_formed(
    found: dict[str, float],
    what: str,
    formed: Sequence[Expr],
    given: Sequence[tuple[str, Expr]],
    written: tuple[Sequence[tuple[Any, Any]], Sequence[Any]],
    values: Mapping[str, float],
) -> None:
    unknown = symbols_of([*formed, *(x for _, x in given)]).difference(values, (name for name, _ in given))
    random = np.random.default_rng(2)
    numbers = dict(values) | {name: float(random.uniform(-1, 1)) for name in sorted(unknown)}
    at = dict(numbers)
    for name, x in given:
        at[name] = float(of_graph([x], at)[0])
    wanted, terms = with_bounds(formed, at)
    _note(found, what, evaluate(*written, numbers), wanted, float(np.max(terms[np.isfinite(terms)], initial=0.0)))


def _note(found: dict[str, float], name: str, shown: Any, wanted: Any, size: float) -> None:
    largest = max(float(np.abs(wanted).max(initial=0.0)), size, SMALLEST)
    found[name] = max(found.get(name, 0.0), float(np.abs(shown - wanted).max(initial=0.0)) / largest)


def _compare_forces(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """The forces of all elements and the quadratic velocity terms together are M v'."""
    named, total = equations.written("generalized_forces")
    Q_v = _number(equations, "quadratic_velocity", None, s.values)
    parts = [evaluate(named, list(part), s.values) for part in total.parts.values()]
    wanted, size = _force(s)
    largest = max([size, *(float(np.abs(part).max(initial=0.0)) for part in (*parts, Q_v))])
    _note(found, "generalized_forces", sum(parts, Q_v), wanted, largest)


def _compare_velocities(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """The kinetic energy of the bodies at their velocities is that of the module, where drives have no inertia."""
    mechanism = equations.kinematics.mechanism
    if any(spec.armature is not None for spec in mechanism.joints):
        return
    T = 0.0
    for body, pose in zip(mechanism.bodies, s.module.poses(s.q, t=s.t), strict=True):
        mass, *inertia = of_graph([body.mass, *(x for row in body.inertia for x in row)], s.values)
        angular, _, centre = _number(equations, "velocities", body.name, s.values).reshape(3, 3)
        own = pose[:3, :3].T @ angular
        T += 0.5 * (mass * centre @ centre + own @ np.reshape(inertia, (3, 3)) @ own)
    _note(found, "velocities", np.array([T]), *_energy(0)(s))


def _compare_momenta(found: dict[str, float], equations: Any, s: StateNumbers) -> Any:
    """p = M v + b, where b is p at rest."""
    still = dict(s.values) | dict.fromkeys(map(str, equations.v), 0.0)
    p, b = (_number(equations, "momenta", None, values) for values in (s.values, still))
    _note(found, "momenta", p - b, s.module.mass_matrix(s.q, t=s.t) @ s.v, float(np.abs(b).max(initial=0.0)))
    return p, b


def _compare_hamiltonian(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """H is (p - b) . v / 2 - T(v = 0) + V."""
    p, b = _compare_momenta(found, equations, s)
    V, T = s.module.energy(s.x, t=s.t)[1], s.module.energy(np.concatenate([s.q, 0.0 * s.v]), t=s.t)[0]
    values = dict(s.values) | dict(zip(map(str, equations.momentum_symbols), p, strict=True))
    H, size = 0.5 * (p - b) @ s.v - T + V, float(np.abs(p * s.v).sum()) + abs(T) + abs(V)
    _note(found, "hamiltonian", _number(equations, "hamiltonian", None, values), np.array([H]), size)


def _compare_gibbs_function(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """dS/da is Q along the independent velocities; S is quadratic, so that differences are its derivatives."""
    names = [str(a.node[1]) for a in equations.kinematics.a]
    slopes = []
    for name in names:
        ends = [{**s.values, name: s.values[name] + step} for step in (1.0, -1.0)]
        up, down = (float(_number(equations, "gibbs_function", None, at)[0]) for at in ends)
        slopes.append((up - down) / 2)
    B = _number(equations, "velocity_transformation", None, s.values).reshape(len(names), -1)
    Q = _number(equations, "generalized_forces", None, s.values)
    S = abs(float(_number(equations, "gibbs_function", None, s.values)[0]))
    _note(found, "gibbs_function", B.T @ slopes, Q, max(S, float(np.abs(B.T * slopes).max(initial=0.0))))


def _compare_block_system(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """K x = k can be solved with the accelerations of the module."""
    written = equations.as_formed("block_system")
    numbers = evaluate(written.named, written.flat, s.values)
    n = len(equations.block_system.unknowns)
    K, k = numbers[: n * n].reshape(n, n), numbers[n * n :]
    unknowns = [str(x) for x in equations.block_system.unknowns]
    known = np.array([name in s.values for name in unknowns], dtype=bool)
    x = np.array([s.values.get(name, 0.0) for name in unknowns])
    rows = np.maximum(np.abs(K).max(axis=1, initial=0.0), SMALLEST)
    columns = np.maximum((np.abs(K) / rows[:, None]).max(axis=0, initial=0.0), SMALLEST)
    scaled = K / rows[:, None] / columns
    rest = (k - K @ x) / rows
    x = x + np.where(known, 0.0, _solved(scaled, rest, ~known) / columns)
    _note(found, "block_system", K @ x, k, float((np.abs(K) @ np.abs(x)).max(initial=0.0)))


def _solved(matrix: np.ndarray, right: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The least-squares solution in the unknowns at some places, once refined; 0 at the others."""
    solution = np.zeros(len(places))
    for _ in range(2):
        rest = right - matrix @ solution
        solution[places] += algebra.lstsq(matrix[:, places], rest)
    return solution


def _compare_transformation(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """B v_i + b is v."""
    B = _number(equations, "velocity_transformation", None, s.values).reshape(len(s.v), -1)
    b = _number(equations, "velocity_offset", None, s.values)
    _note(found, "velocity_transformation", B @ s.v[s.free] + b, s.v, 0.0)


def _compare_constraint_forces(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """M_t v' - f_t is what the constraints exert, of which C^T lambda gives each one's part."""
    written = equations.as_formed("tree_system")
    numbers = iter(evaluate(written.named, written.flat, s.values))
    n, m = len(s.v), len(equations.constraint_names)
    M, f, C = (np.array([next(numbers) for _ in range(a * b)]).reshape(a, b) for a, b in ((n, n), (n, 1), (m, n)))
    terms = np.column_stack([M * s.a, f])
    exerted = (M @ s.a) - f[:, 0]
    wanted = s.module.mass_matrix(s.q, t=s.t) @ s.a + s.module.bias(s.t, s.x)
    size = float(np.abs(terms).max(initial=0.0))
    _note(found, "forces of the constraints", exerted, wanted, size)
    if not equations.mobility.redundant:
        wanted = -multipliers(s.module, s.t, s.x)[list(equations.mobility.independent_rows)]
        _note(found, "multipliers", algebra.lstsq(C.T, exerted), wanted, size)


#: Quantity -> what compares a sum or a product in which it stands.
SUMS: dict[str, Callable[[dict[str, float], Any, StateNumbers], None]] = {
    "generalized_forces": _compare_forces,
    "velocity_transformation": _compare_transformation,
    "velocities": _compare_velocities,
    "momenta": _compare_momenta,
    "hamiltonian": _compare_hamiltonian,
    "gibbs_function": _compare_gibbs_function,
    "block_system": _compare_block_system,
    "tree_system": _compare_constraint_forces,
}
#: What is compared where no degree of freedom is left too.
OF_ALL = ("T", "V", "constraints", "velocity_constraints", "constraint_jacobian", "gamma", "velocities", "tree_system")
