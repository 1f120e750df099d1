"""Nonholonomic constraints of a bare Lagrangian: a skate's cycloid, rows of both levels that move, what is refused."""

from typing import Any

import numpy as np
import pytest
import sympy as sp
from refusals import refuses

import eomgen as eg

t = sp.Symbol("t")


def functions(names: str) -> list[Any]:
    return [sp.Function(name)(t) for name in names.split()]


def knife_edge(constraints: Any = None) -> eg.Model:
    """A skate on an inclined plane (Neimark and Fufaev, 1972): it cannot move sideways."""
    x, y, phi = functions("x y phi")
    m, J, w = sp.symbols("m J w")  # w: m g sin(slope), down x
    L = m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + J * phi.diff(t) ** 2 / 2 + w * x
    row = x.diff(t) * sp.sin(phi) - y.diff(t) * sp.cos(phi)
    rows = [row] if constraints is None else constraints(x, y, phi)
    return eg.Model.from_lagrangian(
        "skate", L, [x, y, phi], constraints=rows, parameters={m: 2.0, J: 0.3, w: 2.0 * 9.81 * 0.5}
    )


def test_knife_edge_follows_its_cycloid() -> None:
    """Closed form: from rest with spin W, x = a sin(W t)^2 / (2 W^2), y = a (W t - sin(2 W t) / 2) / (2 W^2)."""
    module = knife_edge().compile(target="numpy")
    assert (module.n_dof, module.n_c, module.constraints(np.zeros(3)).shape) == (2, 1, (0,))
    a, W = 9.81 * 0.5, 1.7
    traj = module.simulate(5.0, initial={"phi_dot": W}, rtol=1e-12, atol=1e-13)
    angle = W * traj.t
    np.testing.assert_allclose(traj["phi"], angle, atol=1e-11)
    np.testing.assert_allclose(traj["x"], a * np.sin(angle) ** 2 / (2 * W**2), atol=1e-9)
    np.testing.assert_allclose(traj["y"], a * (angle - np.sin(2 * angle) / 2) / (2 * W**2), atol=1e-9)
    assert traj.energy_drift < 1e-10
    assert traj.residuals.velocity < 1e-12


def test_holonomic_and_nonholonomic_rows_together_and_driven() -> None:
    """A skate whose centre is also led along a moving circle; sideways speed prescribed: both levels, both with t."""

    def rows(x: Any, y: Any, phi: Any) -> list[Any]:
        return [x.diff(t) * sp.sin(phi) - y.diff(t) * sp.cos(phi) - sp.Rational(1, 10) * sp.cos(t),
                x**2 + y**2 - (1 + sp.sin(t) / 5) ** 2]  # fmt: skip

    module = knife_edge(rows).compile(target="numpy")
    assert (module.n_dof, module.constraints(np.zeros(3), rows="all").shape) == (1, (1,))
    assert module.metadata["constraint_labels"] == ["constraint_2", "constraint_1"]
    x0 = module.x0(x=0.6, phi=1.2, phi_dot=0.4, t=0.5)
    assert x0[2] == 1.2
    traj = module.simulate((0.5, 2.0), initial=x0, rtol=1e-11, atol=1e-12)
    x, y, phi = traj.x[:3]
    sideways = traj["x_dot"] * np.sin(phi) - traj["y_dot"] * np.cos(phi)
    np.testing.assert_allclose(sideways, 0.1 * np.cos(traj.t), atol=1e-11)
    np.testing.assert_allclose(x**2 + y**2, (1 + np.sin(traj.t) / 5) ** 2, atol=1e-11)
    state, h = traj.x[:, 3], 1e-6
    slopes = [(module.rhs(0.7, s + h * e) - module.rhs(0.7, s - h * e)) / (2 * h)
              for s in [module.project(state, t=0.7)] for e in np.eye(6)]  # fmt: skip
    J = module.jacobian(0.7, module.project(state, t=0.7))
    np.testing.assert_allclose(J, np.array(slopes).T, atol=1e-6 * np.abs(J).max())
    refuses("EG-UNSUPPORTED nonholonomic", getattr, module, "minimal")


def test_dependent_velocities_given_too_are_an_error() -> None:
    module = knife_edge().compile(target="numpy")
    refuses("EG-CONTRADICTION y_dot 0.5 x_dot phi_dot", module.x0, x_dot=1.0, y_dot=0.5, phi_dot=0.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("x_dot**2 - y_dot", "EG-EXPRESSION"),
        ("sin(x_dot)", "EG-EXPRESSION"),
        ("x_ddot", "EG-REFERENCE 'x_ddot'"),
        ("x == y", "EG-EXPRESSION comparison"),
    ],
)
def test_other_constraints_are_refused_by_name(text: str, fault: str) -> None:
    model = eg.Model.from_lagrangian("s", "x_dot**2 + y_dot**2", ["x", "y"], constraints=[text])
    refuses(f"{fault} lagrangian.constraints[0]:", model.derive)
