"""What the C library makes of constraints: accelerations, projection, derivatives, reduced masses, and reports.

The model's functions are C in one case of each kind, else those of target numpy, which the same library calls.

Judges: a solve with multipliers in NumPy, in which rotations go by SciPy; closed forms; differences of results.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import judges
import models
import numpy as np
import pytest
from sweeps import part_of

import eomgen as eg

KERNELS = [
    "rhs", "jacobian", "project", "input_jacobian", "parameter_jacobian", "embedded_mass_matrix", "kinematics",
    "constraints", "constraint_jacobian", "velocity_constraints", "loop_coordinates", "loop_coordinate_jacobian",
]  # fmt: skip


class Case(NamedTuple):
    """A module, the one of NumPy whose straight-line functions give M, h and C_q, and a state off the start."""

    module: Any
    judge: Any
    x: np.ndarray


def five_bar() -> eg.Model:
    """Five links in a plane: two freedoms, of which neither is alone in M."""
    m = eg.Model("five_bar", gravity=(0.0, -9.81, 0.0))
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
    """A four-bar linkage on a sledge that a law leads: a length and an angle are independent, and coupled."""
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


def towed() -> eg.Model:
    """A sledge with a pendulum on a rope to a hook that moves by a law of time."""
    m = eg.Model("towed", gravity=(0.0, -9.81, 0.0))
    sledge = m.body("sledge", mass=2.0)
    rod = m.body("rod", mass=0.7, com=(0.0, -0.3, 0), inertia={"zz": 0.02})
    m.prismatic("S", m.ground, sledge, axis="x", coordinate="s")
    m.revolute("A", sledge, rod, coordinate="a")
    hook = m.body("hook", mass=0.3)
    m.prismatic("H", m.ground.at(2.0, 0.5, 0), hook, axis="y", coordinate="h")
    m.driver("lead", "h", "0.2*sin(3*t)")
    m.distance("rope", hook, rod.at(0.1, -0.6, 0), length=m.parameter("l", 1.6))
    m.torque("drive", "A", m.input("torque", 0.3))
    m.initial(a=0.2)
    return m


def chain(n: int) -> eg.Model:
    """A chain of hinges in a plane; the last link hangs on a massless one, of a length d that may vanish."""
    m = eg.Model(f"chain{n}", gravity=(0.0, -9.81, 0.0))
    last, mass, d = m.ground, m.parameter("mass", 1.0), m.parameter("d", 0.6)
    for k in range(n):
        heavy = 0.0 if k == n - 2 else mass * (1.0 + 0.1 * k)
        link = m.body(f"b{k}", mass=heavy, com=(0.3, 0.05, 0), inertia={"zz": 0.04 * heavy})
        m.revolute(f"J{k}", last, link)
        last = link.at(d if k == n - 2 else 0.6, 0.0, 0.0)
    m.torque("drive", "J1", m.input("torque", 0.3))
    return m


#: Model, method of derivation, and the functions that are compiled; none: target numpy.
CASES: dict[str, tuple[Callable[[], eg.Model], str, list[str]]] = {
    "slider_crank": (lambda: models.build("powered_slider_crank"), "embedding", KERNELS),
    "slider": (lambda: crank("s"), "embedding", []),
    "balls": (models.rods, "embedding", [k for k in KERNELS if k != "kinematics"]),
    "balls, reactions": (models.rods, "newton_euler", ["rhs", "project"]),
    "freedoms": (five_bar, "embedding", []),
    "freedoms, multipliers": (five_bar, "augmented", []),
    "lengths": (carriage, "embedding", []),
    "towed": (towed, "embedding", []),
    "tree": (lambda: chain(13), "embedding", ["rhs", "jacobian", "input_jacobian", "parameter_jacobian"]),
    "long tree": (lambda: chain(40), "embedding", ["rhs", "jacobian"]),
    "by columns": (lambda: chain(60), "recursive", []),
}
LOOPS = [name for name in CASES if "tree" not in name and name != "by columns"]
#: The registry's, by embedding, in which the same library solves with functions in NumPy.
REGISTRY = [
    name for name, known in models.MODELS.items() if known.features & {"loops", "driven", "nonholonomic", "gears"}
    and not known.features & {"lagrangian", "equations", "switched"} and name != "slider_crank"
]  # fmt: skip
#: Those whose independent coordinates give both positions and velocities.
MOVABLE = [n for n in REGISTRY if models.MODELS[n].freedoms and "nonholonomic" not in models.MODELS[n].features]
TIME = 0.4


@cache
def case(name: str) -> Case:
    if name in CASES:
        model, method, kernels = CASES[name]
        equations = model().derive(method)
        made = equations.compile(kernels=kernels, optimize=0) if kernels else equations.compile(target="numpy")
        judge = model().derive("embedding").compile(target="numpy")
        v = 0.7 * np.cos(1.0 + np.arange(judge.n_v))
        q = judge.x0()[: judge.n_q] + (0.0 if judge.n_c else 0.3 * np.sin(np.arange(judge.n_q)))
        return Case(made, judge, judge.project(np.concatenate([q, v]), t=TIME))
    module = models.build(name).compile(target="numpy")
    x, rng = module.x0(t=TIME), np.random.default_rng(3)
    s = judges.sizes(module)
    x[: module.n_q] = judges.displaced(module, x[: module.n_q], 0.05 * s * rng.uniform(-1.0, 1.0, module.n_v))
    x[module.n_q : module.n_q + module.n_v] += s * rng.uniform(-1.0, 1.0, module.n_v)
    return Case(module, module, module.project(x, t=TIME))


@pytest.mark.parametrize("name", [*CASES, *REGISTRY])
def test_accelerations_are_those_with_multipliers(name: str) -> None:
    mod, judge, x = case(name)
    x_dot, n_q, n_v = mod.rhs(TIME, x), judge.n_q, judge.n_v
    rates = judges.central(lambda h: judges.displaced(judge, x[:n_q], h * x[n_q : n_q + n_v]), 1e-3)
    np.testing.assert_allclose(x_dot[:n_q], rates, rtol=1e-9, atol=1e-9)
    a, forces = judges.solved(judge, x, TIME)
    s = judges.sizes(judge)
    np.testing.assert_allclose(x_dot[n_q : n_q + n_v] / s, a / s, rtol=1e-8, atol=1e-8 * np.abs(a / s).max(initial=1.0))
    if name in REGISTRY:
        exerted = -judge.constraint_jacobian(x[:n_q], t=TIME, rows="all").T @ mod.multipliers(TIME, x)
        np.testing.assert_allclose(s * exerted, s * forces, atol=1e-8 * np.abs(s * forces).max(initial=1e-3))


@pytest.mark.parametrize("size", [0.01, 0.3, 1.0])
@pytest.mark.parametrize("name", [*LOOPS, *REGISTRY])
def test_states_off_the_constraints_go_there_by_limited_steps_of_least_norm(name: str, size: float) -> None:
    """Far ones too: not every position that is closed is the one that they belong to."""
    mod, judge, x = case(name)
    rng, s, n_q = np.random.default_rng(0), judges.sizes(judge), judge.n_q
    for _ in range(8 if size == 1.0 else 2):
        off = np.array(x)
        off[:n_q] = judges.displaced(judge, x[:n_q], size * s * rng.normal(size=judge.n_v))
        off[n_q : n_q + judge.n_v] += size * s * rng.normal(size=judge.n_v)
        try:
            found = mod.project(off, t=TIME)
        except eg.ProjectionError:  # an error is not a wrong position, but no state near the constraints has one
            assert size == 1.0
            continue
        expected = judges.closed(judge, off, TIME)
        np.testing.assert_allclose(found, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("name", [*LOOPS, *REGISTRY])
def test_a_state_off_the_constraints_moves_as_the_nearest_one(name: str) -> None:
    mod, judge, x = case(name)
    off = x + 0.02 * np.sin(np.arange(len(x))) * (1.0 if name in LOOPS else judges.sizes(judge).min())
    near = judges.closed(judge, off, TIME)
    q = near[: judge.n_q]
    assert np.abs(judge.constraints(q, t=TIME)).max(initial=0.0) <= 1e-12
    assert np.abs(judge.velocity_constraints(near, t=TIME)).max() <= 1e-12 * max(1.0, np.abs(near).max())
    expected, found = mod.rhs(TIME, near)[judge.n_q :], mod.rhs(TIME, off)[judge.n_q :]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(expected).max()))


#: Derivatives of the others by ``make thorough``; those by the state are in tests/mechanics/test_jacobians.py too.
ALWAYS = ("planetary_gear", "kapitza_pendulum", "rolling_disc", "n_four_bar", "three_cranks", "driven_slider_crank")
DERIVED = ["slider_crank", "balls", "freedoms", "towed", "tree", "long tree", "by columns"]


@pytest.mark.parametrize("name", [*DERIVED, *part_of(REGISTRY, ALWAYS.__contains__)])
def test_derivatives_are_differences(name: str) -> None:
    """Of rhs in any directions of x, those across the constraints too, by inputs and by parameters."""
    mod, judge, x = case(name)
    rng, J = np.random.default_rng(3), mod.jacobian(TIME, x)
    lengths = np.array([kind == "length" for kind in judge.metadata["coordinate_kinds"]])
    s = np.concatenate([np.where(lengths, judge.metadata["length_scale"], 1.0), judges.sizes(judge)])

    def compare(found: np.ndarray, values: Callable[[float], np.ndarray], least: float) -> None:
        slope = judges.central(values, h)
        for part in (slice(judge.n_q), slice(judge.n_q, None)):
            size = np.abs(slope[part] / s[part]).max(
                initial=max(least, 1e-3 * np.abs(values(0.0)[part] / s[part]).max())
            )
            np.testing.assert_allclose(found[part] / s[part], slope[part] / s[part], rtol=1e-6, atol=1e-6 * size)

    # off the constraints the term for redundant rows follows the residual: a kink of second order
    h = 1e-6 if judge.metadata["redundant_rows"] or name == "bricard" else 1e-4

    for d in rng.normal(size=(4, len(x))) * s:
        compare(J @ d, lambda h, d=d: mod.rhs(TIME, x + h * d), 0.0)  # type: ignore[misc]
    if name in CASES and CASES[name][2] and "parameter_jacobian" not in CASES[name][2]:
        return
    u, p = np.array(judge.u), np.array(judge.p)
    for d in rng.normal(size=(6, len(p))) * np.where(p == 0.0, 1e-2, p) if len(p) else ():
        compare(mod.parameter_jacobian(TIME, x) @ d, lambda h, d=d: mod.rhs(TIME, x, p=p + h * d), 0.1)  # type: ignore[misc]
    for d in np.eye(len(u)):
        compare(mod.input_jacobian(TIME, x) @ d, lambda h, d=d: mod.rhs(TIME, x, u=u + h * d), 0.0)  # type: ignore[misc]


@pytest.mark.parametrize("name", ["slider_crank", "slider", "freedoms", *MOVABLE])
def test_kinematics_satisfies_all_three_levels(name: str) -> None:
    """Of independent values, lengths among them where the slider is chosen."""
    mod, judge, x = case(name)
    chosen, t, s = list(mod.metadata["independent"]), TIME if name in REGISTRY else 0.0, judges.sizes(judge)
    q_i, v_i = x[: judge.n_q][chosen] + 0.003 * s[chosen], (1.5 + np.arange(len(chosen))) * s[chosen]
    a_i = -2.0 * s[chosen]
    q, v, a = mod.kinematics(q_i, v_i, a_i, t=t)
    np.testing.assert_allclose([q[chosen], v[chosen], a[chosen]], [q_i, v_i, a_i], rtol=0, atol=1e-14)
    assert np.abs(judge.constraints(q, t=t)).max() <= 1e-13
    assert np.abs(judge.velocity_constraints(np.concatenate([q, v]), t=t)).max() <= 1e-12

    def rate(h: float) -> Any:
        there = np.concatenate([judges.displaced(judge, q, h * v), v])
        return judge.velocity_constraints(there, t=t + h)

    gamma = judges.central(rate, 1e-4)
    np.testing.assert_allclose(judge.constraint_jacobian(q, t=t) @ a, -gamma, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", ["freedoms", "lengths", *MOVABLE])
def test_the_embedded_mass_matrix_is_that_of_the_motions_left(name: str) -> None:
    """B^T M B, where column k of B moves independent coordinate k alone and keeps the loops closed."""
    mod, judge, x = case(name)
    q, chosen = x[: judge.n_q], list(mod.metadata["independent"])
    rows = np.vstack([judge.constraint_jacobian(q), np.eye(judge.n_v)[chosen]])
    right = np.vstack([np.zeros((len(rows) - len(chosen), len(chosen))), np.eye(len(chosen))])
    B = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
    expected = B.T @ judge.mass_matrix(q) @ B
    assert name in MOVABLE or abs(expected[0, 1]) > 0.01 * abs(expected).max()
    np.testing.assert_allclose(mod.embedded_mass_matrix(q), expected, rtol=1e-10, atol=1e-12 * abs(expected).max())


def crank(chosen: str) -> eg.Model:
    """A slider-crank; r = 0.1, l = 0.35."""
    mass = {"crank": 1.0, "rod": 0.8, "slider": 0.5}
    m = eg.Model("crank", gravity=(0.0, -9.81, 0.0))
    p = {name: m.parameter(f"m_{name}", value) for name, value in mass.items()}
    bodies = {
        "crank": m.body("crank", mass=p["crank"], com=(0.05, 0, 0), inertia={"zz": p["crank"] * 0.01 / 12}),
        "rod": m.body("rod", mass=p["rod"], com=(0.175, 0, 0), inertia={"zz": p["rod"] * 0.35**2 / 12}),
        "slider": m.body("slider", mass=p["slider"]),
    }
    m.revolute("A", m.ground, bodies["crank"], coordinate="theta")
    m.revolute("B", bodies["crank"].at(0.1, 0, 0), bodies["rod"], coordinate="phi")
    m.prismatic("D", m.ground, bodies["slider"], axis="x", coordinate="s")
    m.revolute("C", bodies["rod"].at(0.35, 0, 0), bodies["slider"])
    m.independent(chosen)
    m.initial(theta=0.7)
    return m


def near_dead_centre(theta: float) -> np.ndarray:
    phi = -np.arcsin(0.1 * np.sin(theta) / 0.35) - theta
    return np.array([theta, phi, 0.1 * np.cos(theta) + 0.35 * np.cos(theta + phi)])


@pytest.mark.parametrize("method", ["embedding", pytest.param("augmented", marks=pytest.mark.thorough)])
def test_a_dead_centre_matters_where_the_set_is_fixed(method: str) -> None:
    """There s cannot move the slider-crank: rhs takes another coordinate and does not notice; the embedded M tells."""
    by_angle = crank("theta").compile(target="numpy")
    by_length = crank("s").derive(method).compile(target="numpy")
    for theta in (0.0, 1e-12, 1e-6, 1e-3):
        x = by_angle.project(np.concatenate([near_dead_centre(theta), [2.0, -2.5, 0.0]]))
        np.testing.assert_allclose(by_length.rhs(0.0, x), by_angle.rhs(0.0, x), rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(by_length.jacobian(0.0, x), by_angle.jacobian(0.0, x), rtol=1e-8, atol=1e-6)
    dead = near_dead_centre(0.0)
    assert by_angle.embedded_mass_matrix(dead).shape == (1, 1)
    for q in (dead, near_dead_centre(1e-9)):
        with pytest.raises(eg.PartitionError):
            by_length.embedded_mass_matrix(q)
    assert by_length.embedded_mass_matrix(near_dead_centre(1e-5)) > 0.0


def given_toggle() -> eg.Model:
    """The same from equations: s = 0.13 cos(y), y' = 2 w, and no inertia but that of s."""
    return eg.Model.from_equations(
        "given_toggle", ["s", "y"], velocities=["u", "w"], rates={"s": "u", "y": "2*w"},
        mass_matrix=[[1.3, 0], [0, 0]], forcing=["-1", "0"], constraints=["s - 0.13*cos(y)"],
    )  # fmt: skip


