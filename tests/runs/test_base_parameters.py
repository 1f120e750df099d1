"""Inertial parameters: Pinocchio's regressor column by column and its rank, turned frames, loops; and their fit."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from analysed import compiled
from random_models import Clothes, Made, random_recipe
from refusals import refuses

import eomgen as eg

KERNELS = ["inverse_dynamics", "inertial_terms"]
DOWN = (0.0, 0.0, -9.81)
Rows = Sequence[tuple[float, float, float, bool]]
#: Pinocchio's ten parameters (m, mc, xx, xy, yy, xz, yz, zz) in our order.
THEIRS = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]
#: Standard DH rows alpha, a, d, and whether the joint slides.  Scheinman's arm (Paul, Robot Manipulators, 1981, table
#: 2.1); PUMA 560 with its offsets (Armstrong, Khatib, Burdick, ICRA 1986).
STANFORD = [(-pi / 2, 0, 0.412, False), (pi / 2, 0, 0.154, False), (0, 0, 0, True), (-pi / 2, 0, 0, False),
            (pi / 2, 0, 0, False), (0, 0, 0.263, False)]  # fmt: skip
SCARA = [(0, 0.3, 0.4, False), (0, 0.25, 0, False), (0, 0, 0, False), (0, 0, 0, True)]
PUMA = [(-pi / 2, 0, 0, False), (0, 0.4318, 0.2435, False), (pi / 2, -0.0203, -0.0934, False),
        (-pi / 2, 0, 0.4331, False), (pi / 2, 0, 0, False), (0, 0, 0, False)]  # fmt: skip


def chain(rows: Rows, gravity: Sequence[float]) -> Any:
    """A serial robot whose links are described in the frames of their joints."""
    m = eg.Model("chain", gravity=tuple(gravity))
    place: Any = m.ground
    random = np.random.default_rng(2)
    for k, (alpha, a, d, slides) in enumerate(rows):
        link = m.body(f"link{k}", 2.0, com=tuple(random.uniform(-0.1, 0.1, 3).tolist()), inertia=(0.3, 0.25, 0.2))
        (m.prismatic if slides else m.revolute)(f"q{k}", place, link, axis="z")
        place = link.at(a, 0, d, rpy=(alpha, 0, 0))
    return m.derive("recursive").compile(target="numpy", kernels=KERNELS)


@pytest.mark.parametrize("gravity", [DOWN, (1.0, 2.0, -9.0)], ids=["along", "across"])
@pytest.mark.parametrize(
    ("rows", "number"), [(STANFORD, 33), (SCARA, 8), (PUMA, 36)], ids=["stanford", "scara", "puma"]
)
def test_columns_and_number_are_those_of_pinocchios_regressor(
    rows: Rows, number: int, gravity: Sequence[float]
) -> None:
    """The number is the rank at 100 random states; 36 of PUMA is published (Mayeda, Yoshida, Osuka, IEEE Trans. RA 6,
    1990); by Khalil's rules a first link that turns about another axis than gravity's has two more (sec. 9.4)."""
    module, arm, joint, place = chain(rows, gravity), pin.Model(), 0, pin.SE3.Identity()
    arm.gravity.linear = np.array(gravity)
    for k, (alpha, a, d, slides) in enumerate(rows):
        joint = arm.addJoint(joint, pin.JointModelPZ() if slides else pin.JointModelRZ(), place, f"q{k}")
        place = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, d]))
    data, random = arm.createData(), np.random.default_rng(8)
    blocks = []
    for _ in range(100):
        q, v, a = random.uniform(-2, 2, (3, arm.nv))
        blocks.append(pin.computeJointTorqueRegressor(arm, data, q, v, a))
    Y = module.regressor(q, v, a).reshape(arm.nv, -1, 10)
    expected = blocks[-1].reshape(arm.nv, -1, 10)[:, :, THEIRS]
    assert (np.abs(Y - expected) <= 1e-12 * np.abs(expected).max()).all()
    pi_of = np.array(list(module.standard_parameters().values()))
    assert Y.reshape(arm.nv, -1) @ pi_of == pytest.approx(module.inverse_dynamics(q, v, a), abs=1e-10)
    sizes = np.linalg.svd(np.concatenate(blocks), compute_uv=False)
    rank = int((sizes > 1e-8 * sizes[0]).sum())
    assert sizes[rank] < 1e-13 * sizes[0] < 1e-3 * sizes[0] < sizes[rank - 1]
    assert rank == len(module.base_parameters()) == number + (2 if gravity != DOWN else 0)


@pytest.mark.parametrize(
    "case",
    [
        (("revolute", "screw", "spherical"), 4, "euler_angles"),
        (("continuous", "universal", "free"), 4, "euler_parameters"),
        (("prismatic", "constant_velocity", "point_on_curve"), 4, "euler_angles"),
        (("cylindrical", "planar", "weld", "revolute"), 5, "euler_angles"),
        (("surface_slider", "point_on_surface", "spherical", "translational"), 5, "euler_parameters"),
    ],
    ids=lambda c: "-".join(c[0]),
)
def test_number_and_forces_do_not_depend_on_frames(case: Any) -> None:
    group, count, rotation = case
    recipe = random_recipe(5, [*group, *group][:count], rotation)
    module = Made(recipe).compile("recursive", kernels=KERNELS)
    turned = Made(recipe, Clothes(frames=True)).compile(kernels=KERNELS)
    base, other = module.base_parameters(), turned.base_parameters()
    assert len(base) == len(other) == len(module.base_parameters(seed=3)) < len(base.standard)
    random = np.random.default_rng(6)
    q = random.uniform(-1, 1, (module.n_q, 3))
    v, a = random.normal(size=(2, module.n_v, 3))
    torque = turned.inverse_dynamics(q, v, a)
    for one in (base, other):
        forces = np.einsum("ijk,j->ik", one.regressor(q, v, a), np.array(list(one.values.values())))
        assert forces == pytest.approx(torque, rel=0, abs=1e-11 * np.abs(torque).max())
    standard = np.array(list(turned.standard_parameters().values()))
    for k in range(3):  # the regressor knows nothing of the inertia
        Y = turned.regressor(q[:, k], v[:, k], a[:, k])
        assert Y @ standard == pytest.approx(torque[:, k], rel=0, abs=1e-11 * np.abs(torque).max())


def test_loops_keep_their_number_however_they_are_described() -> None:
    """Forces along the free motion are those of the standard parameters."""
    bases = [compiled(name).base_parameters() for name in ("four_bar", "skewed_four_bar")]
    assert len(bases[0]) == len(bases[1])
    for base in bases:
        module = base.module
        x = module.project(module.x0() + 0.2)
        q, v = x[: module.n_q], x[module.n_q :]
        a = module.rhs(0.0, x)[module.n_q :]
        free = np.linalg.svd(module.constraint_jacobian(q, rows="all"))[2][-module.n_dof :]
        reduced = free @ base.regressor(q, v, a) @ np.array(list(base.values.values()))
        torque = module.inverse_dynamics(q, v, a)
        assert reduced == pytest.approx(free @ torque, abs=1e-9 * np.abs(torque).max())
        refuses("EG-UNSUPPORTED constraints", base.fit, q[:, None], v[:, None], a[:, None], a[:, None])


def planar_arm(**further: Any) -> eg.Model:
    """Two links, l = 0.5, with friction in both joints."""
    m = eg.Model("arm", gravity=(0, -9.81, 0))
    for name, value in {"d": 0.15, "f": 0.2, "J": 0.01, "g": 9.81, "w": 1.2, "length": 0.5}.items():
        m.parameter(name, value)
    m.body("upper", 2.0, com=(0.25, 0.01, 0), inertia={"zz": 0.05}, markers={"tip": ("length", 0, 0)})
    m.body("lower", "w", com=(0.2, 0, 0), inertia={"zz": 0.03})
    m.revolute("shoulder", m.ground, "upper", coordinate="a", **further)
    m.revolute("elbow", "upper.tip", "lower", coordinate="b")
    m.friction("in_shoulder", "shoulder", viscous="d")
    m.friction("in_elbow", "elbow", coulomb="f", smoothing=0.05)
    m.torque("squared", "elbow", "-0.01*d**2*b_dot")
    return m


def test_planar_arm_has_its_textbook_combinations() -> None:
    """I1 + m2 l1^2, m1 c1 + m2 l1, I2, m2 c2 (Siciliano et al., Robotics, 2009, sec. 7.3.2)."""
    base = planar_arm().compile(target="numpy").base_parameters()
    assert base.texts == {
        "Izz(upper)": "Izz(upper) + 0.25 m(lower)",
        "mx(upper)": "mx(upper) + 0.5 m(lower)",
        "my(upper)": "my(upper)",
        "Izz(lower)": "Izz(lower)",
        "mx(lower)": "mx(lower)",
        "my(lower)": "my(lower)",
    }
    assert base.values["Izz(upper)"] == pytest.approx(0.05 + 2.0 * (0.25**2 + 0.01**2) + 1.2 * 0.25, rel=1e-14)
    assert base.values_of({"m(lower)": 2.0})["mx(upper)"] == pytest.approx(0.5 + 1.0)
    assert "m(upper)" in base.without_effect
    assert "of 20 standard ones" in repr(base)
    assert base.combination.shape == (len(base), 20)
    longer = planar_arm().compile(target="numpy").base_parameters(p={"length": 1.0})
    assert longer.texts["mx(upper)"] == "mx(upper) + m(lower)"


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two sums of sines with their exact derivatives."""
    t = np.linspace(0, 10, 600)
    parts = [((1.0, 2.0, 0.0), (0.5, 3.3, 1.0)), ((1.0, 2.7, 1.6), (0.6, 4.1, 0.0))]
    q, v, a = (
        np.array([sum(s * w**n * np.sin(w * t + f + n * pi / 2) for s, w, f in row) for row in parts]) for n in range(3)
    )
    return q, v, a


