"""Positive definiteness is judged by each coordinate's own inertia, on every way to the accelerations."""

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import ModelError, SingularMassMatrixError
from eomgen.numeric.definite import correlated, safely_positive


def two_wheels(inertia):
    """Two independent wheels on the ground, 1 kg m^2 and `inertia`."""
    m = eg.Model("wheels", gravity=(0, 0, 0))
    a = m.body("a", mass=1.0, inertia={"zz": 1.0})
    b = m.body("b", mass=0.0, inertia={"zz": inertia})
    m.revolute("A", m.ground, a)
    m.revolute("B", m.ground, b)
    m.actuator("turn", joint="B", value=inertia)
    return m


@pytest.mark.parametrize("method", ["embedding", "recursive", "lagrange"])
@pytest.mark.parametrize("inertia", [1e-12, 1e-14, 1e-16])
def test_a_small_wheel_beside_a_large_one_has_its_inertia(method, inertia):
    mod = two_wheels(inertia).compile(target="numpy", method=method)
    np.testing.assert_allclose(mod.rhs(0.0, mod.x0()), [0, 0, 0, 1.0], rtol=1e-12)


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("inertia", [1e-14])
def test_a_small_wheel_beside_a_loop_has_its_inertia(target, inertia):
    """The same beside two geared wheels, where the embedded mass matrix is factored."""
    m = two_wheels(inertia)
    for name in "cd":
        m.revolute(name.upper(), m.ground, m.body(name, mass=1.0, inertia={"zz": 1.0}))
    m.gear("mesh", "C", "D", teeth=(20, 40))
    mod = m.compile(target=target)
    x = mod.x0()
    assert mod.rhs(0.0, x)[mod.x_names.index("B_dot")] == pytest.approx(1.0, rel=1e-12)
    J = mod.jacobian(0.0, x)  # by the drivers with arrays, not straight-line code
    assert np.isfinite(J).all()


def test_a_wheel_without_inertia_is_still_refused_by_name():
    with pytest.raises(ModelError, match="'B' has no inertia"):
        two_wheels(0.0).compile(target="numpy")


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize("polar", [0.0, np.pi])
def test_what_rounding_leaves_of_a_zero_is_no_inertia(target, polar):
    """A point mass on a spherical pendulum hanging straight: the azimuth moves nothing; sin^2(pi) is 1.5e-32."""
    m = eg.Model("pendulum", gravity=(0, 0, -9.81))
    a, b = m.body("a", mass=0.0), m.body("b", mass=1.0, com=(0, 0, 1))
    m.revolute("phi", m.ground, a, axis="z")
    m.revolute("theta", a, b, axis="x")
    mod = m.compile(target=target)
    with pytest.raises(SingularMassMatrixError, match="phi"):
        mod.rhs(0.0, mod.x0(theta=polar))
    assert np.isfinite(mod.rhs(0.0, mod.x0(theta=polar + 1e-6))).all()  # sizes 1 and 1e-12


def test_units_do_not_matter_and_correlation_does():
    M = np.array([[1.0, 0.9], [0.9, 1.0]])
    unit = np.array([1.0, 1e-6])
    np.testing.assert_allclose(correlated(unit[:, None] * M * unit), M, rtol=1e-14)
    assert np.linalg.eigvalsh(correlated(np.array([[1.0, 1e-6], [1e-6, 1e-12]])))[0] == pytest.approx(0.0, abs=1e-15)
    assert correlated(np.diag([1.0, 0.0, -4.0])).diagonal().tolist() == [1.0, 0.0, -1.0]
    assert safely_positive(np.array([1.0, 1e-16]), np.array([1.0, 1e-16]))
    assert not safely_positive(np.array([1.0, 1e-16]), np.array([1.0, 1e-2]))
    assert not safely_positive(np.array([1.0, 1e-30]), np.array([1.0, 1e-30]))
    assert not safely_positive(np.array([1.0, np.nan]), np.array([1.0, 1.0]))


@pytest.mark.parametrize("rotation", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("along", [(1, 2, 3), (1, -1, 0), (1, 0, 0)])
def test_a_thin_rod_that_may_spin_names_its_body_and_axis(along: tuple[int, int, int], rotation: str) -> None:
    u = np.array(along) / np.linalg.norm(along)
    m = eg.Model("rod", gravity=(0, 0, -9.81))
    b = m.body("stick", mass=1, com=tuple(0.5 * u), inertia=((np.eye(3) - np.outer(u, u)) / 12).tolist())
    m.spherical("s", m.ground, b, rotation=rotation)
    m.initial(**{"s_1": 0.2, "s_2": 0.3} if rotation == "euler_angles" else {})
    with pytest.raises(ModelError) as caught:
        m.check()
    (problem,) = caught.value.problems
    assert problem.path == "joints.s"
    if rotation == "euler_parameters" and along == (1, 0, 0):
        assert problem.message.startswith("coordinate 's_wx' has no inertia behind it")
        return
    axis = ", ".join(f"{x:.3g}" for x in u)
    assert problem.message.endswith(f"has no inertia behind it: it turns 'stick' about ({axis}) in body axes")
    assert problem.remedy == "give 'stick' an inertia about that axis, or a joint that does not turn it about that axis"
    rates = [float(x) for x in problem.message.partition("rates ")[2].partition(" has")[0].split(" : ")]
    if rotation == "euler_parameters":  # the angular velocity itself
        w = np.zeros(3)
        w[u != 0] = rates
        np.testing.assert_allclose(np.cross(w, u), 0, atol=2e-3)
