"""A mechanism that cannot move: every call and every integrator still answers."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import AssemblyError, ProjectionError


@pytest.mark.parametrize("target", ["cython", "numpy"])
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


def test_names_that_are_not_there() -> None:
    m = eg.Model("welded")
    m.weld("A", m.ground, m.body("b", mass=2))
    with pytest.raises(eg.UsageError, match="no coordinate or output 'z'; there are none"):
        m.compile(target="numpy").impact(0.0, [], {"z": 0.5})
    assert m.compile(target="numpy", kernels="rhs").rhs(0.0, []).shape == (0,)
    with pytest.raises(eg.UsageError, match="no kernel is named 'rsh'; did you mean 'rhs'"):
        m.compile(target="numpy", kernels="rsh")


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


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("make", [truss, held_twice])
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


@pytest.mark.parametrize("load", [0.0, -7.0])
def test_reactions_of_a_truss_are_those_of_statics(load: float) -> None:
    mod = truss().compile(target="numpy").bind(u={"F": load})
    forces = mod.reactions(0, mod.x0())[:, :3]
    weight = 1.5 * 9.81
    # each bar is at 45 degrees: moments about its upper end give the thrust, the sum of forces the rest
    up = weight - 0.5 * load
    thrust = up - 0.5 * weight
    np.testing.assert_allclose(forces[0], [thrust, up, 0], atol=1e-12)
    np.testing.assert_allclose(forces[1], [-thrust, up, 0], atol=1e-12)


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_welds_that_late_values_part_are_named(target: str) -> None:
    mod = held_twice().compile(target=target)
    with pytest.raises(AssemblyError, match=r"off by 0\.1\) can never hold: no coordinate changes it"):
        mod.simulate(1.0, parameters={"l3": 0.4})
    bound = mod.bind(p={"l3": 0.4})
    for call in (lambda: bound.rhs(0, []), lambda: bound.project([]), lambda: bound.reactions(0, [])):
        with pytest.raises(ProjectionError, match=r"largest residual at \w\.r_x, 0\.1"):
            call()


def held(kind: str) -> eg.Model:
    """A body that a weld, two welds in a ring or a driver leave no freedom."""
    m = eg.Model("held")
    a = m.body("a", mass=1.0)
    if kind == "driven":
        m.prismatic("J", m.ground, a, axis="x", coordinate="q")
        m.driver("D", "q", "t")
    else:
        m.weld("A", m.ground, a)
    if kind == "ring":
        b = m.body("b", mass=1.0)
        m.weld("B", a, b)
        m.weld("C", m.ground, b)
    return m


SAMPLED = [2.0]  #: of s -> s/2 + 1 at 0, 0.1, ... 0.5 s
for _ in range(6):
    SAMPLED.append(0.5 * SAMPLED[-1] + 1)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("kind", ["weld", "ring", "driven"])
def test_states_stand_beside_bodies_without_freedoms(kind: str, target: str) -> None:
    for law, end in ({"rate": "-s"}, 2 * np.exp(-0.55)), ({"value": "0.5*s + 1", "period": 0.1}, SAMPLED[-1]):
        m = held(kind)
        if "rate" in law:
            m.state("s", law["rate"], initial=2.0)
        else:
            m.sampled("s", law["value"], law["period"], initial=2.0)
        m.output("y", "2*s")
        mod = m.compile(target=target)
        for method in ("DOP853", "Radau", "LSODA"):
            run = mod.simulate((0, 0.55), method=method)
            np.testing.assert_allclose([run["s"][-1], run["y"][-1]], [end, 2 * end], atol=1e-6)
        np.testing.assert_allclose(mod.dae.solve((0, 0.55))["s"][-1], end, atol=1e-6)
        assert mod.jacobian(0, mod.x0()).shape == (mod.n_x, mod.n_x)
        assert target == "cython" or mod.verify().ok
        if target == "numpy":
            x, drawn = mod.x0(), m.derive()
            for rhs in (drawn.to_casadi().rhs, drawn.to_jax().rhs):
                np.testing.assert_allclose(np.array(rhs(0.0, x, mod.u, mod.p)).ravel(), mod.rhs(0.0, x), atol=1e-6)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("terminal", [False, True])
def test_a_driven_mechanism_whose_event_never_happens(terminal: bool, target: str) -> None:
    m = held("driven")
    m.event("never", "q + 1", terminal=terminal)
    m.event("half", "q - 0.5")
    run = m.compile(target=target).simulate((0, 1))
    assert run["q"][-1] == pytest.approx(1.0, abs=1e-12)
    assert [x.shape for x in run.x_events] == [(2, 0), (2, 1)]
    assert run.t_events["half"] == pytest.approx([0.5], abs=1e-12)
