"""A constraint means the same multiplied by any number: every way to its accelerations, beside other loops or not."""

import numpy as np
import pytest

import eomgen as eg

TARGETS = ["numpy", "cython"]


def pump(area, target):
    """Two pistons on one fluid, A1 x1 + A2 x2 = 0, beside two geared wheels; 1 N on the first."""
    m = eg.Model("pump", gravity=(0, 0, 0))
    a, b = m.body("a", mass=1.0), m.body("b", mass=1.0)
    m.prismatic("x1", m.ground, a)
    m.prismatic("x2", m.ground, b)
    m.parameter("A1", 2 * area)
    m.parameter("A2", area)
    m.coupling("flow", equation="A1*x1 + A2*x2")
    for name in "cd":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1.0, inertia={"zz": 1.0}))
    m.gear("mesh", "C", "D", teeth=(20, 40))
    m.actuator("push", joint="x1", value=1.0)
    return m.compile(target=target)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("area", [1e-12, 1e-8, 1.0, 1e9])
def test_areas_of_any_unit_leave_the_freedoms(area, target):
    """x2 = -2 x1, so that (m + 4 m) x1'' = 1."""
    mod = pump(area, target)
    assert mod.n_dof == 2
    x = mod.x0(x1=0.3, x1_dot=0.1)
    assert x[mod.x_names.index("x2")] == pytest.approx(-0.6, rel=1e-12)
    assert mod.rhs(0.0, x)[mod.x_names.index("x1_dot")] == pytest.approx(0.2, rel=1e-12)
    assert np.isfinite(mod.jacobian(0.0, x)).all()


@pytest.mark.parametrize("target", TARGETS)
def test_a_factor_changed_later_changes_the_size_of_its_row(target):
    mod = pump(1.0, target).bind(p={"A1": 2e-9, "A2": 1e-9})
    x = mod.x0(x1=0.3)
    assert x[mod.x_names.index("x2")] == pytest.approx(-0.6, rel=1e-12)
    off = np.array(x)
    off[mod.x_names.index("x1")] += 1e-3
    assert mod.project(off)[mod.x_names.index("x2")] == pytest.approx(-0.6 - 0.4e-3, rel=1e-12)  # nearest point
    assert mod.rhs(0.0, x)[mod.x_names.index("x1_dot")] == pytest.approx(0.2, rel=1e-12)


def crank(F, kind, target="numpy"):
    """A slider-crank beside two wheels that turn together: P = F Q, or F P = F Q."""
    m = eg.Model("crank", gravity=(0, -9.81, 0))
    r, l = 0.1, 0.35
    a = m.body("a", mass=1, com=(r / 2, 0, 0), inertia={"zz": 1e-3})
    b = m.body("b", mass=0.8, com=(l / 2, 0, 0), inertia={"zz": 8e-3})
    s = m.body("s", mass=0.5)
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(r, 0, 0), b)
    m.revolute("C", b.at(l, 0, 0), s)
    m.prismatic("D", m.ground, s, axis="x", coordinate="s")
    for name in "pq":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1, inertia={"zz": 0.1}))
    if kind == "gear":
        m.gear("pair", "P", "Q", teeth=(1, F))
    elif kind == "coupling":
        m.coupling("pair", coordinates={"P": F, "Q": -F})
    elif kind == "curve":
        m.parameter("F", F)
        m.coupling("pair", equation="F*(sin(P) - Q)")
    m.initial = {"th": 0.3, "th_dot": 10.0}
    return m.compile(target=target)


@pytest.mark.parametrize("kind", ["gear", "coupling", "curve"])
@pytest.mark.parametrize("F", [1e-10, 1e-4, 1e6, 1e10])
def test_no_row_of_a_loop_is_lost_beside_a_large_or_small_one(kind, F):
    mod, alone = crank(F, kind), crank(1.0, "coupling")
    assert mod.n_dof == 2
    x = mod.x0()
    i, j = mod.x_names.index("th_dot"), alone.x_names.index("th_dot")
    assert mod.rhs(0.0, x)[i] == pytest.approx(alone.rhs(0.0, alone.x0())[j], rel=1e-10)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kind", ["gear", "coupling", "curve"])
def test_a_closed_row_does_not_keep_others_from_closing(kind, target):
    mod = crank(1e4, kind, target)
    y = np.array(mod.x0())
    y[mod.x_names.index("th")] += 1e-2
    q = mod.project(y)[: mod.n_q]
    assert np.abs(mod.constraints(q)).max() < 1e-10
    assert np.isfinite(mod.rhs(0.0, y)).all()


