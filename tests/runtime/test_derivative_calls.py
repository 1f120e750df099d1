"""Calls of derivatives: jacobian by x, u and p, of inverse dynamics, and Hessians times directions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from models import three_cranks

import eomgen as eg
from eomgen.errors import PartitionError, UnavailableError, UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"
TARGETS = ["numpy", "cython"]


def arm(turned: float = 0.0) -> eg.Model:
    """A ball joint in Euler parameters and a hinge with a motor; `turned` turns the frame of the first body."""
    m = eg.Model("ball_and_hinge", gravity=(0, 0, -9.81))
    length = m.parameter("l", 0.5)
    m.input("tau", 0.3)
    c, s = np.cos(turned), np.sin(turned)
    inertia = {"xx": 0.02, "yy": 0.03, "zz": 0.015}
    if turned:
        inertia = {"xx": 0.02 * c * c + 0.03 * s * s, "yy": 0.02 * s * s + 0.03 * c * c, "zz": 0.015}
        inertia["xy"] = (0.03 - 0.02) * s * c
    upper = m.body("upper", mass=1.5, com=(0, 0, "-l/2"), inertia=inertia)
    lower = m.body("lower", mass=0.8, com=(0.1, 0, -0.2), inertia={"xx": 0.01, "yy": 0.01, "zz": 0.002})
    frame = {"rpy": (0, 0, -turned)} if turned else {}
    m.spherical("ball", m.ground, upper.marker("top", at=(0, 0, 0), **frame), rotation="euler_parameters")
    hinge = m.revolute("hinge", upper.marker("end", at=(0, 0, -length), **frame), lower, axis="y", coordinate="b")
    m.actuator("motor", joint=hinge, value="tau*cos(b)")
    m.joint_damper("friction", joint=hinge, damping=0.1)
    return m


def state(module: Any, seed: int = 0, columns: tuple[int, ...] = ()) -> tuple[np.ndarray, ...]:
    random = np.random.default_rng(seed)
    q, v, a = (random.uniform(-1, 1, (n, *columns)) for n in (module.n_q, module.n_v, module.n_v))
    return q, v, a


def slope(f: Any, h: float = 1e-3) -> np.ndarray:
    """f'(0) by central differences, extrapolated twice."""
    d = [(f(k * h) - f(-k * h)) / (2 * k * h) for k in (1, 2, 4)]
    first = [(4 * d[0] - d[1]) / 3, (4 * d[1] - d[2]) / 3]
    return np.asarray((16 * first[0] - first[1]) / 15)


def joined(module: Any, z: np.ndarray) -> np.ndarray:
    n_q, n_v = module.n_q, module.n_v
    return np.hstack(module.inverse_dynamics_derivatives(z[:n_q], z[n_q : n_q + n_v], z[n_q + n_v :]))


@pytest.mark.parametrize("target", TARGETS)
def test_derivatives_are_slopes_of_the_calls(target: str) -> None:
    module = arm().compile(target=target)
    q, v, a = state(module)
    found = module.inverse_dynamics_derivatives(q, v, a)
    assert found.dtau_dq.shape == (4, 5)
    np.testing.assert_allclose(found.dtau_da, module.mass_matrix(q), atol=1e-14)
    for mine, place in zip(found, range(3), strict=True):
        for k, column in enumerate(mine.T):

            def along(e: float, place: int = place, k: int = k) -> np.ndarray:
                moved = [q.copy(), v.copy(), a.copy()]
                moved[place][k] += e
                return np.asarray(module.inverse_dynamics(*moved))

            np.testing.assert_allclose(column, slope(along), atol=1e-9)
    random = np.random.default_rng(3)
    w, d = random.uniform(-1, 1, 4), random.uniform(-1, 1, 13)
    z = np.concatenate([q, v, a])
    bent = module.inverse_dynamics_hessian_product(q, v, a, w, d)
    np.testing.assert_allclose(bent, slope(lambda e: joined(module, z + e * d).T @ w), atol=1e-9)
    x, w, d = z[: module.n_x], random.uniform(-1, 1, module.n_x), random.uniform(-1, 1, module.n_x + 1)

    def both(e: float) -> np.ndarray:
        at = {"t": 0.0, "x": x + e * d[:-1], "u": module.u + e * d[-1:]}
        return np.hstack([module.jacobian(**at), module.jacobian(**at, wrt="u")]).T @ w

    np.testing.assert_allclose(module.rhs_hessian_product(0.0, x, w, d), slope(both), rtol=1e-7, atol=1e-7)
    d[-1] = 0.0
    np.testing.assert_array_equal(
        module.rhs_hessian_product(0.0, x, w, d[:-1]), module.rhs_hessian_product(0.0, x, w, d)[:-1]
    )


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_differentiates_by_what_is_named(target: str) -> None:
    module = eg.load(EXAMPLES / "slider_crank.yaml").compile(target=target)
    x = module.x0()
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="x"), module.jacobian(0.0, x))
    np.testing.assert_array_equal(module.jacobian(0.0, x, wrt="u"), module.input_jacobian(0.0, x))
    by_p = module.jacobian(0.0, x, wrt="p")
    np.testing.assert_array_equal(by_p, module.parameter_jacobian(0.0, x))
    assert by_p.shape == (module.n_x, module.n_p)
    out = np.empty((module.n_x, module.n_u))
    assert module.jacobian(0.0, x, out=out, wrt="u") is out
    with pytest.raises(UsageError, match="wrt must be 'x' .*not 'q'"):
        module.jacobian(0.0, x, wrt="q")


