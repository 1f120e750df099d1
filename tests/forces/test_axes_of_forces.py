"""Forces and torques in the axes of ground, of a body, and of a marker that is turned on it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.equations import METHODS


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("axes", ["ground", "body"])
def test_a_force_on_a_lever(axes: str, method: str) -> None:
    """In body axes its moment l F_y does not depend on the angle; in ground axes it is l (F_y cos - F_x sin)."""
    l, inertia, force = 0.7, 0.4, (3.0, 2.0)
    m = eg.Model("lever", gravity=(0, 0, 0))
    lever = m.body("lever", mass=1.0, inertia={"zz": inertia})
    m.revolute("J", m.ground, lever, coordinate="a")
    m.force("F", lever.at(l, 0, 0), (*force, 0), axes=axes)
    mod = m.compile(method=method, target="numpy")
    for a in (0.4, 2.1):
        moment = l * (force[1] if axes == "body" else force[1] * np.cos(a) - force[0] * np.sin(a))
        assert mod.rhs(0.0, np.array([a, 0.0]))[1] == pytest.approx(moment / inertia, rel=1e-13)


@pytest.mark.parametrize("axes", ["ground", "body"])
def test_a_torque_in_the_axes_of_a_turned_marker(axes: str) -> None:
    """Euler: J w' = R_m T in the axes of the marker, R^T T in those of ground, at rest and in body axes."""
    inertia, torque, rpy = np.array([0.5, 0.8, 1.1]), np.array([1.0, -0.6, 0.3]), (0.4, -0.7, 1.2)
    m = eg.Model("spinner", gravity=(0, 0, 0))
    body = m.body("body", mass=1.0, inertia=tuple(inertia))
    m.spherical("J", m.ground, body, rotation="euler_parameters")
    m.torque("T", body.marker("tool", at=(0.1, 0, 0), rpy=rpy), tuple(torque), axes=axes)
    mod = m.compile(target="numpy")
    turn = Rotation.from_euler("xyz", [0.9, 0.2, -0.5])
    x = np.concatenate([turn.as_quat(scalar_first=True), np.zeros(3)])
    own = Rotation.from_euler("xyz", rpy).apply(torque) if axes == "body" else turn.inv().apply(torque)
    assert mod.rhs(0.0, x)[4:] == pytest.approx(own / inertia, rel=1e-12)