def test_steps_of_a_run_do_not_depend_on_a_gear_beside():
    steps = []
    for F in (1.0, 1e6):
        run = crank(F, "gear", "cython").simulate((0, 0.5), rtol=1e-6, atol=1e-8)
        steps.append(len(run.t))
    assert steps[1] == pytest.approx(steps[0], rel=0.2)


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_the_factor_of_a_row_of_velocities_does_not_matter(factor):
    """A skate on a plane, m x'' = 0 but for the knife edge: factor (x' sin h - y' cos h) = 0, coasting on a circle."""
    m = eg.Model("skate", gravity=(0, 0, 0))
    body = m.body("s", mass=2.0, inertia={"zz": 0.5})
    m.planar("place", m.ground, body, coordinates=["x", "y", "h"])
    m.parameter("f", factor)
    m.coupling("edge", equation="f*(x_dot*sin(h) - y_dot*cos(h))")
    for name in "cd":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1.0, inertia={"zz": 1.0}))
    m.gear("mesh", "C", "D", teeth=(20, 40))
    mod = m.compile(target="numpy")
    assert mod.n_dof == 3  # ahead, about, and the wheels
    x = mod.x0(h=0.4, h_dot=0.7, x_dot=np.cos(0.4))
    a = dict(zip(mod.x_names, mod.rhs(0.0, x), strict=True))
    np.testing.assert_allclose([a["x_dot"], a["y_dot"]], 0.7 * np.array([-np.sin(0.4), np.cos(0.4)]), atol=1e-12)


def test_residuals_stay_in_metres_and_radians():
    mod = pump(1e-3, "numpy")
    q = mod.x0()[: mod.n_q]
    q[mod.q_names.index("x1")] += 0.5
    C = dict(zip(mod.layout.constraint_labels, mod.constraints(q), strict=True))
    assert C["flow.equation"] == pytest.approx(2e-3 * 0.5)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_relation_that_parameters_leave_idle_holds_nothing(target):
    """3 k - l = 6e-17 for k = 0.1 and l = 0.3 is rounding of terms of 0.3: the pendulum beside a gear swings on."""
    m = eg.Model("idle", gravity=(0, -9.81, 0))
    m.parameter("k", 0.1), m.parameter("l", 0.3)
    for name in "ABC":
        m.revolute(name, m.ground, m.body(f"body{name}", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1}))
    m.gear("mesh", "B", "C", teeth=(20, 40))
    m.coupling("idle", equation="(3*k - l)*sin(A)")
    mod = m.compile(target=target)
    assert mod.n_dof == 2
    angle = 0.3
    swing = mod.rhs(0.0, mod.x0(A=angle, B=0.2))[mod.x_names.index("A_dot")]
    assert swing == pytest.approx(-9.81 * 0.5 * np.cos(angle) / (0.1 + 0.25), rel=1e-12)


@pytest.mark.parametrize(("k1", "k2"), [(0.1, 0.3), (0.0, 0.0)])
def test_a_relation_that_cancels_at_the_declared_values_is_refused_where_it_stands_alone(k1, k2):
    """3 * 0.1 - 0.3 is 5.6e-17: taken for a row it held A still; left out it would be missing with other values."""
    m = eg.Model("two", gravity=(0, -9.81, 0))
    a, b = (m.body(n, mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)) for n in "ab")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.5, 0, 0), b)
    m.parameter("k1", k1)
    m.parameter("k2", k2)
    m.coupling("none", equation="(3*k1 - k2)*sin(A)")
    with pytest.raises(eg.ModelError, match=r"constraints.none: none.equation holds nothing with the declared k1, k2"):
        m.check()


def test_a_relation_that_acts_only_with_parameters_given_later_is_refused_then():
    """k (A - B) = 0 with k declared 0 beside a gear: one row holds; with k = 1 two would."""
    m = eg.Model("three", gravity=(0, -9.81, 0))
    for name in "ABC":
        m.revolute(name, m.ground, m.body(name.lower(), mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.parameter("k", 0.0)
    m.gear("mesh", "B", "C", teeth=(20, 40))
    m.coupling("tie", equation="k*(sin(A) - sin(B))")
    mod = m.compile(target="numpy")
    assert mod.n_dof == 2
    with pytest.raises(eg.UsageError, match="2 constraint rows are independent, but with the declared values 1"):
        mod.simulate(0.1, {"A": 0.3}, parameters={"k": 1.0})


@pytest.mark.parametrize("equation", ["abs(2 + cos(A)) - 2 - cos(A)", "atan2(sin(A), cos(A)) - A"])
def test_an_identity_that_nothing_proves_is_refused_where_it_stands_alone(equation):
    m = eg.Model("one", gravity=(0, -9.81, 0))
    m.revolute("A", m.ground, m.body("a", mass=1, com=(0.3, 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.coupling("none", equation=equation)
    with pytest.raises(eg.ModelError, match="constraints.none: none.equation holds nothing at all positions"):
        m.check()
