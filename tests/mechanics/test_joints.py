"""Joints: histories of MSC ADAMS, shafts, threads and guides, pairs of axes, moving guides in closed form."""

from typing import Any

import numpy as np
import pytest
from judges import first
from models import reference
from scipy.spatial.transform import Rotation
from sweeps import METHODS, TARGETS

import eomgen as eg
from eomgen.elements import rotations

# -- MSC ADAMS, as stored with Project Chrono (data/testing/joints, BSD-3) ---------------------------------------------
KINDS = {"rev": "revolute", "rev_spring": "revolute", "sph": "spherical", "pri": "prismatic", "cyl": "cylindrical"}
END = 2.0


def placed(body: Any, rotation: Rotation, position: Any) -> Any:
    """A marker from a rotation and a position in the body."""
    rpy = rotations.euler_angles_from_matrix("zyx", rotation.as_matrix())[::-1]
    return body.at(*map(float, position), rpy=tuple(map(float, rpy)))


def pendulum(name: str, inertia: list[float]) -> tuple[eg.Model, Any]:
    """A model with one body of 1 kg whose frame is in its centre of mass, and outputs of that."""
    m = eg.Model(name, gravity=(0, 0, -9.80665))
    body = m.body("body", mass=1, inertia=tuple(inertia))
    origin = body.at(0, 0, 0)
    for k, axis in enumerate("xyz"):
        m.output(axis, origin.position[k])
        m.output(f"v{axis}", origin.velocity[k])
        m.output(f"a{axis}", origin.acceleration[k])
    return m, body


def compared(m: eg.Model, rows: list[dict[str, Any]], position: float, velocity: float) -> None:
    """The motion from rest equals the rows, within the given differences."""
    rows = [row for row in rows if row["t"] <= END]
    module = m.compile(target="numpy")
    times = np.array([row["t"] for row in rows])
    trajectory = module.simulate((0, END), t_eval=times, rtol=1e-9, atol=1e-10)
    for name, allowed in (("pos", position), ("vel", velocity)):
        expected = np.array([row[name] for row in rows])
        found = np.stack([trajectory[("" if name == "pos" else "v") + axis] for axis in "xyz"], axis=1)
        assert np.abs(found - expected).max() <= allowed
    R = np.array([module.poses(trajectory.x[: module.n_q, k])[0][:3, :3] for k in range(len(times))])
    theirs = Rotation.from_quat([row["quat"] for row in rows], scalar_first=True).as_matrix()
    assert np.abs(R - theirs).max() <= max(position, 1e-5)


@pytest.mark.parametrize("case", reference("adams_single_body_joints")["cases"])
def test_lower_pairs(case: str) -> None:
    given = reference("adams_single_body_joints")["cases"][case]
    geometry = given["geometry"]
    m, body = pendulum(case, geometry["inertia_cm_frame"])
    ground = Rotation.from_matrix(geometry["ground_joint_frame_columns_xyz"])
    frame = Rotation.from_matrix(geometry["cm_frame0"])
    joint = Rotation.from_matrix(geometry["body_joint_frame0"])
    arm = frame.inv().apply(np.subtract(geometry["body_point0_global"], geometry["cm0"]))
    base, end = placed(m.ground, ground, geometry["ground_point"]), placed(body, frame.inv() * joint, arm)
    m.joint(KINDS[geometry["joint_type"]], "j", base, end)
    if geometry["joint_type"] == "rev_spring":
        m.torsional_spring("k", joint="j", stiffness=200)
        m.torsional_damper("d", joint="j", damping=10)
    check = given["check"]
    compared(m, given["rows"], 2 * check["pos"] + 1e-6, 2 * check["vel"] + 1e-6)


def turn(marker: dict[str, Any]) -> Rotation:
    """Body-fixed 3-1-3 angles in degrees."""
    return Rotation.from_euler("ZXZ", marker["reuler"], degrees=True)