def test_base_parameters_and_friction_come_back() -> None:
    """Exactly from exact forces; within their errors from noisy ones, as often as a normal distribution says."""
    module = planar_arm().compile(target="numpy")
    base, (q, v, a) = module.base_parameters(), motion()
    tau = module.inverse_dynamics(q, v, a)
    truth = base.values | {"f": 0.2}
    exact = base.fit(q, v, a, tau, also=["f"])
    assert list(exact.values.values()) == pytest.approx(list(truth.values()), abs=1e-12)
    assert exact.condition < 10.0
    random, distances = np.random.default_rng(1), []
    for _ in range(8):
        noisy = tau + random.normal(size=tau.shape) * np.array([[0.1], [0.02]])
        noisy[0, ::50] = np.nan
        found = base.fit(q, v, a, noisy, also=["f"])
        distances += [(found.values[n] - x) / found.errors[n] for n, x in truth.items()]
        assert found.sigma == pytest.approx({"a_dot": 0.1, "b_dot": 0.02}, rel=0.15)
    far = np.abs(distances)
    assert far.max() < 3.8
    assert 0.5 < (far < 1.0).mean() < 0.85
    assert (far < 2.0).mean() > 0.9
    assert "+-" in repr(found)
    assert found.relative_errors["Izz(upper)"] < 0.02
    given = base.fit(q, v, a, noisy, also=["f"], sigma=[0.1, 0.02])
    W = np.concatenate([np.vstack([base.regressor(q, v, a)[i], np.zeros((1, 600))]).T / s for i, s in
                        enumerate((0.1, 0.02))])  # fmt: skip
    W[600:, -1] = np.tanh(v[1] / 0.05) / 0.02  # the law of friction, smoothed
    y = np.concatenate([(noisy[0] - 0.15 * v[0]) / 0.1, (noisy[1] - 0.01 * 0.15**2 * -v[1] * -1.0) / 0.02])
    there = np.isfinite(y)
    expected, *_ = np.linalg.lstsq(W[there], y[there], rcond=None)
    assert list(given.values.values()) == pytest.approx(expected, rel=1e-8, abs=1e-9)
    assert given.covariance == pytest.approx(np.linalg.inv(W[there].T @ W[there]), rel=1e-6, abs=1e-14)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"also": ["nothing"]}, "EG-NAME-UNKNOWN nothing"),
        ({"also": ["d"]}, "EG-UNSUPPORTED d"),
        ({"also": ["w"]}, "EG-UNSUPPORTED already"),
        ({"tau": np.zeros((2, 3))}, "EG-SHAPE tau 2"),
        ({"tau": np.full((2, 600), np.nan)}, "EG-SHAPE tau 0 6"),
        ({"sigma": [1.0, -1.0]}, "EG-RANGE sigma"),
    ],
)
def test_bad_fits_say_what_is_wrong(change: dict[str, Any], words: str) -> None:
    module = planar_arm().compile(target="numpy")
    q, v, a = motion()
    tau = change.pop("tau", None)
    tau = module.inverse_dynamics(q, v, a) if tau is None else tau
    refuses(words, lambda: module.base_parameters().fit(q, v, a, tau, **change))