def test_a_freedom_that_moves_no_inertia_is_reported() -> None:
    """s' = -0.13 sin(theta) theta': the inertia of the only freedom is 1.3 s'^2, and at theta = 0 rounding."""
    toggle = case("slider").module.bind({"m_crank": 0.0, "m_rod": 0.0, "m_slider": 1.3})
    given = given_toggle().compile(target="numpy")
    for module, position in ((toggle, near_dead_centre), (given, lambda y: np.array([0.13 * np.cos(y), y]))):
        still = np.zeros(module.n_v)
        for theta in (0.7, 1e-6):
            assert np.isfinite(module.rhs(0.0, [*position(theta), *still])).all()
        for theta in (0.0, np.pi):
            with pytest.raises(eg.SingularMassMatrixError):
                module.rhs(0.0, [*position(theta), *still])


@pytest.mark.parametrize("name", ["tree", "long tree"])
@pytest.mark.parametrize(
    "parameters", [(0.0, 0.6), (1.0, 0.0), (1.0, 1e-8)], ids=["no mass", "coincident axes", "axes so close"]
)
def test_a_tree_without_inertia_is_reported(name: str, parameters: tuple[float, float]) -> None:
    mod, _, x = case(name)
    assert np.isfinite(mod.rhs(0.0, x, p=[0.1, 1e-3])).all()
    for call in (mod.rhs, mod.jacobian):
        with pytest.raises(eg.SingularMassMatrixError):
            call(0.0, x, p=parameters)


def test_a_gap_that_is_left_is_reported() -> None:
    """Two rods in one place whose lengths differ: half of the difference is left at either."""
    mod = models.rods(twice=True).compile(target="numpy")
    x, p, place = mod.x0(), np.array(mod.p), mod.p_names.index("gap")
    for gap in (0.0, 2e-11):
        p[place] = gap
        closed = mod.project(x, p=p)
        residuals = mod.bind(p=p).constraints(closed[: mod.n_q], rows="all")
        assert np.abs(residuals).max() == pytest.approx(gap / 2, abs=1e-14)
    for gap in (1e-9, 1e-3):
        p[place] = gap
        with pytest.raises(eg.ProjectionError):
            mod.project(x, p=p)
