"""Three slides in one joint, and universal joints about given axes, beside the same built from single joints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg

AXES = {
    "words": (["z", "x"], np.eye(3)[[2, 0]]),
    "negative": (["-y", "x"], np.array([[0, -1, 0], [1, 0, 0]])),
    "numbers": ([[1, 2, 2], [2, 1, -2]], np.array([[1, 2, 2], [2, 1, -2]]) / 3),
}


@pytest.mark.parametrize("name", AXES)
def test_a_universal_joint_turns_about_the_given_axes(name: str) -> None:
    """R = R_a(q1) R_b(q2), from SciPy's rotation vectors."""
    given, (a, b) = AXES[name]
    m = eg.Model("cross")
    body = m.body("body", mass=1, inertia=(1, 2, 3))
    m.universal("u", m.ground, body, axes=given)
    mod = m.compile(target="numpy")
    for q in ([0.3, -0.8], [1.2, 0.4]):
        wanted = (Rotation.from_rotvec(q[0] * a) * Rotation.from_rotvec(q[1] * b)).as_matrix()
        np.testing.assert_allclose(mod.poses(q)[0][:3, :3], wanted, rtol=0, atol=1e-14)


def test_axes_that_are_none() -> None:
    for axes, told in (
        (["x", "x"], "are not at right angles"),
        (["x", [1, 1, 0]], "are not at right angles"),
        (["x"], "is not two directions at right angles"),
        (["x", [0, 0, 0]], "the axis has no length"),
    ):
        m = eg.Model("cross")
        m.universal("u", m.ground, m.body("body", mass=1, inertia=(1, 2, 3)), axes=axes)
        with pytest.raises(eg.ModelError, match=told):
            m.mechanism()
    m = eg.Model("cross")
    m.universal("u", m.ground, m.body("body", mass=1, inertia=(1, 2, 3)), axes=["x", "z"], axis="x")
    with pytest.raises(eg.ModelError, match="axis is given too"):
        m.mechanism()


def hung(kind: str) -> eg.Model:
    """A gantry that carries a pendulum; its three slides one joint, or three with bodies without mass between."""
    m = eg.Model("gantry", gravity=(0, 0, -9.81))
    crab = m.body("crab", mass=3, com=(0.1, 0, 0), inertia=(1, 1, 1))
    rod = m.body("rod", mass=1, com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.01))
    start = m.ground.at(1, 2, 3, rpy=(0.2, 0.1, 0.5))
    if kind == "translational":
        m.translational("slide", start, crab.at(0, 0.1, 0))
    else:
        first, second = m.body("first", mass=0), m.body("second", mass=0)
        m.prismatic("slide_x", start, first, axis="x")
        m.prismatic("slide_y", first, second, axis="y")
        m.prismatic("slide_z", second, crab.at(0, 0.1, 0), axis="z")
    m.spherical("ball", crab, rod)
    m.spring("rope", m.ground, rod.at(0, 0, -1), stiffness=20, length=1)
    return m


def test_a_translational_joint_is_three_slides() -> None:
    one, three = (hung(kind).compile(target="numpy") for kind in ("translational", "chain"))
    assert one.x_names == three.x_names
    assert one.q_names[:3] == ("slide_x", "slide_y", "slide_z")
    x = np.random.default_rng(1).normal(size=12) * 0.4
    np.testing.assert_allclose(one.rhs(0, x), three.rhs(0, x), rtol=1e-11)


def test_a_translational_joint_closes_a_loop() -> None:
    """A body on a planar joint and a translational one: what both allow are the two slides."""
    m = eg.Model("closed")
    body = m.body("body", mass=1, inertia=(1, 1, 1))
    m.planar("table", m.ground, body, coordinates=["x", "y", "turn"])
    m.translational("slides", m.ground, body)
    report = m.check()
    assert report.degrees_of_freedom == 2
    mod = m.compile(target="numpy")
    run = mod.simulate(0.2, initial={"x_dot": 1.0, "y_dot": -2.0})
    np.testing.assert_allclose(run["slides_y"], -2.0 * run.t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["turn"], 0.0, rtol=0, atol=1e-12)
