"""A mechanism that cannot move: every call and every integrator still answers."""

import numpy as np
import pytest
from refusals import refuses
from sweeps import TARGETS

import eomgen as eg


@pytest.mark.parametrize("target", TARGETS)
def test_a_welded_tree_simulates(target: str) -> None:
    m = eg.Model("welded", gravity=(0, -9.81, 0))
    m.weld("A", m.ground.at(1, 2, 0), m.body("b", mass=2))
    m.output("height", "y(b)")
    mod = m.compile(target=target)
    for method in ("DOP853", "RK23", "Radau", "BDF", "LSODA"):
        traj = mod.simulate(0.1, method=method, events=lambda t, x: t - 0.05, dense_output=True)
        assert traj.x.shape == (0, len(traj.t))
        assert traj.x_events[0].shape == (0, 1)
        assert traj.at([0.03, 0.04]).x.shape == (0, 2)
        np.testing.assert_array_equal(traj["height"], 2.0)
        assert traj.energy_drift == 0.0
    still = mod.kinematic_analysis(t=[0, 1])
    assert (still.x.shape, still["height"].tolist()) == ((0, 2), [2.0, 2.0])
    for form in ("minimal", "full"):
        near = mod.linearize(form=form)
        assert (near.A.shape, near.B.shape, near.C.shape, near.D.shape) == ((0, 0), (0, 0), (1, 0), (1, 0))
    assert mod.modes().frequencies.shape == (0,)
    assert mod.equilibrium().stability == "no freedom"


def truss() -> eg.Model:
    """Two bars of weight m g from pins a distance of 2 apart, which meet at (1, 1), where a load F pulls upwards."""
    m = eg.Model("truss", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    m.parameter("L", 2**0.5)
    m.input("F")
    bars = [m.body(name, mass=1.5, com=("L/2", 0, 0), inertia={"zz": 0.1}) for name in "ab"]
    m.revolute("A", m.ground, bars[0], coordinate="alpha")
    m.revolute("B", m.ground.at(2, 0, 0), bars[1], coordinate="beta")
    m.revolute("C", bars[0].at("L", 0, 0), bars[1].at("L", 0, 0))
    m.force("load", bars[0].at("L", 0, 0), (0, "F", 0))
    m.output("height", bars[0].at("L", 0, 0).position[1])
    m.guess = {"alpha": 0.7, "beta": 2.3}
    return m


def held_twice() -> eg.Model:
    """Bodies welded to ground at places that agree where l1 + l2 = l3: no coordinate, and one row of parameters."""
    m = eg.Model("held_twice", gravity=(0, "-g", 0))
    for name, value in (("g", 9.81), ("l1", 0.1), ("l2", 0.2), ("l3", 0.3)):
        m.parameter(name, value)
    m.input("F")
    a, b = m.body("a", mass=1.0, com=(0.5, 0, 0)), m.body("b", mass=2.0)
    m.weld("A", m.ground, a)
    m.weld("B", a.at(1, 0, 0), b)
    m.weld("C", m.ground.at("1 + l3", 0, 0), b.at("l1 + l2", 0, 0))
    m.force("load", b, (0, "F", 0))
    m.output("height", "y(b)")
    return m


@pytest.mark.parametrize(
    ("make", "target"),
    [(truss, "numpy"), (held_twice, "numpy"), pytest.param(truss, "cython", marks=pytest.mark.thorough)],
)
def test_every_call_of_a_locked_structure_answers(make: object, target: str) -> None:
    mod = make().compile(target=target)  # type: ignore[operator]
    x = mod.x0()
    n, n_q = len(mod.x_names), len(mod.q_names)
    batch = np.repeat(x[:, None], 3, axis=1)
    np.testing.assert_allclose(mod.rhs(0, x), np.zeros(n), atol=1e-12)
    assert mod.rhs(0, batch).shape == (n, 3)
    np.testing.assert_allclose(mod.jacobian(0, x), np.zeros((n, n)), atol=1e-12)
    assert mod.jacobian(0, batch).shape == (n, n, 3)
    assert mod.mass_matrix(x[:n_q]).shape == (n // 2, n // 2)
    assert mod.embedded_mass_matrix(x[:n_q]).shape == (0, 0)
    assert mod.poses(x[:n_q]).shape == (2, 4, 4)
    assert mod.outputs(0, x).shape == (1,)
    np.testing.assert_allclose(mod.project(x), x, atol=1e-15)
    assert mod.energy(x).shape == (2,)
    assert [part.shape for part in mod.kinematics([], [], [])] == [(n_q,), (n // 2,), (n // 2,)]
    assert mod.minimal.rhs(0, np.zeros(0)).shape == (0,)
    np.testing.assert_allclose(mod.minimal.expand(np.zeros(0)), x, atol=1e-15)
    assert mod.simulate((0, 1), t_eval=[0, 0.5, 1]).x.shape == (n, 3)
    assert mod.simulate((0, 1), method="Radau").x.shape[0] == n
    many = mod.simulate_many((0, 1), parameters={"g": [9.0, 8.0]})
    assert many.ok.all()
    assert mod.equilibrium().stability == "no freedom"
    assert mod.linearize().A.shape == (0, 0)
    assert target == "cython" or mod.verify().ok


@pytest.mark.parametrize("target", TARGETS)
def test_welds_that_rebound_values_part_are_named(target: str) -> None:
    mod = held_twice().compile(target=target)
    refuses("EG-LOOP-OPEN 0.1", mod.simulate, 1.0, parameters={"l3": 0.4})
    bound = mod.bind(p={"l3": 0.4})
    for call in (lambda: bound.rhs(0, []), lambda: bound.project([]), lambda: bound.reactions(0, [])):
        refuses("EG-PROJECTION .r_x 0.1", call)
