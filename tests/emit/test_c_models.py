"""Drivers in C of whole models: rotations in Euler parameters, long trees, reactions as unknowns.

Truth from outside: a solve with multipliers in NumPy, where bodies go by SciPy's rotations; differences of results.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.emit import emit_c
from eomgen.program import Limits, build_program
from eomgen.program.collect import collect_metadata, collect_terms

KERNELS = ["rhs", "jacobian", "project", "input_jacobian", "parameter_jacobian", "embedded_mass_matrix"]


class Case(NamedTuple):
    """A model in C, and as the NumPy module whose straight-line kernels give M, h and C_q."""

    library: Any
    module: Any
    x: np.ndarray  #: a state on the constraints


def rods(name: str = "rods", twice: bool = False) -> eg.Model:
    """Two bodies on balls, held together by a rod, or two in one place: five freedoms."""
    m = eg.Model(name, gravity=(0.0, 0.0, -9.81))
    l, torque = m.parameter("l", 1.1), m.input("torque", 0.4)
    a = m.body("a", mass=1.2, com=(0.1, 0.2, -0.5), inertia=(0.2, 0.3, 0.15))
    b = m.body("b", mass=0.8, com=(-0.1, 0.1, -0.4), inertia=(0.1, 0.2, 0.15))
    m.spherical("A", m.ground, a, rotation="euler_parameters")
    m.spherical("B", m.ground.at(1.0, 0.0, 0.0), b, rotation="euler_parameters")
    m.distance("rod", a.at(0.0, 0.3, -1.0), b.at(0.2, 0.0, -0.9), length=l)
    if twice:
        gap = m.parameter("gap", 0.0)
        m.distance("second", a.at(0.0, 0.3, -1.0), b.at(0.2, 0.0, -0.9), length=l + gap)
    m.torque("drive", a, (torque, 0, 0))
    return m


def links(n: int, name: str) -> eg.Model:
    """A chain of hinges about changing axes."""
    m = eg.Model(name, gravity=(0.0, -9.81, 0.0))
    last: Any = m.ground
    torque, mass = m.input("torque", 0.3), m.parameter("mass", 1.0)
    for k in range(n):
        body = m.body(f"b{k}", mass=mass * (1.0 + 0.1 * k), com=(0.3, 0.05, 0.02), inertia=(0.02, 0.03, 0.04))
        m.revolute(f"J{k}", last, body, axis="zxy"[k % 3])
        last = body.at(0.6, 0.0, 0.1)
    m.torque("drive", "J1", torque)
    return m


def five_bar(name: str = "fivebar") -> eg.Model:
    """Five links in a plane: two freedoms, of which neither is alone in M."""
    m = eg.Model(name, gravity=(0.0, -9.81, 0.0))
    l, torque = m.parameter("l", 0.5), m.input("torque", 0.3)
    bodies = [m.body(f"b{k}", mass=1.0 + 0.3 * k, com=(0.25, 0.01 * k, 0), inertia={"zz": 0.02}) for k in range(4)]
    m.revolute("A", m.ground, bodies[0])
    m.revolute("B", bodies[0].at(l, 0, 0), bodies[1])
    m.revolute("D", m.ground.at(0.6, 0, 0), bodies[2])
    m.revolute("E", bodies[2].at(0.5, 0, 0), bodies[3])
    m.revolute("C", bodies[1].at(0.6, 0, 0), bodies[3].at(0.6, 0, 0))
    m.torque("drive", "A", torque)
    m.initial(A=1.84, D=1.2)
    return m


def carriage() -> eg.Model:
    """A four-bar linkage on a sledge: a length and an angle are independent, and coupled."""
    m = eg.Model("carriage", gravity=(0.0, -9.81, 0.0))
    l, torque = m.parameter("l", 1.7), m.input("torque", 0.3)
    sledge, *bars = (m.body(f"b{k}", mass=1.0 + 0.3 * k, com=(0.4, 0.1, 0), inertia={"zz": 0.2}) for k in range(4))
    m.prismatic("S", m.ground, sledge, axis="x")
    m.revolute("A", sledge, bars[0])
    m.revolute("B", bars[0].at(0.8, 0, 0), bars[1])
    m.revolute("C", bars[1].at(2.0, 0, 0), bars[2].at(1.5, 0, 0))
    m.revolute("D", sledge.at(l, 0, 0), bars[2])
    m.torque("drive", "A", torque)
    m.guess = {"A": 1.0}
    return m


def toggle() -> eg.Model:
    """A slider-crank of which the slider alone has inertia: at the dead centre nothing does."""
    m = eg.Model("toggle", gravity=(0.0, -9.81, 0.0))
    crank, rod, slider = (m.body(name, mass=mass) for name, mass in (("crank", 0.0), ("rod", 0.0), ("slider", 1.3)))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod, coordinate="phi")
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.revolute("C", rod.at(0.35, 0, 0), slider)
    m.guess = {"theta": 0.7}
    return m


@pytest.fixture(scope="module")
def make(libraries: Any, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Case]:
    """``make(name)``; each model is compiled once."""
    models: dict[str, tuple[Callable[[], eg.Model], str]] = {
        "balls": (rods, "embedding"),
        "forces": (lambda: rods("reacting"), "newton_euler"),
        "twice": (lambda: rods("doubled", twice=True), "embedding"),
        "freedoms": (five_bar, "embedding"),
        "lengths": (carriage, "embedding"),
        "toggle": (toggle, "embedding"),
        "straight": (lambda: five_bar("straightbar"), "embedding"),
        "tree": (lambda: links(4, "shortchain"), "embedding"),
        "columns": (lambda: links(5, "longchain"), "recursive"),
    }
    known: dict[str, Case] = {}

    def case(name: str) -> Case:
        if name not in known:
            model, method = models[name]
            equations = model().derive(method)
            kernels = KERNELS if name not in ("forces", "twice", "toggle") else ["rhs", "project"]
            kinematics, mobility, tree = equations.kinematics, equations.mobility, equations.tree
            metadata = collect_metadata(kinematics, mobility, tree) | {"target": "c"}
            straight = name == "straight"
            nodes = 0 if name == "columns" else Limits().jacobian_nodes
            few = {"unrolled": 0, "unrolled_loops": 0}  # the drivers are what is tried
            limits = Limits(**few, jacobian_nodes=nodes, jacobian_recursive=nodes)
            limits = Limits() if straight else limits
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("eomgen.program.factor.LONG", 1)
                terms = collect_terms(kinematics, mobility, tree)
            sources = emit_c(build_program(terms, metadata, kernels=kernels, limits=limits))
            path = libraries.compile_library(sources, tmp_path_factory.mktemp(name))
            module = model().derive("embedding").compile(target="numpy")
            v = 0.7 * np.cos(1.0 + np.arange(module.n_v))
            x = module.project(np.concatenate([module.x0()[: module.n_q], v]))
            known[name] = Case(libraries.Library(path, metadata["p_values"], metadata["u_values"]), module, x)
        return known[name]

    return case


def moved(case: Case, h: float) -> np.ndarray:
    """q after the time h at the velocities of the state."""
    module, q = case.module, np.array(case.x[: case.module.n_q])
    v = case.x[module.n_q :]
    balls = [tuple(pair) for pair in module.metadata["quaternion_slots"]]
    plain_q = [k for k in range(module.n_q) if not any(i <= k < i + 4 for i, _ in balls)]
    plain_v = [k for k in range(module.n_v) if not any(j <= k < j + 3 for _, j in balls)]
    q[plain_q] += h * v[plain_v]
    for i, j in balls:
        e = q[i : i + 4]
        turned = Rotation.from_quat(e, scalar_first=True) * Rotation.from_rotvec(h * v[j : j + 3])
        f = turned.as_quat(scalar_first=True)
        q[i : i + 4] = f if f @ e > 0.0 else -f
    return q


def central(values: Callable[[float], np.ndarray], h: float) -> np.ndarray:
    """A derivative at 0 to fourth order."""
    return (8.0 * (values(h) - values(-h)) - (values(2 * h) - values(-2 * h))) / (12.0 * h)


@pytest.mark.parametrize("name", ["balls", "forces", "freedoms", "straight", "tree", "columns"])
def test_accelerations_are_those_of_a_solve_with_multipliers(make: Callable[[str], Case], name: str) -> None:
    case = make(name)
    module, x = case.module, case.x
    q, v, n = x[: module.n_q], x[module.n_q :], module.n_v
    x_dot = case.library.fine("rhs", x)
    np.testing.assert_allclose(x_dot[: module.n_q], central(lambda h: moved(case, h), 1e-3), atol=1e-9)
    M, h = module.mass_matrix(q), module.bias(0.0, x)
    a = np.linalg.solve(M, -h)
    if module.n_c:
        C_q = module.constraint_jacobian(q)
        gamma = central(lambda s: module.constraint_jacobian(moved(case, s)) @ v, 1e-3)
        K = np.block([[M, C_q.T], [C_q, np.zeros((len(C_q), len(C_q)))]])
        a = np.linalg.lstsq(K, -np.concatenate([h, gamma]), rcond=1e-12)[0][:n]
    np.testing.assert_allclose(x_dot[module.n_q :], a, rtol=1e-8, atol=1e-8 * np.abs(a).max())


@pytest.mark.parametrize("name", ["balls", "forces", "freedoms", "straight"])
def test_rates_are_those_of_the_nearest_state_on_the_constraints(make: Callable[[str], Case], name: str) -> None:
    library, module, x = make(name)
    off = x + 0.02 * np.sin(np.arange(len(x)))
    near = library.fine("project", off)
    expected, found = library.fine("rhs", near), library.fine("rhs", off)
    assert np.abs(module.velocity_constraints(near)).max() <= 1e-12
    np.testing.assert_allclose(found[module.n_q :], expected[module.n_q :], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["balls", "freedoms", "tree", "columns"])
def test_derivatives_are_differences(make: Callable[[str], Case], name: str) -> None:
    """Of rhs in all directions of x, those across the constraints too, by inputs and by parameters."""
    library, _, x = make(name)
    size, rng = len(x), np.random.default_rng(3)
    J = library.fine("jacobian", x).reshape(size, size)
    for d in rng.normal(size=(4, size)):
        slope = central(lambda h, d=d: library.fine("rhs", x + h * d), 1e-4)
        np.testing.assert_allclose(J @ d, slope, rtol=1e-6, atol=1e-7 * np.abs(slope).max())
    u, p = np.array(library.u), np.array(library.metadata["p_values"], dtype=float)

    def with_input(h: float) -> np.ndarray:
        library.u[0] = u[0] + h
        return np.array(library.fine("rhs", x))

    def with_parameter(h: float) -> np.ndarray:
        library.set_parameters([p[0] + h, *p[1:]])
        return np.array(library.fine("rhs", x))

    by_u, by_p = (library.fine(f"{what}_jacobian", x).reshape(size, -1)[:, 0] for what in ("input", "parameter"))
    for slope, values in ((by_u, with_input), (by_p, with_parameter)):
        expected = central(values, 1e-4)
        values(0.0)
        np.testing.assert_allclose(slope, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


def test_euler_parameters_are_projected_by_the_least_turn(make: Callable[[str], Case]) -> None:
    """The turn that closes the loop is along the gradient of the constraint, scaled by the size of the mechanism."""
    library, module, x = make("balls")
    balls, n_q = module.metadata["quaternion_slots"], module.n_q
    off = np.array(x)
    for k, (i, _) in enumerate(balls):
        turn = Rotation.from_rotvec([1e-4 * (k + 1), -2e-4, 1.5e-4])
        off[i : i + 4] = (Rotation.from_quat(x[i : i + 4], scalar_first=True) * turn).as_quat(scalar_first=True)
    closed = library.fine("project", off)
    assert np.abs(module.constraints(closed[:n_q])).max() <= 1e-13
    pairs = [[Rotation.from_quat(q[i : i + 4], scalar_first=True) for q in (off, closed)] for i, _ in balls]
    steps = [(before.inv() * after).as_rotvec() for before, after in pairs]
    step, C_q = np.concatenate(steps), module.constraint_jacobian(closed[:n_q])[0]
    across = step - C_q * (C_q @ step) / (C_q @ C_q)
    assert np.abs(across).max() <= 1e-3 * np.abs(step).max()


def test_a_gap_that_is_left_is_reported(make: Callable[[str], Case]) -> None:
    """Two rods in one place whose lengths differ: half of the difference is left at either."""
    library, module, x = make("twice")
    names, p = list(module.p_names), np.array(module.p)
    for gap, status in ((0.0, 0), (2e-11, 0), (1e-9, 3), (1e-3, 3)):
        p[names.index("gap")] = gap
        library.set_parameters(p)
        found, closed = library("project", x)
        assert found == status, gap
        if status == 0:
            residuals = module.bind(p=p).constraints(closed[: module.n_q], rows="all")
            assert np.abs(residuals).max() == pytest.approx(gap / 2, abs=1e-14)


@pytest.mark.parametrize("name", ["freedoms", "lengths"])
def test_the_embedded_mass_matrix_is_that_of_the_motions_left(make: Callable[[str], Case], name: str) -> None:
    """B^T M B, where column k of B moves independent coordinate k alone and keeps the loops closed."""
    library, module, x = make(name)
    q = x[: module.n_q]
    chosen = list(library.metadata["independent"])
    rows = np.vstack([module.constraint_jacobian(q), np.eye(module.n_v)[chosen]])
    right = np.vstack([np.zeros((len(rows) - len(chosen), len(chosen))), np.eye(len(chosen))])
    B = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
    expected = B.T @ module.mass_matrix(q) @ B
    assert abs(expected[0, 1]) > 0.01 * abs(expected).max()
    found = library.fine("embedded_mass_matrix", q).reshape(expected.shape)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_a_dead_centre_without_inertia_is_reported(make: Callable[[str], Case]) -> None:
    """s' = -0.13 sin(theta) theta': the inertia of the only freedom is 1.3 s'^2, and at theta = 0 rounding."""
    library, module, _ = make("toggle")
    for theta, status in ((0.7, 0), (1e-6, 0), (0.0, 2)):
        x = module.x0({"theta": theta})
        assert library("rhs", x)[0] == status, theta