@pytest.mark.parametrize("case", reference("adams_universal_and_distance")["cases"])
def test_universal_joint_and_massless_rod(case: str) -> None:
    """ADAMS's Hooke joint takes marker I on the ground; its own error in these cases is about 1e-3."""
    given = reference("adams_universal_and_distance")["cases"][case]
    markers = given["markers"]
    m, body = pendulum(case, given["inertia"])
    centre = markers["0201"]
    frame, at = turn(centre), np.array(centre["at"])
    end = placed(body, frame.inv() * turn(markers["0202"]), frame.inv().apply(np.array(markers["0202"]["at"]) - at))
    base = placed(m.ground, turn(markers["0102"]), markers["0102"]["at"])
    if case.startswith("Universal"):
        m.universal("u", base, end)
        plane = case != "Universal_Case03"
        compared(m, given["rows"], 5e-4 if plane else 6e-3, 1e-3 if plane else 2e-2)
    else:
        m.free("f", placed(m.ground, frame, at), body, sequence="yzx")
        m.distance("rod", base, end, length=2)
        compared(m, given["rows"], 2e-5, 2e-4)


# -- Shafts, threads and guides ----------------------------------------------------------------------------------------
BEND = np.pi / 6


def shafts(kind: str) -> eg.Model:
    """Two shafts in bearings, bent by 30 degrees; the second bearing's axis passes the joint's centre."""
    m = eg.Model("shafts")
    drive = m.body("drive", mass=1, inertia=(0.1, 0.1, 0.2))
    driven = m.body("driven", mass=1, inertia=(0.1, 0.1, 0.2))
    m.revolute("A", m.ground, drive, coordinate="t1")
    m.joint(kind, "J", drive, driven)
    m.joint("parallel", "B", m.ground.at(0, 0, 0, rpy=(0, BEND, 0)), driven)
    m.output("spin_x", driven.at(1, 0, 0).velocity[1])
    return m


def ratio(module: eg.Module, t1: float) -> float:
    """Angular speed of the driven shaft per unit of the driving one, from poses."""
    x = module.x0(t1=t1, t1_dot=1.0)
    h = 1e-5
    q, v = x[: module.n_q], x[module.n_q :]
    slope = (module.poses(q + h * v)[1] - module.poses(q - h * v)[1])[:3, :3] / (2 * h)
    spin = slope @ module.poses(q)[1][:3, :3].T
    omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    axis = np.array([np.sin(BEND), 0, np.cos(BEND)])
    assert np.abs(np.cross(omega, axis)).max() < 1e-8  # it turns in its bearing
    return float(omega @ axis)


def test_speed_ratio_of_a_cardan_joint() -> None:
    """w2/w1 = cos b / (1 - sin^2 b cos^2 t1) (cam_gear_cardan.json: closed form)."""
    module = shafts("universal").compile(target="numpy")
    for degrees in (0, 30, 45, 60, 90):
        t1 = np.radians(degrees)
        expected = np.cos(BEND) / (1 - np.sin(BEND) ** 2 * np.cos(t1) ** 2)
        assert ratio(module, float(t1)) == pytest.approx(expected, abs=1e-8)


def test_constant_velocity_joint_transmits_evenly() -> None:
    module = shafts("constant_velocity").compile(target="numpy")
    for t1 in np.linspace(0, 2.5, 6):
        assert ratio(module, float(t1)) == pytest.approx(1.0, abs=1e-8)


def test_bolt_falls_down_its_thread() -> None:
    """A screw of lead h with its axis upright: (m h^2 + I) a = - m g h."""
    m = eg.Model("bolt", gravity=(0, 0, -9.81))
    bolt = m.body("bolt", mass=2, inertia=(0.1, 0.1, 0.003))
    m.screw("turn", m.ground, bolt, pitch="p")
    m.parameter("p", 0.1)
    h = 0.1 / (2 * np.pi)
    found = m.compile(target="numpy").rhs(0.0, [20.0, 0.0])[1]
    assert found == pytest.approx(-2 * 9.81 * h / (2 * h * h + 0.003), rel=1e-13)


# -- Axes --------------------------------------------------------------------------------------------------------------
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


