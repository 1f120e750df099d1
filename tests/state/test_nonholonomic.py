"""Nonholonomic constraints of a bare Lagrangian: knife edge, rolling disc, and hand-made rows in a tree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from judges import augmented
from models import reference
from scipy.integrate import solve_ivp

import eomgen as eg
from eomgen.kinematics import analyse

TARGETS = ("cython", "numpy")
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


@pytest.mark.parametrize("target", TARGETS)
def test_knife_edge_follows_its_cycloid(target: str) -> None:
    """Closed form: from rest with spin W, x = a sin(W t)^2 / (2 W^2), y = a (W t - sin(2 W t) / 2) / (2 W^2)."""
    module = knife_edge().compile(target=target)
    assert (module.n_dof, module.n_c, module.constraints(np.zeros(3)).shape) == (2, 1, (0,))
    a, W = 9.81 * 0.5, 1.7
    traj = module.simulate(5.0, initial={"phi_dot": W}, rtol=1e-12, atol=1e-13)
    angle = W * traj.t
    np.testing.assert_allclose(traj["phi"], angle, atol=1e-11)
    np.testing.assert_allclose(traj["x"], a * np.sin(angle) ** 2 / (2 * W**2), atol=1e-9)
    np.testing.assert_allclose(traj["y"], a * (angle - np.sin(2 * angle) / 2) / (2 * W**2), atol=1e-9)
    assert traj.energy_drift < 1e-10
    assert traj.residuals.velocity < 1e-12


def disc_model() -> eg.Model:
    X, Y, psi, theta, phi = functions("X Y psi theta phi")
    m, r, g = sp.symbols("m r g")
    spin = sp.Matrix([theta.diff(t), phi.diff(t) + psi.diff(t) * sp.sin(theta), psi.diff(t) * sp.cos(theta)])
    z = r * sp.cos(theta)
    T = m * (X.diff(t) ** 2 + Y.diff(t) ** 2 + z.diff(t) ** 2) / 2
    T += m * r**2 / 8 * (spin[0] ** 2 + spin[2] ** 2) + m * r**2 / 4 * spin[1] ** 2
    turn = sp.rot_axis3(-psi) * sp.rot_axis1(-theta)
    contact = sp.Matrix([X.diff(t), Y.diff(t), z.diff(t)]) + (turn * spin).cross(turn * sp.Matrix([0, 0, -r]))
    return eg.Model.from_lagrangian(
        "disc", T - m * g * z, [X, Y, psi, theta, phi], constraints=[contact[0], contact[1]],
        parameters={m: 2, r: 0.5, g: 9.81},
    )  # fmt: skip


def newton_euler_disc(_: float, s: np.ndarray) -> np.ndarray:
    """Disc of unit mass ratio by Newton and Euler about the contact point, in the axes of lean (r = 0.5, g = 9.81)."""
    _, _, psi, theta, _, a, b, c = s  # a = theta', b = spin about the axle, c = psi' cos(theta)
    r, g = 0.5, 9.81
    psi_dot = c / np.cos(theta)
    frame = np.array([a, psi_dot * np.sin(theta), c])
    A, B = r * r / 4, r * r / 2
    # centre: v = w x (0, 0, r) = (b r, -a r, 0); force from a = v' + frame x v; moment of the force about the centre
    # unknown w' = (a', b', c'): I w' + frame x I w = (0, 0, -r) x F, F = v' + frame x v + g up
    up = np.array([0.0, np.sin(theta), np.cos(theta)])
    rest_force = np.cross(frame, [b * r, -a * r, 0.0]) + g * up
    rest = np.cross([0, 0, -r], rest_force) - np.cross(frame, [A * a, B * b, A * c])
    # v' = (b' r, -a' r, 0): (0, 0, -r) x v' = (-r^2 a', -r^2 b', 0)
    a_dot, b_dot, c_dot = rest / np.array([A + r * r, B + r * r, A])
    v = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]]) @ [b * r, -a * r * np.cos(theta)]
    return np.array([*v, psi_dot, a, b - psi_dot * np.sin(theta), a_dot, b_dot, c_dot])


@pytest.mark.parametrize("target", TARGETS)
def test_rolling_disc(target: str) -> None:
    """rolling_disc.json: accelerations; the way of 4 s against Newton and Euler about the contact point."""
    case = reference("rolling_disc")
    module = disc_model().compile(target=target)
    state = np.array(case["initial_state"])
    names = ("psi", "theta", "phi")
    given = dict(zip(module.x_names, state, strict=True))
    x = module.x0({n: given[n] for n in ("X", "Y", *names)} | {f"{n}_dot": given[f"{n}_dot"] for n in names})
    np.testing.assert_allclose(x, state, atol=1e-13)  # the velocity of the centre follows
    np.testing.assert_allclose(module.rhs(0.0, x)[5:], case["initial_acc"], atol=1e-9)
    traj = module.simulate(4.0, initial=x, rtol=1e-12, atol=1e-13)
    theta, psi_dot = given["theta"], given["psi_dot"]
    spins = [given["theta_dot"], given["phi_dot"] + psi_dot * np.sin(theta), psi_dot * np.cos(theta)]
    judge = solve_ivp(newton_euler_disc, (0, 4), [0, 0, 0, theta, 0, *spins], method="DOP853", rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(traj.x[:5, -1], judge.y[:5, -1], atol=1e-8)
    assert traj.energy_drift < 1e-10
    assert traj.residuals.velocity < 1e-11
    assert module.velocity_constraints(traj.x).shape == (2, len(traj.t))
    assert np.abs(module.velocity_constraints(traj.x, rows="all")).max() < 1e-13


def test_rolling_disc_in_steady_circles() -> None:
    case = reference("rolling_disc")
    module = disc_model().compile()
    for text, sample in case["steady_samples"].items():
        theta, psi_dot = (float(part.split("=")[1]) for part in text.split(","))
        x = module.x0(theta=theta, theta_dot=0.0, psi_dot=psi_dot, phi_dot=sample["phid"])
        traj = module.simulate(1.0, initial=x, rtol=1e-12, atol=1e-13)
        assert np.abs(traj["theta"] - theta).max() < 1e-8


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_projection_and_multipliers(target: str) -> None:
    module = disc_model().compile(target=target)
    random = np.random.default_rng(4)
    for _ in range(3):
        raw = random.uniform(-0.8, 0.8, module.n_x)
        x = module.project(raw)
        np.testing.assert_allclose(x[:5], raw[:5], atol=0)  # positions are free
        C_q = module.constraint_jacobian(x[:5], rows="all")
        assert np.abs(C_q @ x[5:]).max() < 1e-14
        np.testing.assert_allclose(x[5:] - raw[5:], np.linalg.pinv(C_q) @ C_q @ (x[5:] - raw[5:]), atol=1e-12)
        h = 1e-3

        def along(s: float, x: np.ndarray = x) -> np.ndarray:
            return module.constraint_jacobian(x[:5] + s * x[5:], rows="all") @ x[5:]

        gamma = (8 * (along(h) - along(-h)) - (along(2 * h) - along(-2 * h))) / (12 * h)
        a = augmented(module.mass_matrix(x[:5]), module.bias(0.0, x), C_q, gamma)
        np.testing.assert_allclose(module.rhs(0.0, x)[5:], a, atol=1e-9)
        h = 1e-5
        slopes = [(module.rhs(0.0, x + h * e) - module.rhs(0.0, x - h * e)) / (2 * h) for e in np.eye(10)]
        np.testing.assert_allclose(module.jacobian(0.0, x), np.array(slopes).T, atol=1e-8)


def test_holonomic_and_nonholonomic_rows_together_and_driven() -> None:
    """A skate whose centre is also led along a moving circle; sideways speed prescribed: both levels, both with t."""

    def rows(x: Any, y: Any, phi: Any) -> list[Any]:
        return [x.diff(t) * sp.sin(phi) - y.diff(t) * sp.cos(phi) - sp.Rational(1, 10) * sp.cos(t),
                x**2 + y**2 - (1 + sp.sin(t) / 5) ** 2]  # fmt: skip

    modules = [knife_edge(rows).compile(target=target) for target in TARGETS]
    for module in modules:
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
    states = modules[0].project(np.random.default_rng(2).uniform(0.3, 0.9, (6, 4)), t=0.3)
    np.testing.assert_allclose(modules[0].rhs(0.3, states), modules[1].rhs(0.3, states), rtol=1e-10)
    with pytest.raises(eg.UsageError, match="nonholonomic constraints restrict velocities but not positions"):
        _ = modules[0].minimal


def test_report_says_how_many() -> None:
    report = disc_model().derive().report
    assert (report.degrees_of_freedom, report.configuration_freedoms, report.nonholonomic) == (3, 5, 2)
    assert "2, 2 of them nonholonomic" in str(report)


def test_dependent_velocities_given_too_are_an_error() -> None:
    module = knife_edge().compile(target="numpy")
    with pytest.raises(eg.AssemblyError, match="y_dot = 0.5 cannot be reached.*across a blade.*give x_dot or phi_dot"):
        module.x0(x_dot=1.0, y_dot=0.5, phi_dot=0.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("x_dot**2 - y_dot", "is not linear in the velocities"),
        ("sin(x_dot)", "not linear"),
        ("x_ddot", "cannot be used"),
    ],
)
def test_other_constraints_are_refused_by_name(text: str, fault: str) -> None:
    model = eg.Model.from_lagrangian("s", "x_dot**2 + y_dot**2", ["x", "y"], constraints=[text])
    with pytest.raises(eg.ModelError, match=rf"lagrangian.constraints\[0\].*{fault}"):
        model.derive()


def test_yaml_round_trip(tmp_path: Any) -> None:
    path = tmp_path / "skate.yaml"
    path.write_text(knife_edge().to_yaml())
    again = eg.load(path)
    assert again.to_yaml() == knife_edge().to_yaml()
    assert analyse(again.mechanism()).constraints.nonholonomic == 1


def test_equations_of_the_skate_in_symbols() -> None:
    equations = knife_edge().derive(independent=["phi", "x"])
    matrix, force = equations.mass_matrix, equations.force
    assert matrix.shape == (2, 2)
    values = {"m": 2.0, "J": 0.3, "w": 9.81, "phi": 0.4, "phi_dot": 1.1, "x": 0.0, "x_dot": 0.7}
    values["y_dot"] = 0.7 * np.tan(0.4)
    numbers = {sp.Symbol(k): v for k, v in values.items()}
    a = np.array(matrix.subs(numbers).inv() * force.subs(numbers), dtype=float).ravel()
    # along the edge: m u' = w cos(phi), x' = u cos(phi)
    u = 0.7 / np.cos(0.4)
    expected = 9.81 / 2 * np.cos(0.4) ** 2 - u * np.sin(0.4) * 1.1
    np.testing.assert_allclose(a, [0.0, expected], atol=1e-12)