def test_turned_frames_and_other_methods_and_targets_agree() -> None:
    modules = [arm().derive(method).compile(target="numpy") for method in ("embedding", "recursive", "lagrange")]
    modules += [arm().compile(), arm(turned=0.7).compile(target="numpy")]
    first = modules[0]
    q, v, a = state(first)
    random = np.random.default_rng(1)
    w, d = random.uniform(-1, 1, (2, 13))
    x, weights = np.concatenate([q, v]), w[:9]

    def everything(module: Any) -> list[np.ndarray]:
        return [
            np.hstack(module.inverse_dynamics_derivatives(q, v, a)),
            module.inverse_dynamics_hessian_product(q, v, a, w[:4], d),
            module.rhs_hessian_product(0.0, x, weights, d[:10]),
        ]

    for module in modules[1:]:  # of the last the frame of the first body is turned, its joints are where they were
        for mine, theirs in zip(everything(module), everything(first), strict=True):
            np.testing.assert_allclose(mine, theirs, atol=1e-11 * np.abs(theirs).max())


@pytest.mark.parametrize("target", TARGETS)
def test_batches_are_columns(target: str) -> None:
    module = arm().compile(target=target)
    q, v, a = state(module, columns=(5,))
    random = np.random.default_rng(2)
    w, d = random.uniform(-1, 1, 4), random.uniform(-1, 1, (13, 5))
    every = module.inverse_dynamics_derivatives(q, v, a)
    bent = module.inverse_dynamics_hessian_product(q, v, a, w, d)
    x, weights = np.concatenate([q, v]), random.uniform(-1, 1, (9, 5))
    curved = module.rhs_hessian_product(0.0, x, weights, d[:9])
    assert every.dtau_dq.shape == (4, 5, 5)
    for k in range(5):
        one = q[:, k], v[:, k], a[:, k]
        for mine, theirs in zip(every, module.inverse_dynamics_derivatives(*one), strict=True):
            np.testing.assert_allclose(mine[..., k], theirs, rtol=1e-12, atol=1e-13)
        single = module.inverse_dynamics_hessian_product(*one, w, d[:, k])
        np.testing.assert_allclose(bent[:, k], single, rtol=1e-11, atol=1e-12)
        single = module.rhs_hessian_product(0.0, x[:, k], weights[:, k], d[:9, k])
        np.testing.assert_allclose(curved[:, k], single, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("name", ["puma560", "slider_crank"])
def test_states_side_by_side_have_the_bits_of_one_alone(name: str) -> None:
    """Eleven columns: lanes of the processor, and a rest that does not fill them."""
    module = eg.load(EXAMPLES / f"{name}.yaml").compile()
    random = np.random.default_rng(5)
    x = module.project(module.x0()[:, None] + 0.1 * random.uniform(-1, 1, (module.n_x, 11)))
    q, v, a = x[: module.n_q], x[module.n_q :], random.uniform(-1, 1, (module.n_v, 11))
    w, d = random.uniform(-1, 1, (module.n_x, 11)), random.uniform(-1, 1, (module.n_q + 2 * module.n_v, 11))
    first = module.inverse_dynamics_derivatives(q, v, a)
    bent = module.inverse_dynamics_hessian_product(q, v, a, w[: module.n_v], d)
    curved = module.rhs_hessian_product(0.0, x, w, d[: module.n_x])
    for k in range(11):
        for mine, theirs in zip(first, module.inverse_dynamics_derivatives(q[:, k], v[:, k], a[:, k]), strict=True):
            np.testing.assert_array_equal(mine[..., k], theirs)
        alone = module.inverse_dynamics_hessian_product(q[:, k], v[:, k], a[:, k], w[: module.n_v, k], d[:, k])
        np.testing.assert_array_equal(bent[:, k], alone)
        alone = module.rhs_hessian_product(0.0, x[:, k], w[:, k], d[: module.n_x, k])
        np.testing.assert_array_equal(curved[:, k], alone)


def test_wrong_arguments_are_told_by_name() -> None:
    module = arm().compile(target="numpy")
    q, v, a = state(module)
    with pytest.raises(UsageError, match=r"weights must have shape \(4,\) or \(4, k\), not \(3,\)"):
        module.inverse_dynamics_hessian_product(q, v, a, np.ones(3), np.ones(13))
    with pytest.raises(UsageError, match=r"direction must have shape \(10,\)"):
        module.rhs_hessian_product(0.0, np.concatenate([q, v]), np.ones(9), np.ones(4))
    loop = eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy")
    with pytest.raises(UsageError, match=r"weights must have shape \(6,\)"):
        loop.rhs_hessian_product(0.0, loop.x0(), np.ones(2), np.ones(loop.n_x))
    q, v, a = state(loop)
    w, d = np.ones(loop.n_v), np.ones(loop.n_q + 2 * loop.n_v)
    z = np.concatenate([q, v, a])
    bent = loop.inverse_dynamics_hessian_product(q, v, a, w, d)
    np.testing.assert_allclose(bent, slope(lambda e: joined(loop, z + e * d).T @ w), atol=1e-8)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("name", "method"), [("slider_crank", "embedding"), ("bricard", "recursive")])
