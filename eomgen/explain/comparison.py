"""Shown formulas through SymPy at random consistent states, against the module."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy

from ..base import algebra
from ..base.limits.numbers import ALIKE, EPS, ROUNDED
from ..errors import EomgenError
from ..graph.core import Expr, symbols_of
from ..graph.evaluate import evaluate as of_graph
from ..graph.rounding_bounds import with_bounds
from ..kinematics.topology import acceleration_name
from ..runtime.constrained import multipliers
from .author import Author

# -- formulas at numbers -----------------------------------------------------------------------------------------------


def evaluate(named: Sequence[tuple[Any, Any]], flat: Sequence[Any], values: Mapping[str, float]) -> np.ndarray:
    """Expressions with named parts at numbers, each part of an expression once."""
    known = known_values(named, values)
    return np.array([float(value_of(x, known)) for x in flat])


def known_values(named: Sequence[tuple[Any, Any]], values: Mapping[str, float]) -> dict[Any, Any]:
    """Numbers of symbols, named parts included."""
    known: dict[Any, Any] = {sympy.Symbol(name): float(value) for name, value in values.items()}
    for symbol, expression in named:
        known[symbol] = value_of(expression, known)
    return known


def value_of(expression: Any, known: dict[Any, Any]) -> Any:
    """The value of an expression: sums, products and powers of floats here, all else as SymPy evaluates it."""
    if expression in known:
        return known[expression]
    if not expression.args:
        # true of a Piecewise stays, and an infinity in a branch of one that need not be taken
        value = float(expression) if expression.is_number and expression.is_finite else expression
    else:
        parts = [value_of(part, known) for part in expression.args]
        plain = all(type(part) is float for part in parts)
        if plain and expression.is_Add:
            value = math.fsum(parts)
        elif plain and expression.is_Mul:
            value = math.prod(parts)
        elif plain and expression.is_Pow and (parts[0] > 0 or (parts[0] < 0 and parts[1].is_integer())):
            value = parts[0] ** parts[1]
        else:
            value = expression.func(*(sympy.Float(x) if type(x) is float else x for x in parts))
            value = float(value) if value.is_Number and value.is_finite else value
    known[expression] = value
    return value


def state_values(module: Any, x: np.ndarray, t: float) -> dict[str, float]:
    """Numbers of all symbols at a state: coordinates, velocities, accelerations, parameters, inputs, time."""
    values = dict(zip(module.x_names, map(float, x), strict=True)) | {"t": t}
    rates = module.rhs(t, x)[module.n_q :]
    values |= dict(zip(map(acceleration_name, module.layout.v), map(float, rates), strict=True))
    values |= dict(zip(module.p_names, map(float, module.p), strict=True))
    return values | dict(zip(module.u_names, map(float, module.u), strict=True))


def moving_state(module: Any, velocities: Sequence[str]) -> tuple[np.ndarray, bool]:
    """The declared initial state and False; where it is at rest and can move, its position at velocities 1 and True.

    Parameters
    ----------
    module : BoundModel
    velocities : sequence of str
        Names of the independent velocities.
    """
    x = np.array(module.x0())
    position = x[: module.n_q]
    if not velocities or np.any(x[module.n_q : module.n_q + module.n_v]):
        return x, False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            moving = np.array(module.x0(dict.fromkeys(velocities, 1.0)))
            rates = module.rhs(0.0, moving)
    except EomgenError:
        return x, False
    same = np.allclose(moving[: module.n_q], position, rtol=0.0, atol=ALIKE) and np.isfinite(rates).all()
    return (moving, True) if same else (x, False)


def told_state(module: Any, x: np.ndarray) -> dict[str, float]:
    """Numbers of all symbols at a state, in which 0 stands for what rounding left of it."""
    values, layout = state_values(module, x, 0.0), module.layout
    places = np.ones(module.n_q) if layout.metadata["quaternion_slots"] else layout.place_scales.q[: module.n_q]
    known = [(module.x_names[: module.n_q], places, 1.0)]
    names, sizes = layout.v[: module.n_v], layout.scales.q[: module.n_v]  # first-order states come after them
    for rates in (names, [acceleration_name(name) for name in names]):
        largest = max((abs(values[n]) / s for n, s in zip(rates, sizes, strict=True)), default=0.0)
        known.append((rates, sizes, largest))
    for group, scales, largest in known:
        values |= {
            name: 0.0
            for name, scale in zip(group, scales, strict=True)
            if abs(values[name]) <= ROUNDED * scale * largest
        }
    return values


def is_rounding(expression: Any, value: float, named: Sequence[tuple[Any, Any]], values: Mapping[str, float]) -> bool:
    """Whether a value near 0 is no more than what rounding of the numbers makes of it."""
    if value == 0.0 or abs(value) > ALIKE:
        return False
    for turn in (0, 1):
        signs = (math.cos(2.4 * k + turn) for k in itertools.count())  # irregular, and the same each time
        moved = {name: x * (1.0 + ROUNDED * sign) for (name, x), sign in zip(values.items(), signs, strict=False)}
        if abs(float(value_of(expression, known_values(named, moved))) - value) >= abs(value):
            return True
    return False


def random_state(module: Any, seed: int, t: float = 0.0, size: float = 0.1) -> np.ndarray:
    """A consistent state near the declared one, moving."""
    random = np.random.default_rng(seed)
    x = np.array(module.x0(t=t))
    places = 1.0 if module.layout.metadata["quaternion_slots"] else module.layout.place_scales.q[: module.n_q]
    x[: module.n_q] += size * places * random.uniform(-1, 1, module.n_q)
    x[module.n_q :] += module.layout.scales.q * random.uniform(-1, 1, module.layout.n_v)
    return np.array(module.project(x, t=t))


# -- comparison --------------------------------------------------------------------------------------------------------


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
