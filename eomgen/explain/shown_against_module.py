"""Stage explain, comparison: shown formulas through SymPy at random consistent states, against the module."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import sympy

from ..limits.rounding import EPS
from .shown_values import evaluate, random_state, state_values

STATES = 2
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

    @property
    def q(self) -> Any:
        return self.x[: self.module.n_q]

    @property
    def v(self) -> Any:
        return self.x[self.module.n_q :]

    @property
    def a(self) -> Any:
        return self.module.rhs(0.0, self.x)[self.module.n_q :]


def compare(equations: Any, module: Any, shown: set[tuple[str, str | None]]) -> Difference:
    """Compare every shown quantity that a module has too; mass matrix and force always."""
    found: dict[str, float] = {}
    wanted = {name for name, _ in shown} | {"mass_matrix", "force"}
    for seed in range(STATES):
        x = random_state(module, seed + 1)
        free = list(module.layout.metadata["independent"])
        state = StateNumbers(module, x, state_values(module, x, 0.0), free)
        for name, of_module in COMPARED.items():
            if name in wanted and (equations.mobility.n_dof or name in ("T", "V")):
                _note(found, name, _number(equations, name, None, state.values), *of_module(state))
        if "poses" in wanted:
            for body, pose in zip(module.body_names, module.poses(state.q), strict=True):
                if ("poses", body) in shown:
                    _note(found, f"poses[{body}]", _number(equations, "poses", body, state.values), pose.ravel(), 1.0)
        if "generalized_forces" in wanted and {"force", "quadratic_velocity"} <= set(found) | {"quadratic_velocity"}:
            _compare_forces(found, equations, state)
        if "velocity_transformation" in wanted and equations.mobility.n_dof:
            _compare_transformation(found, equations, state)
    return Difference(found, STATES)


Wanted = tuple[Any, float]


def _energy(k: int) -> Callable[[StateNumbers], Wanted]:
    def wanted(s: StateNumbers) -> Wanted:
        energies = s.module.energy(s.x)
        return np.array([energies[k]]), float(np.abs(energies).sum())

    return wanted


def _force(s: StateNumbers) -> Wanted:
    terms = s.module.embedded_mass_matrix(s.q) * s.a[s.free]
    return terms.sum(axis=1), float(np.abs(terms).max(initial=0.0))


def _gamma(s: StateNumbers) -> Wanted:
    terms = s.module.constraint_jacobian(s.q) * s.a
    return -terms.sum(axis=1), float(np.abs(terms).max(initial=0.0))


def _velocity_constraints(s: StateNumbers) -> Wanted:
    terms = s.module.constraint_jacobian(s.q) * s.v
    return s.module.velocity_constraints(s.x), float(np.abs(terms).max(initial=0.0))


#: Quantity -> what the module has for it at a state, flat, and the size of the terms that it is a sum of.
COMPARED: dict[str, Callable[[StateNumbers], Wanted]] = {
    "T": _energy(0),
    "V": _energy(1),
    "mass_matrix": lambda s: (s.module.embedded_mass_matrix(s.q).ravel(), 0.0),
    "force": _force,
    "momenta": lambda s: (s.module.mass_matrix(s.q) @ s.v, 0.0),
    "constraints": lambda s: (s.module.constraints(s.q), 1.0),
    "velocity_constraints": _velocity_constraints,
    "constraint_jacobian": lambda s: (s.module.constraint_jacobian(s.q).ravel(), 0.0),
    "gamma": _gamma,
}


def _number(equations: Any, name: str, part: str | None, values: Mapping[str, float]) -> Any:
    named, value = equations.written(name, part)
    return evaluate(named, list(value) if isinstance(value, sympy.MatrixBase) else [value], values)


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


def _compare_transformation(found: dict[str, float], equations: Any, s: StateNumbers) -> None:
    """B v_i + b is v."""
    B = _number(equations, "velocity_transformation", None, s.values).reshape(len(s.v), -1)
    b = _number(equations, "velocity_offset", None, s.values)
    _note(found, "velocity_transformation", B @ s.v[s.free] + b, s.v, 0.0)
