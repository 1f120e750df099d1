"""What descriptions say about rotations: keys, faults, round trips, power."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rotations

import eomgen as eg


def stone(**keys: Any) -> eg.Model:
    m = eg.Model("stone", gravity=(0, 0, -9.81))
    b = m.body("b", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(1, 2, 2.5))
    m.free("f", m.ground, b, **{"rotation": "euler_parameters", **keys})
    return m


def test_round_trip_and_named_coordinates() -> None:
    m = stone(coordinates=["x", "y", "z", "a", "b_", "c", "d"])
    m.initial(f_wx=1.0, a=0.0, c=1.0)
    again = m.to_yaml()
    assert "rotation: euler_parameters" in again
    module = m.compile(target="numpy")
    assert module.q_names == ("x", "y", "z", "a", "b_", "c", "d")
    assert module.v_names == ("x_dot", "y_dot", "z_dot", "f_wx", "f_wy", "f_wz")
    np.testing.assert_array_equal(module.x0()[3:7], [0, 0, 1, 0])


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda m: m.joint("free", "g", "ground", "b", rotation="quaternion"), "joints.g.rotation.*euler_parameters"),
        (lambda m: m.torque("t", "f_e1", 1.0), "forces.t.joint.*Euler parameter, which takes no torque.*body"),
        (lambda m: m.friction("t", "f_e1", viscous=1.0), "forces.t.joint.*Euler parameter"),
        (lambda m: m.initial(f_e0_dot=1.0), "initial.f_e0_dot.*f_wx"),
        (lambda m: m.parameter("f_wx", 1.0), "'f_wx' is already used"),
        (lambda m: m.independent("f_e0"), "independent.*'f_e0' is an Euler parameter.*f_wx"),
    ],
)
def test_faults(change: Any, fault: str) -> None:
    m = stone()
    change(m)
    with pytest.raises(eg.ModelError, match=f"(?s){fault}"):
        m.derive()


def test_a_sequence_belongs_to_angles() -> None:
    with pytest.raises(eg.ModelError, match="joints.f.sequence.*Euler parameters have no sequence"):
        stone(sequence="zxz").mechanism()


def test_initial_parameters_of_another_length_are_told_when_the_model_is_checked() -> None:
    m = stone()
    m.initial(f_e0=0.9, f_e1=0.9)
    with pytest.raises(eg.AssemblyError, match="f_e0 = 0.9.*length 1.27"):
        m.check()


def test_power_is_wrench_times_twist() -> None:
    m = stone()
    m.torque("turn", "b", (0.3, -0.2, 0.5), axes="body")
    m.force("push", {"body": "b", "at": [0.1, -0.3, 0.2]}, (1.0, 2.0, -0.5))
    module = m.compile(target="numpy")
    random = np.random.default_rng(5)
    for _ in range(3):
        x = module.project(random.uniform(-1, 1, module.n_x))
        x_dot, h = module.rhs(0.0, x), 1e-4
        energy = [module.energy(x + k * h * x_dot).sum() for k in (-2, -1, 1, 2)]
        change = (energy[0] - 8 * energy[1] + 8 * energy[2] - energy[3]) / (12 * h)
        R, w = rotations.matrix(x[3:7]), x[10:]
        point = x[7:10] + R @ np.cross(w, [0.1, -0.3, 0.2])
        power = np.array([0.3, -0.2, 0.5]) @ w + np.array([1.0, 2.0, -0.5]) @ point
        assert change == pytest.approx(power, rel=1e-8)


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
def test_batches(rotation: str) -> None:
    modules = [stone(rotation=rotation).compile(target=target) for target in ("cython", "numpy")]
    X = np.random.default_rng(1).uniform(0.2, 0.9, (modules[0].n_x, 5))
    for name in ("rhs", "jacobian"):
        results = [getattr(module, name)(0.0, X) for module in modules]
        np.testing.assert_allclose(results[0], results[1], atol=1e-11)
        np.testing.assert_allclose(results[0][..., 2], getattr(modules[0], name)(0.0, X[:, 2]), atol=0)
    projected = [module.project(X) for module in modules]
    np.testing.assert_allclose(projected[0], projected[1], atol=1e-15)
