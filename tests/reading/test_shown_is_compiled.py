"""Every quantity that is shown, evaluated through SymPy, against the compiled module at random consistent states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shown_numbers import number, random_state, state_values

import eomgen as eg

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
CLOSE = 1e-10


def agree(shown: object, wanted: object, size: float = 0.0) -> None:
    shown, wanted = np.asarray(shown, dtype=float), np.asarray(wanted, dtype=float)
    assert shown.shape == wanted.shape
    largest = max(np.abs(wanted).max(initial=0.0), size, 1e-12)
    assert np.abs(shown - wanted).max(initial=0.0) <= CLOSE * largest


def compare(name: str, method: str) -> None:
    equations = eg.load(EXAMPLES / f"{name}.yaml").derive(method)
    module = equations.compile(target="numpy")
    n = module.n_q
    x = random_state(module, seed=7)
    values = state_values(module, x, 0.0)
    q, v = x[:n], x[n:]
    a = module.rhs(0.0, x)[n:]
    T, V = module.energy(x)
    scale = abs(T) + abs(V)
    agree(number(equations, "T", values), T, scale)
    agree(number(equations, "V", values), V, scale)
    agree(number(equations, "lagrangian", values), T - V, scale)
    C_q = module.constraint_jacobian(q)
    agree(number(equations, "constraints", values)[:, 0], module.constraints(q), equations.mobility.length_scale)
    agree(number(equations, "constraint_jacobian", values), C_q)
    gamma = number(equations, "gamma", values)[:, 0]
    agree(gamma, -C_q @ a, np.abs(C_q @ np.diag(a)).max(initial=0.0))
    B = number(equations, "velocity_transformation", values)
    free = list(module.layout.metadata["independent"])
    agree(B @ v[free] + number(equations, "velocity_offset", values)[:, 0], v)
    agree(B @ a[free] + number(equations, "acceleration_offset", values)[:, 0], a)
    M = number(equations, "mass_matrix", values)
    agree(M, module.embedded_mass_matrix(q))
    force = number(equations, "force", values)[:, 0]
    agree(force, M @ a[free], np.abs(M * a[free]).max(initial=0.0))
    Q = number(equations, "generalized_forces", values)[:, 0]
    Q_v = number(equations, "quadratic_velocity", values)[:, 0]
    agree(Q_v + Q, force, np.abs(Q).max(initial=0.0) + np.abs(Q_v).max(initial=0.0))
    for k, body in enumerate(module.body_names):
        agree(number(equations, "poses", values, body), module.poses(q)[k])


@pytest.mark.parametrize("name", NAMES)
def test_of_every_example(name: str) -> None:
    compare(name, "auto")
