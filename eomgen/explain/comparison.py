"""Shown formulas through SymPy at the random states of ``verify``, against the module."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy

from ..base.limits.numbers import ALIKE, EPS, ROUNDED
from ..base.texts import acceleration_name
from ..errors import EomgenError
from ..expr.core import Expr, symbols_of
from ..expr.evaluate import evaluate as of_graph
from ..expr.identity import with_bounds
from ..verify.finding import Comparison
from ..verify.random_states import SystemState, called, random_states
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


def state_values(module: Any, case: SystemState) -> dict[str, float]:
    """Numbers of all symbols at a state: coordinates, velocities, accelerations, parameters, inputs, time."""
    rates = called(module, "rhs", case)[module.n_q :]
    names = (*module.x_names, *map(acceleration_name, module.layout.v), *module.p_names, *module.u_names, "t")
    flat = (*case.x, *rates, *case.p, *case.u, case.t)
    return dict(zip(names, map(float, flat), strict=True))


def moving_state(module: Any, velocities: Sequence[str]) -> tuple[np.ndarray, bool]:
    """The declared initial state and False; where it is at rest and can move, its position at velocities 1 and True."""
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


def state_numbers(module: Any, x: np.ndarray) -> dict[str, float]:
    """Numbers of all symbols at a state, in which 0 stands for what rounding left of it."""
    case = SystemState(0, 0.0, x, np.zeros(module.layout.n_v), module.p, module.u, module.n_q)
    values, layout = state_values(module, case), module.layout
    places = np.ones(module.n_q) if layout.info.quaternion_slots else layout.place_scales.q[: module.n_q]
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


# -- comparison --------------------------------------------------------------------------------------------------------


STATES = 2
SMALLEST = 4096 * EPS  #: entries that count as 0


class Difference(NamedTuple):
    """Differences of shown formulas from the compiled module, as shares of the largest entry or term."""

    each: Mapping[str, float]
    states: int

    @property
    def largest(self) -> float:
        """The largest of all."""
        return max(self.each.values(), default=0.0)


def compare(author: Author, module: Any) -> Difference:
    """Compare every shown formula at the states of ``verify``: with the module, else with the derivation as formed.

    What the state does not know, such as reactions, variations and momenta, gets numbers at random.
    """
    result: dict[str, Comparison] = {}
    equations = author.equations
    printed = {(s.name, s.part) for s in author.printed if s.name} | {("mass_matrix", None), ("force", None)}
    each = {row.name for row in equations.rows() if row.by_name}
    others = sorted((key for key in printed if key[0] not in COMPARED), key=str)
    moves = bool(equations.mobility.n_dof)
    for case in random_states(module, STATES, at_values=True):
        values = state_values(module, case)
        wanted = Wanted(module, case)
        for name, part in sorted(printed, key=str):
            if name in COMPARED and (moves or name not in OF_FREEDOMS):
                _note(result, name, _number(equations, name, None, values), *COMPARED[name](wanted))
            elif name == "poses" and part in module.body_names:
                pose = wanted.of("poses")[module.body_names.index(part)]
                _note(result, f"poses[{part}]", _number(equations, "poses", part, values), pose.ravel(), 1.0)
        keys = {f"{name}[{part}]" if name in each else name: (name, part) for name, part in others}
        for what, key in keys.items():
            written, formed = equations.as_formed(*key)
            _compare_formed(result, what, formed.flat, formed.named or (), written, values)
        for what, expressions, written in author.formed:
            _compare_formed(result, what, expressions, (), written, values)
    return Difference({name: one.finding().worst for name, one in result.items()}, STATES)


class Wanted(NamedTuple):
    """What a module gives at a state, as numbers of a size: (flat array, size of the terms that it is a sum of)."""

    module: Any
    case: SystemState

    def of(self, name: str) -> Any:
        """The result of a call."""
        return called(self.module, name, self.case)

    @property
    def a(self) -> Any:
        """Accelerations."""
        return self.of("rhs")[self.module.n_q :][: self.module.n_v]

    def energy(self, k: int) -> tuple[Any, float]:
        """T or V."""
        energies = self.of("energy")
        return np.array([energies[k]]), float(np.abs(energies).sum())

    def product(self, matrix: str, rates: Any, sign: float = 1.0) -> tuple[Any, float]:
        """A matrix times rates."""
        terms = self.of(matrix) * rates
        return sign * terms.sum(axis=1), float(np.abs(terms).max(initial=0.0))


#: Quantity -> what the module has for it at a state, flat, and the size of the terms that it is a sum of.
COMPARED: dict[str, Callable[[Wanted], tuple[Any, float]]] = {
    "T": lambda s: s.energy(0),
    "V": lambda s: s.energy(1),
    "mass_matrix": lambda s: (s.of("embedded_mass_matrix").ravel(), 0.0),
    "force": lambda s: s.product("embedded_mass_matrix", s.a[s.module.layout.independent_moving]),
    "constraints": lambda s: (s.of("constraints"), 1.0),
    "velocity_constraints": lambda s: (
        s.of("velocity_constraints"),
        s.product("constraint_jacobian", s.case.v[: s.module.n_v])[1],
    ),
    "constraint_jacobian": lambda s: (s.of("constraint_jacobian").ravel(), 0.0),
    "gamma": lambda s: s.product("constraint_jacobian", s.a, -1.0),
}
OF_FREEDOMS = ("mass_matrix", "force")  #: are compared where something is free to move


def _number(equations: Any, name: str, part: str | None, values: Mapping[str, float]) -> Any:
    named, value = equations.written(name, part)
    return evaluate(named, list(value) if isinstance(value, sympy.MatrixBase) else [value], values)


def _compare_formed(
    result: dict[str, Comparison],
    what: str,
    formed: Sequence[Expr],
    named: Sequence[tuple[str, Expr]],
    written: tuple[Sequence[tuple[Any, Any]], Sequence[Any]],
    values: Mapping[str, float],
) -> None:
    """A formula in SymPy against the expressions of the derivation, evaluated on their graph."""
    unknown = symbols_of([*formed, *(x for _, x in named)]).difference(values, (name for name, _ in named))
    random = np.random.default_rng(2)
    numbers = dict(values) | {name: float(random.uniform(-1, 1)) for name in sorted(unknown)}
    at = dict(numbers)
    for name, x in named:
        at[name] = float(of_graph([x], at)[0])
    wanted, terms = with_bounds(formed, at)
    _note(result, what, evaluate(*written, numbers), wanted, float(np.max(terms[np.isfinite(terms)], initial=0.0)))


def _note(result: dict[str, Comparison], name: str, printed: Any, wanted: Any, size: float) -> None:
    largest = max(float(np.abs(wanted).max(initial=0.0)), size, SMALLEST)
    result.setdefault(name, Comparison(name)).add(0, printed - wanted, largest, largest)