# -- Guides that move --------------------------------------------------------------------------------------------------
MOVING: dict[str, dict[str, Any]] = {
    "revolute": {}, "prismatic": {}, "cylindrical": {}, "planar": {}, "universal": {}, "screw": {"pitch": 0.4},
    "spherical": {}, "free": {"sequence": "zxz"}, "constant_velocity": {},
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_a_bead_on_a_parabola(method: str) -> None:
    """z = c x^2: (1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 g c x = 0 (Goldstein, exercise 1.19, at rest)."""
    c = 0.7
    m = eg.Model("bead", gravity=(0, 0, -9.81))
    bead = m.body("bead", mass=1.7)
    m.curve_slider("wire", m.ground, bead, curve=["s", 0, f"{c}*s**2"], coordinate="s")
    mod = m.compile(method=method, target="numpy")
    for x, v in ((0.4, 2.0), (-1.1, 0.6)):
        expected = -(4 * c**2 * x * v**2 + 2 * 9.81 * c * x) / (1 + 4 * c**2 * x**2)
        assert mod.rhs(0.0, np.array([x, v])) == pytest.approx([v, expected], rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_heavy_top_in_euler_angles(method: str) -> None:
    """Steady precession: A p^2 cos(theta) - C (r + p cos(theta)) p + m g l = 0 (Goldstein, sec. 5.7)."""
    A, C, mgl, theta, spin = 0.8, 0.3, 2.0 * 9.81 * 0.25, 0.6, 40.0
    m = eg.Model("top", gravity=(0, 0, -9.81))
    body = m.body("top", mass=2.0, com=(0, 0, 0.25), inertia=(A - 2.0 * 0.25**2, A - 2.0 * 0.25**2, C))
    m.spherical("tip", m.ground, body, sequence="zxz")
    mod = m.compile(method=method, target="numpy")
    roots = np.roots([(A - C) * np.cos(theta), -C * spin, mgl])
    for p in roots.real:
        x = np.array([0.4, theta, 1.3, p, 0.0, spin])
        assert mod.rhs(0.0, x)[3:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9 * (p * p + spin * spin))


@pytest.mark.parametrize("kind", MOVING)
def test_joints_from_the_second_body_to_the_first(kind: str) -> None:
    """The tree passes such a joint backwards: velocity of a point of the body behind it, as a difference of places."""
    m = eg.Model("backwards", gravity=(0, 0, 0))
    first = m.body("first", mass=1.0, inertia=(1, 1, 1))
    second = m.body("second", mass=1.0, com=(0.1, 0.2, 0.3), inertia=(1, 2, 2))
    m.revolute("A", m.ground, first, axis="y")
    near = second.at(0.3, -0.2, 0.1, rpy=(0.4, 0.2, -0.3))
    getattr(m, kind)("B", near, first.at(0.5, 0.1, 0.2, rpy=(-0.2, 0.5, 0.3)), **MOVING[kind])
    tip = second.marker("tip", at=(0.4, 0.5, -0.6))
    for k, letter in enumerate("xyz"):
        m.output(f"at_{letter}", tip.position[k])
        m.output(f"speed_{letter}", tip.velocity[k])
    mod = m.compile(target="numpy")
    n, rng, h = mod.n_q, np.random.default_rng(5), 1e-4
    q, v = rng.uniform(0.3, 0.9, n), rng.uniform(-1.0, 1.0, n)

    def places(s: float) -> np.ndarray:
        return np.array(mod.outputs(0.0, np.concatenate([q + s * v, v])))[::2]

    expected = (8.0 * (places(h) - places(-h)) - (places(2 * h) - places(-2 * h))) / (12.0 * h)
    assert mod.outputs(0.0, np.concatenate([q, v]))[1::2] == pytest.approx(expected, abs=1e-10)


# -- Inertia of drives -------------------------------------------------------------------------------------------------
DRIVE, GRAVITY = 0.7, 9.81


def door(drive: float) -> eg.Model:
    """A door on two hinges with one axis: no row of the loop is left."""
    m = eg.Model("door", gravity=(0, 0, -GRAVITY))
    leaf = m.body("leaf", mass=2, com=(0.5, 0, 0), inertia=(0.1, 0.2, 0.3))
    m.revolute("A", m.ground, leaf, coordinate="theta")
    m.revolute("B", m.ground.at(0, 0, 1), leaf.at(0, 0, 1), coordinate="phi", armature=drive)
    m.torque("motor", "A", 1.0)
    return m


@pytest.mark.parametrize("method", [*METHODS, "auto"])
@pytest.mark.parametrize("drive", [0.0, 5.0])
def test_drive_on_the_second_hinge_of_a_door(method: str, drive: float) -> None:
    module = door(drive).compile(method=method, target="numpy")
    theta_rate = module.rhs(0.0, np.array([0.3, 0.1]))[1]
    assert theta_rate == pytest.approx(1.0 / (0.3 + 2 * 0.5**2 + drive), rel=1e-14)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_drive_between_two_branches(method: str, target: str) -> None:
    m = eg.Model("rotors", gravity=(0, 0, 0))
    first, second = m.body("first", mass=1, inertia=(1, 1, 2)), m.body("second", mass=1, inertia=(2, 2, 3))
    m.revolute("A", m.ground, first, coordinate="q1")
    m.revolute("B", m.ground, second, coordinate="q2")
    m.revolute("C", first, second, armature=5)
    m.torque("motor", "A", 1.0)
    options = {"optimize": 0} if target == "cython" else {}
    module = m.compile(method=method, target=target, **options)
    expected = np.linalg.solve([[2 + 5, -5], [-5, 3 + 5]], [1, 0])  # J (q2' - q1')^2 / 2
    assert module.rhs(0.0, np.zeros(4))[2:] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("method", [*METHODS, "auto"])
def test_drives_in_an_open_chain_add_to_the_diagonal_of_the_mass_matrix(method: str) -> None:
    drives = np.array([0.7, 0.0, 1.3])

    def arm(scale: float) -> eg.Model:
        m = eg.Model("arm", gravity=(0, -GRAVITY, 0))
        last = m.ground
        for k, drive in enumerate(drives):
            body = m.body(f"b{k}", mass=2 - 0.3 * k, com=(0.5, 0.1, 0.03), inertia=(0.1, 0.2, 0.3))
            m.revolute(f"A{k}", last, body, axis="zxy"[k], coordinate=f"q{k}", armature=scale * drive)
            last = body.at(0.9, 0, 0)
        return m

    bare = arm(0.0).compile(method="embedding", target="numpy")
    x = np.array([0.4, -0.8, 1.1, 0.9, -1.3, 0.6])
    expected = np.linalg.solve(bare.mass_matrix(x[:3]) + np.diag(drives), -bare.bias(0.0, x))
    assert arm(1.0).compile(method=method, target="numpy").rhs(0.0, x)[3:] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_drive_on_a_slider_that_closes_a_loop(method: str) -> None:
    """Of a slider-crank, massless but for a crank and the drive: T = (I + J s'^2) theta'^2 / 2, s' = ds/dtheta."""
    r, l, inertia = 0.2, 0.5, 0.03
    m = eg.Model("press", gravity=(0, 0, 0))
    crank = m.body("crank", mass=0, inertia={"zz": inertia})
    rod, slider = m.body("rod", mass=0), m.body("slider", mass=0)
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(r, 0, 0), rod, coordinate="phi")
    m.revolute("C", rod.at(l, 0, 0), slider, coordinate="psi")
    m.prismatic("D", m.ground, slider, axis="x", armature=DRIVE)
    m.guess = {"theta": 0.8, "phi": -1.1, "psi": 0.3}
    module = m.compile(target="numpy", independent=["theta"], method=method)
    assert "D" not in module.q_names
    angle, rate, d = 0.8, 3.0, 1e-5
    angles = np.array([angle - d, angle, angle + d])
    slope = -r * np.sin(angles) - r**2 * np.sin(2 * angles) / (2 * np.sqrt(l**2 - (r * np.sin(angles)) ** 2))
    whole = inertia + DRIVE * slope[1] ** 2
    expected = -DRIVE * slope[1] * (slope[2] - slope[0]) / (2 * d) * rate**2 / whole
    x = module.x0({"theta": angle, "theta_dot": rate})
    assert module.rhs(0.0, x)[module.n_q + module.v_names.index("theta_dot")] == pytest.approx(expected, rel=1e-8)


# -- the same mechanism with a joint in the tree and with the joint cut ------------------------------------------------
FREE = [f"f_{k}" for k in ("x", "y", "z", "1", "2", "3")]
TURNED = (0.3, -0.4, 0.5)


def model(held: dict[str, Any] | None, closing: dict[str, Any] | None = None, *more: dict[str, Any]) -> eg.Model:
    """A body on a joint (or free, with joints closing loops to ground), and a second body that swings on it."""
    m = eg.Model("pair", gravity=(0.5, -9.81, 0.7))
    body = m.body("body", mass=1.3, com=(0.1, 0.2, -0.1), inertia=[[0.2, 0.01, 0.02], [0.01, 0.3, 0], [0.02, 0, 0.25]])
    arm = m.body("arm", mass=0.6, com=(0.3, 0, 0.05), inertia=(0.02, 0.05, 0.06))
    m.revolute("r", body.at(0.1, 0.3, 0.2, rpy=(0.4, 0.1, 0)), arm, coordinate="swing")
    base, end = m.ground.at(0.2, -0.1, 0.4, rpy=TURNED), body.at(-0.1, 0.05, 0.2, rpy=(-0.2, 0.3, 0.6))
    if held is None:
        m.free("f", m.ground, body, coordinates=FREE)
    for k, joint in enumerate([held] if held is not None else [closing, *more]):
        keys = dict(joint or {})
        m.joint(keys.pop("type"), f"j{k or ''}", base, end, **keys)
    for name, marker in (("body", body.at(0.3, 0.4, 0.5)), ("arm", arm.at(1, 0, 0))):
        for k, axis in enumerate("xyz"):
            m.output(f"{name}_{axis}", marker.position[k])
            m.output(f"{name}_v{axis}", marker.velocity[k])
            m.output(f"{name}_a{axis}", marker.acceleration[k])
    return m


def same_motion(minimal: eg.Module, x: np.ndarray, constrained: eg.Module, y: np.ndarray) -> None:
    """Positions, velocities and accelerations of points of both bodies agree."""
    a, b = minimal.outputs(0.0, x), constrained.outputs(0.0, y)
    names = list(minimal.y_names)
    rates = np.array([name.split("_")[1][0] == "a" for name in names])
    assert np.abs(a - b)[~rates].max() <= 1e-10
    assert np.abs(a - b)[rates].max() <= 1e-10 * np.abs(a[rates]).max()
    assert minimal.energy(x)[0] == pytest.approx(constrained.energy(y)[0], rel=1e-10)


CUTTABLE: list[dict[str, Any]] = [
    {"type": "revolute", "axis": "x"},
    {"type": "continuous"},
    {"type": "prismatic", "axis": [1, 2, -0.5]},
    {"type": "screw", "pitch": 0.3},
    {"type": "screw", "pitch": -0.4, "axis": "-y"},
    {"type": "cylindrical", "axis": "y"},
    {"type": "universal"},
    {"type": "universal", "axis": "x"},
    {"type": "constant_velocity"},
    {"type": "constant_velocity", "axis": "y"},
    {"type": "planar", "axis": "x"},
    {"type": "spherical", "sequence": "zxz"},
]


def test_a_joint_between_two_moving_arms_stays_closed() -> None:
    """Accelerations keep C' = 0, whose differences along the motion know of no Coriolis terms."""
    m, ends = eg.Model("arms", gravity=(0, 0, -9.81)), []
    for side, y in (("a", 0.1), ("b", -0.2)):
        ends.append(m.ground.at(0, y, 0))
        for k, axis in enumerate("xyz"):
            link = m.body(f"{side}{k}", mass=1.0, com=(0.2, 0, 0.1), inertia=(0.02, 0.03, 0.04))
            m.revolute(f"{side}_{axis}", ends[-1], link, axis=axis)
            ends[-1] = link.at(0.4, 0.1, 0.05, rpy=(0.3, -0.2, 0.1))
    m.cylindrical("close", *ends)
    mod = m.compile(target="numpy")
    x = mod.project(np.concatenate([mod.x0()[: mod.n_q], [2.0, -1.5, 3.0, 1.0, -2.5, 2.0]]))
    np.testing.assert_allclose(first(mod.velocity_constraints, x, mod.rhs(0.0, x)), 0.0, atol=1e-6)


CIRCLE = ["1.3*cos(j_s)", "1.3*sin(j_s)", 0]
SPHERE = ["1.3*cos(j_u)*cos(j_v)", "1.3*sin(j_u)*cos(j_v)", "1.3*sin(j_v)"]
PAIRS: list[tuple[dict[str, Any], list[dict[str, Any]]]] = [
    ({"type": "point_on_curve", "curve": CIRCLE}, [{"type": "revolute_spherical", "length": 1.3}]),
    ({"type": "point_on_curve", "curve": [0, 0, "2*j_s"]}, [{"type": "inline"}]),
    ({"type": "point_on_surface", "surface": SPHERE}, [{"type": "distance", "length": 1.3}]),
    ({"type": "point_on_surface", "surface": ["j_u + j_v", "j_v**3 + j_v", 0]}, [{"type": "inplane"}]),
    ({"type": "curve_slider", "curve": [0, 0, "j + j**3/3"]}, [{"type": "prismatic"}]),
    ({"type": "surface_slider", "surface": ["j_u", "j_v", 0]}, [{"type": "orientation"}, {"type": "inplane"}]),
    ({"type": "revolute"}, [{"type": "spherical"}, {"type": "parallel"}]),
    ({"type": "cylindrical"}, [{"type": "inline"}, {"type": "parallel"}]),
    ({"type": "planar"}, [{"type": "inplane"}, {"type": "parallel"}]),
    ({"type": "weld"}, [{"type": "spherical"}, {"type": "orientation"}]),
]


PAIRS += [(joint, [joint]) for joint in CUTTABLE]


def named(joint: dict[str, Any] | list[Any]) -> str:
    return f"{joint['type']}-{joint.get('axis', 'z')}" if isinstance(joint, dict) else joint[0]["type"]


@pytest.mark.parametrize(("joint", "constraints"), PAIRS, ids=named)
def test_joints_equal_the_constraints_they_imply(joint: dict[str, Any], constraints: list[dict[str, Any]]) -> None:
    """And the same joint that is cut: accelerations, and counts as in the book."""
    with_tree, loop, cut = model(joint), model(None, *constraints), constraints == [joint]
    forces = (("j_z", 1.3), ("j_3", -0.7)) if cut and joint["type"] == "cylindrical" else ()
    for coordinate, force in forces:
        for m in (with_tree, loop):
            m.actuator(f"along_{coordinate}", coordinate, value=force)
    tree, report = with_tree.compile(target="numpy"), loop.check()
    n = len(tree.q_names)
    assert report.degrees_of_freedom == n
    if cut:
        assert report.loop_joints == ["j"]
        assert (report.gruebler_kutzbach, report.constraints, report.rank) == (n, 7 - n, 7 - n)
    closed = [loop.compile(method, target="numpy") for method in (METHODS if forces else METHODS[:1])]
    random = np.random.default_rng(4)
    for _ in range(3):
        values = {name: float(random.uniform(0.2, 1.0)) for name in tree.q_names}
        values |= {f"{name}_dot": float(random.uniform(-2, 2)) for name in tree.q_names}
        x = tree.x0(**values)
        y = closed[0].x0(**values) if cut else closed[0].project(same_pose(tree, x, closed[0]))
        for one in closed:
            same_motion(tree, x, one, y)
        assert np.abs(closed[0].constraints(y[: closed[0].n_q])).max() < 1e-10


def same_pose(tree: eg.Module, x: np.ndarray, closed: eg.Module) -> np.ndarray:
    """The state of the constrained version in which its bodies are where the minimal version has them."""
    n = tree.n_q

    def free(q: np.ndarray) -> np.ndarray:
        pose = tree.poses(q)[0]
        R, r = pose[:3, :3], pose[:3, 3]
        angles = [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])]
        return np.array([*r, *angles])

    rates = first(free, x[:n], x[n:])
    values = dict(zip(FREE, free(x[:n]), strict=True)) | {"swing": x[tree.x_names.index("swing")]}
    values |= dict(zip([f"{n}_dot" for n in FREE], rates, strict=True))
    values["swing_dot"] = x[tree.x_names.index("swing_dot")]
    return np.array([values[name] for name in closed.x_names])
