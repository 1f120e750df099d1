"""Next to a change point and in it: accelerations and their Jacobian against the same motion without that singularity.

A parallelogram whose fourth hinge is replaced by the couplings bend = -theta, psi = theta moves in the same way; its
constraints never lose rank.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg
from eomgen.errors import PartitionError

ANGLES = (0.3, 0.03, 0.01, 1e-3, 1e-5, 1e-7, 0.0)  #: from flat (rad)
PROJECTING = (
    "embedding",
    "lagrange",
    "recursive",
    "gibbs_appell",
    "hamilton",
    "augmented",
    "amalgamated",
    "newton_euler",
)


@cache
def compiled(base: str, coupled: bool, target: str = "cython", method: str = "embedding") -> Any:
    """A parallelogram of rods of 1 m on a base that is ground, slides, is driven, or turns about a ball joint."""
    m = eg.Model(f"parallelogram_{base}_{'coupled' if coupled else 'hinged'}", gravity=(0, -9.81, 0))
    ground = m.ground
    if base != "ground":
        ground = m.body("base", mass=2, com=(0.2, -0.3, 0.1), inertia=(0.3, 0.4, 0.5))
    if base == "ball":
        m.spherical("S", m.ground, ground, rotation="euler_parameters")
    elif base != "ground":
        m.prismatic("S", m.ground, ground, axis="x", coordinate="s")
    if base == "driven":
        m.driver("push", coordinate="s", value="0.3*sin(4*t)")
    a, b, c = (m.body(n, mass=1, com=(0.5, 0, 0), inertia=(0.01, 1 / 12, 1 / 12)) for n in "abc")
    m.revolute("A", ground.at(0, 0, 0), a, coordinate="theta")
    m.revolute("B", a.at(1, 0, 0), b, coordinate="bend")
    m.revolute("D", ground.at(1, 0, 0), c, coordinate="psi")
    if coupled:
        m.coupling("first", coordinates={"bend": 1, "theta": 1})
        m.coupling("second", coordinates={"psi": 1, "theta": -1})
    else:
        m.revolute("C", b.at(1, 0, 0), c.at(1, 0, 0))
    m.guess(theta=1.0, bend=-1.0, psi=1.0)
    return m.compile(method, target=target)


def states(base: str, angle: float, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """A state of the coupled mechanism, and the same in the order of some names, as an integrator leaves it."""
    mod, rng = compiled(base, True), np.random.default_rng(5)
    x = mod.x0({"theta": angle, "theta_dot": -5.0, **({"s": 0.2, "s_dot": 3.0} if base == "slider" else {})}, t=0.37)
    if base == "ball":
        turned = rng.normal(size=4)
        x[[k for k, name in enumerate(mod.x_names) if name.startswith("S_e")]] = turned / np.linalg.norm(turned)
        x[[k for k, name in enumerate(mod.x_names) if name.startswith("S_w")]] = rng.normal(size=3)
    return x, x[[mod.x_names.index(name) for name in names]] + 1e-12 * rng.normal(size=len(x))


def check(mod: Any, base: str, angle: float, tolerance: float) -> None:
    x, given = states(base, angle, mod.x_names)
    free = compiled(base, True)
    expected = free.rhs(0.37, x)[[free.x_names.index(name) for name in mod.x_names]]
    assert np.abs(mod.rhs(0.37, given) - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("base", ["ground", "slider", "driven", "ball"])
def test_accelerations_are_those_of_the_motion_that_goes_straight_on(base: str, target: str, angle: float) -> None:
    """With the noise of the constraints, eps / s^3, they were right to 1e-9 at 0.03 rad and to 1e-5 at 0.001 rad."""
    check(compiled(base, False, target), base, angle, 2e-9)


IN_C = ("embedding", "recursive", "augmented", "newton_euler")  #: NumPy's functions of all always run
FORMS = [(method, target) for method in PROJECTING for target in ("cython", "numpy")]


@pytest.mark.parametrize(("method", "target"), part_of(FORMS, lambda x: x[1] == "numpy" or x[0] in IN_C))
def test_in_every_method(method: str, target: str) -> None:
    for angle in (0.01, 1e-4):
        check(compiled("ground", False, target, method), "ground", angle, 1e-10)


@pytest.mark.parametrize("target", ["cython", "numpy"])
@pytest.mark.parametrize("base", ["ground", "slider"])
def test_the_jacobian_follows_the_branch(base: str, target: str) -> None:
    """Along motions of the branch it is that of the mechanism with couplings."""
    mod, free = compiled(base, False, target), compiled(base, True)
    at = [free.x_names.index(name) for name in mod.x_names]
    for angle in (0.01, 1e-3, 1e-5):
        x, _ = states(base, angle, mod.x_names)
        J = mod.jacobian(0.37, x[at])
        for k in range(free.n_x):
            along = np.zeros(free.n_x)
            along[k] = 1.0
            along = (free.project(x + 1e-6 * along, t=0.37) - free.project(x - 1e-6 * along, t=0.37)) / 2e-6
            expected = (free.jacobian(0.37, x) @ along)[at]
            assert np.abs(J @ along[at] - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_projected_states_stay_on_the_branch(target: str) -> None:
    mod = compiled("ground", False, target)
    for angle in ANGLES[1:]:
        x, given = states("ground", angle, mod.x_names)
        expected = x[[compiled("ground", True).x_names.index(name) for name in mod.x_names]]
        assert np.abs(mod.project(given) - expected).max() <= 2e-11


@pytest.mark.parametrize("target", ["cython", "numpy"])
def test_at_rest_in_a_change_point_no_branch_is_chosen(target: str) -> None:
    mod = compiled("ground", False, target)
    with pytest.raises(PartitionError):
        mod.rhs(0.0, np.zeros(mod.n_x))