def test_what_is_not_inertial_remains() -> None:
    module = planar_arm(armature="J").compile(target="numpy", kernels=KERNELS)
    q, v, a = np.array([[0.3, 1.0], [-0.8, 0.2]]), np.array([[1.0, -2.0], [0.5, 1.5]]), np.array([[3.0, 0], [0, -4]])
    rubbing = 0.2 * np.tanh(v[1] / 0.05) + 0.01 * 0.15**2 * v[1]
    found = module.inertial_remainder(q, v, a)
    assert found == pytest.approx(np.array([0.01 * a[0] + 0.15 * v[0], rubbing]), abs=1e-13)
    other = {"w": 3.0, "J": 0.1, "d": 0.15}
    assert module.standard_parameters(other)["mx(lower)"] == pytest.approx(0.6, rel=1e-15)
    assert module.standard_parameters()["Ixy(upper)"] == pytest.approx(-2.0 * 0.25 * 0.01)
    assert module.inertial_remainder(q, v, a, p=other)[0] == pytest.approx(0.1 * a[0] + 0.15 * v[0], abs=1e-13)
    one, out = module.regressor(q[:, 1], v[:, 1], a[:, 1]), np.empty((2, 20, 2))
    assert module.regressor(q, v, a, out=out) is out
    assert one == pytest.approx(out[:, :, 1], abs=1e-14)


def test_wrong_calls_say_what_is_wrong() -> None:
    module = planar_arm().compile(target="numpy")
    refuses("EG-SHAPE (2,)", module.regressor, [0.1], [0.1, 0.2], [0.1, 0.2])
    refuses("EG-SHAPE states", module.regressor, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 4)))
    bare = eg.Model.from_equations("bare", ["x"], mass_matrix=[["1"]], forcing=["-x"]).compile(target="numpy")
    refuses("EG-UNSUPPORTED bodies", bare.regressor, [0.1], [0.1], [0.1])
    refuses("EG-RANGE least 0 1 -1", module.base_parameters, least=-1)
