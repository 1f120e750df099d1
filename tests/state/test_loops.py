"""Closed spatial loops with spherical joints in Euler parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rotations
from judges import augmented
from models import reference

import eomgen as eg

TARGETS = ("cython", "numpy")


def four_bar(rotation: str, keep: str = "") -> eg.Model:
    """RSSR; ``keep`` names a velocity or coordinate that keeps its joint in the tree."""
    m = eg.Model("rssr", gravity=(0, 0, -9.81))
    crank = m.body("crank", mass=1.0, com=(0.05, 0, 0), inertia=(1e-3, 2e-3, 2e-3))
    rod = m.body("rod", mass=0.7, com=(0.2, 0.01, 0), inertia=(1e-4, 3e-3, 3.1e-3))
    rocker = m.body("rocker", mass=0.9, com=(0.1, 0, 0), inertia=(1e-3, 4e-3, 4e-3))
    m.revolute("A", m.ground, crank, coordinate="th")
    m.spherical("S", crank.at(0.1, 0, 0), rod, rotation=rotation)
    m.revolute("D", m.ground.at(0.4, 0.1, 0.05), rocker, axis="y", coordinate="ph")
    m.spherical("T", rod.at(0.4, 0, 0), rocker.at(0.25, 0, 0), rotation=rotation)
    m.initial(th=0.3, th_dot=5.0)
    m.damper("d", m.ground.at(0.1, 0.1, 0.1), rod.at(0.3, 0, 0), damping=0.4)
    for k, axis in enumerate("xyz"):
        point = rod.at(0.2, 0.1, 0.05)
        m.output(f"a{axis}", point.acceleration[k])
    if keep:
        m.independent("th", keep)
    return m


def as_parameters(angles: Any, parameters: Any, x: np.ndarray) -> np.ndarray:
    """A state of the model in Euler angles as one in Euler parameters, by poses and their rates."""
    named = dict(zip(angles.x_names, x, strict=True))

    def relative(q: np.ndarray) -> np.ndarray:
        crank, rod = angles.poses(q)[:2, :3, :3]
        return crank.T @ rod

    q, v, h = x[: angles.n_q], x[angles.n_q :], 1e-3
    R = relative(q)
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    R_dot = sum(c * (relative(q + k * h * v) - relative(q - k * h * v)) for k, c in enumerate(weights, 1)) / h
    W = R.T @ R_dot
    named |= {f"S_e{k}": y for k, y in enumerate(rotations.from_matrix(R))}
    named |= {"S_wx": W[2, 1], "S_wy": W[0, 2], "S_wz": W[1, 0]}
    return np.array([named[name] for name in parameters.x_names])


@pytest.fixture(scope="module")
def modules() -> dict[tuple[str, str], Any]:
    return {
        (rotation, target): four_bar(rotation).compile(target=target)
        for rotation in ("euler_angles", "euler_parameters")
        for target in TARGETS
    }


def states(modules: dict[tuple[str, str], Any]) -> list[tuple[np.ndarray, np.ndarray]]:
    angles, parameters = modules["euler_angles", "numpy"], modules["euler_parameters", "numpy"]
    found = []
    for th, spin in ((0.3, 0.0), (0.6, 4.0), (-0.4, -3.0)):
        x = angles.x0(th=th, th_dot=5.0, S_1_dot=spin)
        found.append((x, as_parameters(angles, parameters, x)))
    return found


def test_parameters_equal_angles(modules: dict[tuple[str, str], Any]) -> None:
    for x, y in states(modules):
        for target in TARGETS:
            a, b = modules["euler_angles", target], modules["euler_parameters", target]
            np.testing.assert_allclose(b.project(y), y, atol=1e-9)
            np.testing.assert_allclose(b.outputs(0.0, y), a.outputs(0.0, x), rtol=1e-7, atol=1e-7)
            np.testing.assert_allclose(b.energy(y), a.energy(x), rtol=1e-9)


@pytest.mark.parametrize("target", TARGETS)
def test_accelerations_equal_multipliers_and_the_jacobian_differences(
    target: str, modules: dict[tuple[str, str], Any]
) -> None:
    module = modules["euler_parameters", target]
    for _, y in states(modules):
        y = module.project(y)
        n = module.n_q
        q, v = y[:n], y[n:]
        assert np.abs(module.constraints(q, rows="all")).max() < 1e-14
        x_dot = module.rhs(0.0, y)
        np.testing.assert_allclose(x_dot[:n], rotations.coordinate_rates(module.metadata, q, v), atol=1e-12)
        C_q, h = module.constraint_jacobian(q, rows="all"), 1e-4

        def along(s: float, q: np.ndarray = q, d: np.ndarray = x_dot[:n], v: np.ndarray = v) -> np.ndarray:
            return module.constraint_jacobian(q + s * d, rows="all") @ v

        gamma = (8 * (along(h) - along(-h)) - (along(2 * h) - along(-2 * h))) / (12 * h)
        a = augmented(module.mass_matrix(q), module.bias(0.0, y), C_q, gamma)
        np.testing.assert_allclose(x_dot[n:], a, atol=1e-7 * np.abs(a).max())
        J, h = module.jacobian(0.0, y), 1e-6
        slopes = [(module.rhs(0.0, y + h * e) - module.rhs(0.0, y - h * e)) / (2 * h) for e in np.eye(module.n_x)]
        np.testing.assert_allclose(J, np.array(slopes).T, atol=3e-7 * np.abs(J).max())
        scaled = np.array(y)
        scaled[[name[-3:-1] == "_e" for name in module.x_names]] *= 1.7  # the length of e means nothing
        np.testing.assert_allclose(module.rhs(0.0, scaled)[n:], x_dot[n:], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(module.project(scaled), y, atol=1e-12)


def test_targets_agree_and_trajectories_are_the_same(modules: dict[tuple[str, str], Any]) -> None:
    x, y = states(modules)[1]
    runs = {}
    for rotation, start in (("euler_angles", x), ("euler_parameters", y)):
        runs[rotation] = modules[rotation, "cython"].simulate(0.6, initial=start, rtol=1e-11, atol=1e-13)
    for name in ("th", "ph", "ax", "ay", "az", "energy"):
        wanted, found = (run[name][-1] for run in runs.values())
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-6)
    run = runs["euler_parameters"]
    assert run.residuals.position < 1e-12
    e = np.array([run[f"T_e{k}"] for k in range(4)])  # of the joint that was cut
    np.testing.assert_allclose((e * e).sum(axis=0), 1.0, atol=1e-12)
    for k in range(0, len(run.t), 7):
        rod, rocker = modules["euler_parameters", "cython"].poses(run.x[:6, k])[1:, :3, :3]
        np.testing.assert_allclose(rotations.matrix(e[:, k]), rod.T @ rocker, atol=1e-10)
    a, b = (modules["euler_parameters", target] for target in TARGETS)
    for k in (0, -1):
        state = run.x[:, k]
        np.testing.assert_allclose(a.rhs(0, state), b.rhs(0, state), atol=1e-11 * np.abs(b.rhs(0, state)).max())
        np.testing.assert_allclose(a.jacobian(0, state), b.jacobian(0, state), atol=1e-10 * np.abs(J_size(b, state)))


def J_size(module: Any, state: np.ndarray) -> float:
    return float(np.abs(module.jacobian(0, state)).max())


def test_a_chosen_angular_velocity_keeps_its_joint_in_the_tree() -> None:
    module = four_bar("euler_parameters", keep="T_wx").compile(target="numpy")
    assert "T_wx" in module.v_names
    assert module.loop_names[0] == "S_e0"
    x = module.x0(th=0.3, th_dot=5.0, T_wx=2.0)
    assert x[module.n_q + module.v_names.index("T_wx")] == 2.0
    assert np.abs(module.constraints(x[: module.n_q], rows="all")).max() < 1e-12


@pytest.mark.parametrize("target", TARGETS)
def test_spatial_slider_crank(target: str) -> None:
    """iftomm_spatial_slider_crank.json (Haug; EXUDYN): spherical joint in Euler parameters, universal one by hand."""
    case = reference("iftomm_spatial_slider_crank")
    p, start = case["parameters_SI"], case["initial_conditions"]
    m = eg.Model("spatial", gravity=(0, 0, -p["g"]))
    crank = m.body("crank", mass=p["m_crank"], inertia=p["I_crank"])
    rod = m.body("rod", mass=p["m_conrod"], inertia=p["I_conrod"])
    cross = m.body("cross", mass=0.0)
    slider = m.body("slider", mass=p["m_slider"])
    half, bend = p["conrod_length"] / 2, float(np.arcsin(0.2480694692))
    m.revolute("A", m.ground.at(*p["A"]), crank, axis="x", coordinate="crank_angle")
    m.spherical("B", crank.at(0, 0, p["crank_length"]), rod.at(-half, 0, 0), rotation="euler_parameters")
    m.revolute("U", rod.at(half, 0, 0), cross.at(0, 0, 0, rpy=(0, 0, bend)), axis="y")
    m.revolute("V", cross, slider, axis="x")
    m.prismatic("C", m.ground, slider, axis="x", coordinate="slider_x")
    rows = case["reference"]["U_const_angle"]["rows"]
    m.initial(crank_angle=0.0, crank_angle_dot=start["crank_rate"])
    m.guess(slider_x=0.2, **{f"B_e{k}": x for k, x in enumerate(unit(rows["0"]["conrod_quat"]))})
    m.independent("crank_angle")
    module = m.compile(target=target)
    assert module.n_dof == 1
    times = [float(text) for text in rows][:3]
    traj = module.simulate((0, max(times)), t_eval=times, rtol=1e-10, atol=1e-12)
    for name in ("crank_angle", "slider_x"):
        np.testing.assert_allclose(traj[name], [row[name] for row in list(rows.values())[:3]], atol=1e-7)
    np.testing.assert_allclose(traj["slider_x_dot"], [row["slider_v"] for row in list(rows.values())[:3]], atol=1e-6)
    q, v, _ = module.kinematics([0.4], [6.0])  # one degree of freedom, a plain angle: the minimal form is there
    assert np.abs(module.constraints(q, rows="all")).max() < 1e-12
    x = module.minimal.x0(crank_angle=0.4, crank_angle_dot=6.0)
    np.testing.assert_allclose(module.minimal.expand(x), [*q, *v], atol=1e-9)
    assert module.minimal.rhs(0.0, x)[1] == pytest.approx(
        module.rhs(0.0, np.concatenate([q, v]))[module.n_q + module.v_names.index("crank_angle_dot")], rel=1e-9
    )


def unit(e: list[float]) -> np.ndarray:
    return np.array(e) / np.linalg.norm(e)
