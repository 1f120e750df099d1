"""Base parameters: published numbers and combinations, Khalil's rules, turned frames, other cuts; and their fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from acceptance import test_turned_frames as linkages
from acceptance.test_puma560 import build_puma
from powered import derived, tree
from scipy.spatial.transform import Rotation
from shipped_robots import urdf_robots

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.frames import Frame
from eomgen.graph import vectors
from eomgen.graph.tensors import rotate_symmetric

KERNELS = ["inverse_dynamics", "inertial_terms"]
DOWN = (0.0, 0.0, -9.81)


def compiled(model: Any) -> Any:
    return model.derive("recursive").compile(target="numpy", kernels=KERNELS)


def chain(rows: Sequence[tuple[float, float, float, bool]], gravity: Sequence[float] = DOWN) -> eg.Model:
    """A serial robot of links with standard DH rows alpha, a, d, and whether the joint slides."""
    m = eg.Model("chain", gravity=tuple(gravity))
    last: Any = m.ground
    random = np.random.default_rng(2)
    for k, (alpha, a, d, slides) in enumerate(rows, start=1):
        link = m.body(f"link{k}", 2.0, com=tuple(random.uniform(-0.1, 0.1, 3).tolist()), inertia=(0.3, 0.25, 0.2))
        near = link.at(-a, -d * sin(alpha), -d * cos(alpha), rpy=(-alpha, 0, 0))
        add = m.prismatic if slides else m.revolute
        add(f"q{k}", last, near, axis="z")
        last = link
    return m


#: Scheinman's arm (Paul, Robot Manipulators, 1981, table 2.1); the joint in the middle slides.
STANFORD = [(-pi / 2, 0, 0.412, False), (pi / 2, 0, 0.154, False), (0, 0, 0, True), (-pi / 2, 0, 0, False),
            (pi / 2, 0, 0, False), (0, 0, 0.263, False)]  # fmt: skip
SCARA = [(0, 0.3, 0.4, False), (0, 0.25, 0, False), (0, 0, 0, False), (0, 0, 0, True)]
ELBOW = [(pi / 2, 0.1, 0.3, False), (0, 0.4, 0, False), (pi / 2, 0.05, 0, False), (-pi / 2, 0, 0.4, False),
         (pi / 2, 0, 0, False), (0, 0, 0.1, False)]  # fmt: skip


def test_puma_has_the_published_number() -> None:
    """36: H. Mayeda, K. Yoshida, K. Osuka, Base parameters of manipulator dynamic models, IEEE Trans. RA 6 (1990),
    312-321; M. Gautier, W. Khalil, the same volume, 368-373, with gravity along the first axis."""
    assert len(compiled(build_puma()).base_parameters()) == 36
    assert len(eg.load_example("puma560").compile(target="numpy").base_parameters()) == 36


@pytest.mark.parametrize(
    ("rows", "gravity", "number"),
    [
        # Khalil's rules, link by link (Gautier, Khalil 1990, sec. III and IV; Khalil, Dombre, Modeling, Identification
        # and Control of Robots, 2002, sec. 9.4): a first link that turns about gravity keeps ZZ, about another axis
        # MX, MY too; a link that turns loses YY, MZ, M; one that slides keeps MX, MY, MZ, M.
        (STANFORD, DOWN, 1 + 7 + 4 + 7 + 7 + 7),
        (STANFORD, (1.0, 2.0, -9.0), 3 + 7 + 4 + 7 + 7 + 7),
        (ELBOW, DOWN, 1 + 7 + 7 + 7 + 7 + 7),
        (ELBOW, (1.0, 2.0, -9.0), 3 + 7 + 7 + 7 + 7 + 7),
        # axes that stay parallel: of the links after the first ZZ, MX, MY; the last, which slides along them, M
        (SCARA, DOWN, 1 + 3 + 3 + 1),
    ],
)
def test_numbers_are_those_of_khalils_rules(
    rows: list[tuple[float, float, float, bool]], gravity: Sequence[float], number: int
) -> None:
    assert len(compiled(chain(rows, gravity)).base_parameters()) == number


#: PUMA 560 with its offsets (Armstrong, Khatib, Burdick, ICRA 1986).
PUMA = [(-pi / 2, 0, 0, False), (0, 0.4318, 0.2435, False), (pi / 2, -0.0203, -0.0934, False),
        (-pi / 2, 0, 0.4331, False), (pi / 2, 0, 0, False), (0, 0, 0, False)]  # fmt: skip


def rank_of_pinocchio(rows: Sequence[tuple[float, float, float, bool]], gravity: Sequence[float]) -> int:
    """The rank of Pinocchio's regressor of the same arm at 100 random states, with a wide gap behind it."""
    arm, joint, place = pin.Model(), 0, pin.SE3.Identity()
    arm.gravity.linear = np.array(gravity)
    for k, (alpha, a, d, slides) in enumerate(rows):
        joint = arm.addJoint(joint, pin.JointModelPZ() if slides else pin.JointModelRZ(), place, f"q{k}")
        place = pin.SE3(pin.utils.rotate("x", alpha), np.array([a, 0.0, d]))
    data, random = arm.createData(), np.random.default_rng(8)
    Y = np.concatenate(
        [pin.computeJointTorqueRegressor(arm, data, *random.uniform(-2, 2, (3, arm.nv))) for _ in range(100)]
    )
    sizes = np.linalg.svd(Y, compute_uv=False)
    rank = int((sizes > 1e-8 * sizes[0]).sum())
    assert sizes[rank - 1] > 1e-3 * sizes[0]
    assert sizes[rank] < 1e-13 * sizes[0]
    return rank