def test_products_of_loops_are_slopes_of_the_jacobian(name: str, method: str, target: str) -> None:
    """Along the constraints, which the linkage of Bricard has one too many of, and symmetric in all directions."""
    module = eg.load(EXAMPLES / f"{name}.yaml").derive(method).compile(target=target)
    random = np.random.default_rng(7)
    x = module.project(module.x0() + 0.05 * random.uniform(-1, 1, module.n_x))
    w, d, e = random.uniform(-1, 1, (3, module.n_x))
    d = slope(lambda h: module.project(x + h * d), 1e-4)
    found = module.rhs_hessian_product(0.0, x, w, d)
    along = slope(lambda h: module.jacobian(0.0, x + h * d).T @ w)
    np.testing.assert_allclose(found, along, atol=1e-8 * np.abs(found).max())
    crosswise = module.rhs_hessian_product(0.0, x, w, np.array([d, e]).T)
    assert abs(crosswise[:, 0] @ e - crosswise[:, 1] @ d) < 1e-7 * np.abs(crosswise).max()
    off = module.rhs_hessian_product(0.0, x + 1e-3 * e, w, d)
    there = module.project(x + 1e-3 * e)
    np.testing.assert_array_equal(off, module.rhs_hessian_product(0.0, there, w, d))


@pytest.mark.parametrize("target", TARGETS)
def test_products_of_loops_are_refused_where_they_would_be_wrong(target: str) -> None:
    folded = three_cranks().compile(target=target)
    one = np.ones(folded.n_x)
    assert np.isfinite(folded.rhs_hessian_product(0.0, folded.x0(theta1=0.5), one, one)).all()
    with pytest.raises(PartitionError, match="not accurate at this state, such as near a change point"):
        folded.rhs_hessian_product(0.0, folded.x0(theta1=1e-3), one, one)
    driven = eg.load(EXAMPLES / "driven_slider_crank.yaml").compile(target=target)
    pivoted = eg.load(EXAMPLES / "four_bar.yaml").derive("augmented").compile(target=target)
    for module in (driven, pivoted):
        one = np.ones(module.n_x)
        with pytest.raises(UnavailableError, match=f"of the right-hand side of {module.name!r} are not derived"):
            module.rhs_hessian_product(0.0, module.x0(), one, one)


def test_a_long_chain_is_differentiated_along_directions() -> None:
    """Its Jacobian of 60 x 180 would be too long to be written out; compiled and NumPy share no driver."""
    m = eg.Model("chain", gravity=(0, -9.81, 0))
    holder: Any = m.ground
    for k in range(60):
        link = m.body(f"link{k}", mass=1.0 + 0.01 * k, com=(0.05, 0, 0), inertia={"zz": 1e-3})
        m.revolute(f"j{k}", holder, link, coordinate=f"q{k}")
        holder = link.at(0.1, 0, 0)
    equations = m.derive()
    kernels = ["inverse_dynamics", "inverse_dynamics_derivatives", "mass_matrix"]
    modules = [equations.compile(kernels=kernels, optimize=0), equations.compile(target="numpy", kernels=kernels)]
    q, v, a = state(modules[0])
    found, other = (np.hstack(module.inverse_dynamics_derivatives(q, v, a)) for module in modules)
    np.testing.assert_allclose(found, other, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(found[:, 120:], modules[0].mass_matrix(q), rtol=1e-12, atol=1e-12)
    d = np.random.default_rng(5).uniform(-1, 1, 180)
    along = slope(lambda e: modules[0].inverse_dynamics(q + e * d[:60], v + e * d[60:120], a + e * d[120:]))
    np.testing.assert_allclose(found @ d, along, atol=1e-7 * np.abs(along).max())
