"""Loops whose rows hold whatever the motion: with parameters alone they close or do not, and the rest moves on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp

import eomgen as eg
from eomgen.errors import AssemblyError, ModelError, ProjectionError, UsageError


def arm_and_plate(name: str, l3: float = 0.3) -> tuple[eg.Model, Any, Any]:
    """A pendulum and a plate that is still free."""
    m = eg.Model(name, gravity=(0, -9.81, 0))
    for length, value in (("l1", 0.1), ("l2", 0.2), ("l3", l3)):
        m.parameter(length, value)
    arm = m.body("arm", mass=1.0, com=(0.5, 0, 0), inertia={"zz": 0.1})
    plate = m.body("plate", mass=0.5, com=(0.1, 0.1, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, arm, coordinate="theta")
    return m, arm, plate


def twice_welded(l3: float = 0.3) -> eg.Model:
    """The plate, held at two places that agree where l1 + l2 = l3."""
    m, arm, plate = arm_and_plate("twice_welded", l3)
    m.weld("W0", arm.at(0.3, 0.1, 0), plate)
    m.weld("W1", arm.at("0.3 + l3", 0.1, 0), plate.at("l1 + l2", 0, 0))
    return m


def once_welded() -> eg.Model:
    """The same without the second weld."""
    m, arm, plate = arm_and_plate("once_welded")
    m.weld("W0", arm.at(0.3, 0.1, 0), plate)
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_it_moves_as_with_one_weld(target: str) -> None:
    one, two = once_welded().compile(target=target), twice_welded().compile(target=target)
    assert two.layout.n_dof == 1
    start = {"theta": 0.3}
    a, b = one.simulate(1.0, initial=start), two.simulate(1.0, initial=start)
    np.testing.assert_allclose(b["theta"][-1], a["theta"][-1], rtol=1e-9)
    x = np.array([0.3, 2.0])
    np.testing.assert_allclose(two.jacobian(0, x), one.jacobian(0, x), atol=1e-12)
    loads = two.reactions(0, x)[:, :3]  # the two welds share what one takes, in the axes of the arm
    np.testing.assert_allclose(loads[1] + loads[2], one.reactions(0, x)[1, :3], atol=1e-10)


@pytest.mark.parametrize("method", ["lagrange", "recursive", "augmented", "newton_euler", "hamilton"])
def test_each_method_accepts_it(method: str) -> None:
    x = np.array([0.3, 2.0])
    found = twice_welded().compile(target="numpy", method=method).rhs(0, x)
    np.testing.assert_allclose(found, once_welded().compile(target="numpy").rhs(0, x), rtol=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_late_values_that_open_it_are_refused(target: str) -> None:
    mod = twice_welded().compile(target=target)
    with pytest.raises(AssemblyError, match=r"W1\.r_x \(off by 0\.1\) can never hold: no coordinate changes it"):
        mod.simulate(0.1, initial={"theta": 0.3}, parameters={"l3": 0.4})
    bound = mod.bind(p={"l3": 0.4})
    for call in (lambda: bound.rhs(0, np.zeros(2)), lambda: bound.project(np.zeros(2))):
        with pytest.raises(ProjectionError, match=r"largest residual at W1\.r_x, 0\.1"):
            call()
    agreeing = mod.bind(p={"l3": 0.4, "l1": 0.2})
    assert np.isfinite(agreeing.rhs(0, np.zeros(2))).all()


def test_declared_values_that_open_it_are_refused() -> None:
    with pytest.raises(AssemblyError, match=r"W1\.r_x \(off by 0\.05\) can never hold"):
        twice_welded(0.35).check()


def pinned_twice(d: float) -> eg.Model:
    """The plate on two pins a distance of d apart."""
    m, arm, plate = arm_and_plate("pinned_twice")
    m.parameter("d", d)
    m.revolute("W0", arm.at(0.3, 0.1, 0), plate)
    m.revolute("W1", arm.at("0.3 + d", 0.1, 0), plate.at("d", 0, 0))
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_two_pins_at_one_place_hold_as_one(target: str) -> None:
    """The rows are there, and their slopes are 0 with the declared value."""
    m, arm, plate = arm_and_plate("pinned_once")
    m.revolute("W0", arm.at(0.3, 0.1, 0), plate)
    one, two = m.compile(target=target), pinned_twice(0.0).compile(target=target)
    assert two.layout.n_dof == 2
    x = np.array([0.3, -0.2, 2.0, 1.0])
    np.testing.assert_allclose(two.rhs(0, x), one.rhs(0, x), rtol=1e-12)
    with pytest.raises(
        UsageError, match="with the given d, 1 constraint rows are independent, but with the declared values 0 are"
    ):
        two.simulate(0.1, parameters={"d": 0.1})
    assert pinned_twice(0.1).compile(target=target).layout.n_dof == 1


x, x_dot, d, t, u = sp.symbols("x x_dot d t u")


@pytest.mark.parametrize(("row", "what"), [(sp.sin(t) - d * t, "depends on t"), (u - 1, "depends on u")])
def test_rows_of_time_or_inputs_alone_are_refused(row: sp.Expr, what: str) -> None:
    m = eg.Model.from_lagrangian(
        "of_time", x_dot**2 / 2, [x], constraints=[row], parameters={"d": 1.0} if row.has(d) else {}, inputs={"u": 1.0}
    )
    with pytest.raises(ModelError, match=f"{what} but on no coordinate, so no motion can satisfy it"):
        m.check()


@pytest.mark.parametrize("start", [{}, {"x_1": 1.0, "y_2": 0.5}])
@pytest.mark.parametrize("distance", ["(x_1 - x_2)**2 + (y_1 - y_2)**2", "x_1**2 - 2*x_1*x_2 + x_2**2"])
def test_a_constraint_that_is_a_square_is_named(distance: str, start: dict[str, float]) -> None:
    """Of coincident points |r|^2 is least where it is 0: it is no change point, and its components hold."""
    names = ["x_1", "x_2", "y_1", "y_2"]
    kinetic = " + ".join(f"{name}_dot**2/2" for name in names)
    model = eg.Model.from_lagrangian("points", kinetic, names, constraints=[distance])
    model.initial(**start)
    with pytest.raises(eg.ModelError, match=r"constraint_1 is 0 only where it is least.*write each component"):
        model.check()
    components = eg.Model.from_lagrangian("points", kinetic, names, constraints=["x_1 - x_2", "y_1 - y_2"])
    assert components.check().degrees_of_freedom == 2


def test_an_equation_between_bodies_that_is_a_square_is_named() -> None:
    model = eg.Model("points")
    for name in "ab":
        model.translational(f"T{name}", model.ground, model.body(name, mass=1))
    model.coupling("c", equation="(x(a) - x(b))**2 + (y(a) - y(b))**2 + (z(a) - z(b))**2")
    with pytest.raises(eg.ModelError, match=r"constraints\.c: c\.equation is 0 only where it is least"):
        model.check()


@pytest.mark.parametrize("radius", [1e-3, 1e-5, 1.1e-6])
def test_a_small_circle_is_no_square(radius: float) -> None:
    circle = f"x**2 + y**2 - {radius}**2"
    model = eg.Model.from_lagrangian("bead", "x_dot**2 + y_dot**2", ["x", "y"], constraints=[circle])
    model.initial(x=radius)
    assert model.check().degrees_of_freedom == 1