@pytest.mark.parametrize("gravity", [DOWN, (1.0, 2.0, -9.0)], ids=["along", "across"])
@pytest.mark.parametrize(
    ("rows", "number"),
    [(STANFORD, 33), (SCARA, 8), (ELBOW, 36), (PUMA, 36)],
    ids=["stanford", "scara", "elbow", "puma"],
)
def test_numbers_are_the_ranks_of_pinocchios_regressor(
    rows: list[tuple[float, float, float, bool]], number: int, gravity: Sequence[float]
) -> None:
    """With gravity across the first axis two more."""
    expected = number + (2 if gravity != DOWN else 0)
    assert rank_of_pinocchio(rows, gravity) == len(compiled(chain(rows, gravity)).base_parameters()) == expected


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("kuka iiwa", 43),  # 1 and 7 of each further link, as of the chains above
        ("ur10", 36),
        ("solo12", 94),  # 10 of the base and 7 of each link (K. Ayusawa, G. Venture, Y. Nakamura, IJRR 33 (2014))
        ("talos", 234),
    ],
)
def test_robots_have_seven_a_link(name: str, number: int) -> None:
    if name not in urdf_robots():
        pytest.skip("pybullet_data is not installed")
    file, floating = urdf_robots()[name]
    rotation = "euler_parameters" if floating else "euler_angles"
    model = eg.load(file, floating=floating, rotation=rotation, mimic="independent")
    assert len(compiled(model).base_parameters()) == number


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
    base = compiled(planar_arm()).base_parameters()
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
    assert "Izz(upper) + 0.25 m(lower)" in base._repr_html_()
    assert base.combination.shape == (len(base), 20)
    longer = compiled(planar_arm()).base_parameters(p={"length": 1.0})
    assert longer.texts["mx(upper)"] == "mx(upper) + m(lower)"


def with_other_frames(made: Any, seed: int) -> Any:
    """The same tree, every body described in a frame of its own."""
    random, graph, m = np.random.default_rng(seed), made.mechanism.graph, made.mechanism
    bodies, frames = [], {-1: None}
    for k, body in enumerate(m.bodies):
        turn = Rotation.random(random_state=random).as_matrix()
        R = tuple(vectors.vector(graph, row) for row in turn.tolist())
        shift = vectors.vector(graph, random.uniform(-1, 1, 3).tolist())
        frames[k] = (R, shift)
        com = vectors.add(vectors.times(R, body.com), shift)
        bodies.append(replace(body, com=com, inertia=rotate_symmetric(R, body.inertia)))

    def moved(marker: Any) -> Any:
        if frames[marker.body] is None:
            return marker
        R, shift = frames[marker.body]
        place = vectors.add(vectors.times(R, marker.frame.position), shift)
        return replace(marker, frame=Frame(vectors.product(R, marker.frame.rotation), place))

    joints = [replace(s, predecessor=moved(s.predecessor), successor=moved(s.successor)) for s in m.joints]
    return replace(made, mechanism=replace(m, bodies=tuple(bodies), joints=tuple(joints), forces=()))


@pytest.mark.parametrize(
    "case",
    [
        (("revolute", "screw", "spherical"), 4, "euler_angles"),
        (("continuous", "universal", "free"), 4, "euler_parameters"),
        (("prismatic", "constant_velocity", "point_on_curve"), 4, "euler_angles"),
        (("cylindrical", "planar", "weld", "revolute"), 5, "euler_angles"),
    ],
    ids=lambda c: "-".join(c[0]),
)
def test_number_and_forces_do_not_depend_on_frames_or_random_states(case: Any) -> None:
    made = tree(*case)
    made = replace(made, mechanism=replace(made.mechanism, forces=()))
    module, turned = (derived(x, "recursive").compile(target="numpy", kernels=KERNELS)
                      for x in (made, with_other_frames(made, 5)))  # fmt: skip
    base, other = module.base_parameters(), turned.base_parameters()
    assert len(base) == len(other) == len(module.base_parameters(seed=3)) < len(base.standard)
    random = np.random.default_rng(6)
    q = random.uniform(-1, 1, (module.n_q, 3))
    v, a = random.normal(size=(2, module.n_v, 3))
    torque = module.inverse_dynamics(q, v, a)
    for one in (base, other):
        forces = np.einsum("ijk,j->ik", one.regressor(q, v, a), np.array(list(one.values.values())))
        assert forces == pytest.approx(torque, rel=0, abs=1e-12 * np.abs(torque).max())


@pytest.mark.parametrize("build", [linkages.four_bar, linkages.slider_crank, linkages.five_bar_slider])
def test_loops_keep_their_number_however_they_are_described(build: Any) -> None:
    """Of frames turned, and forces along the free motion are those of the standard parameters."""
    plain, turned = build(), build(np.random.default_rng(7))
    bases = [m.compile(target="numpy").base_parameters() for m in (plain, turned)]
    assert len(bases[0]) == len(bases[1])
    module = bases[0].module
    x = module.project(module.x0() + 0.2)
    q, v = x[: module.n_q], x[module.n_q :]
    a = module.rhs(0.0, x)[module.n_q :]
    free = np.linalg.svd(module.constraint_jacobian(q))[2][-module.n_dof :]
    reduced = free @ bases[0].regressor(q, v, a) @ np.array(list(bases[0].values.values()))
    assert reduced == pytest.approx(free @ module.inertial_remainder(q, v, a) * -1.0 + free @ module.inverse_dynamics(
        q, v, a), abs=1e-9 * np.abs(module.inverse_dynamics(q, v, a)).max())  # fmt: skip
    with pytest.raises(UsageError, match="has loops or other constraints"):
        bases[0].fit(q[:, None], v[:, None], a[:, None], a[:, None])


def test_rounded_angles_of_a_file_count_as_they_are_or_as_they_are_meant() -> None:
    """The base of this arm leans by 1e-7, for its file writes pi in eight digits."""
    module = compiled(eg.load(urdf_robots()["so101"][0], mimic="independent"))
    assert (len(module.base_parameters()), len(module.base_parameters(least=1e-5))) == (38, 36)


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
    for _ in range(20):
        noisy = tau + random.normal(size=tau.shape) * np.array([[0.1], [0.02]])
        noisy[0, ::50] = np.nan
        found = base.fit(q, v, a, noisy, also=["f"])
        distances += [(found.values[n] - x) / found.errors[n] for n, x in truth.items()]
        assert found.sigma == pytest.approx({"a_dot": 0.1, "b_dot": 0.02}, rel=0.15)
    far = np.abs(distances)
    assert far.max() < 3.8  # of 140; normal deviates pass 3.8 once in 7000
    assert 0.58 < (far < 1.0).mean() < 0.79
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


def test_a_drives_inertia_and_a_links_are_not_told_apart() -> None:
    module = planar_arm(armature="J").compile(target="numpy")
    q, v, a = motion()
    found = module.base_parameters().fit(q, v, a, module.inverse_dynamics(q, v, a), also=["J"])
    assert found.undetermined == ("Izz(upper)", "J")
    assert found.errors["J"] == float("inf")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"also": ["nothing"]}, "no parameter 'nothing'"),
        ({"also": ["d"]}, "not linear in d"),
        ({"also": ["w"]}, "hold already"),
        ({"also": ["length"]}, "hold already|geometry"),
        ({"tau": np.zeros((2, 3))}, r"tau must have shape \(2, k\)"),
        ({"tau": np.full((2, 600), np.nan)}, "0 finite values of tau cannot tell 6"),
        ({"sigma": [1.0, -1.0]}, "sigma must be positive"),
    ],
)
def test_bad_fits_say_what_is_wrong(change: dict[str, Any], words: str) -> None:
    module = planar_arm().compile(target="numpy")
    q, v, a = motion()
    tau = change.pop("tau", None)
    tau = module.inverse_dynamics(q, v, a) if tau is None else tau
    with pytest.raises(UsageError, match=words):
        module.base_parameters().fit(q, v, a, tau, **change)
