"""Angular velocities and accelerations: closed forms, Pinocchio, Newton and Euler; equations of them that hold."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from shipped_robots import EXAMPLES

import eomgen as eg

NAMES = [f"w{axis}{suffix}" for suffix in ("", "_body", "_dot", "_body_dot") for axis in "xyz"]


def test_a_disc_that_spins_on_a_turning_arm(tmp_path: Path) -> None:
    """Turn Omega about z, spin sigma about e_r, both steady: w = Omega e_z + sigma e_r, w' = Omega sigma e_z x e_r."""
    m = eg.Model("spinner")
    arm = m.body("arm", mass=1, inertia=(1, 1, 1))
    disc = m.body("disc", mass=1, inertia=(1, 0.5, 0.5))
    m.revolute("turn", m.ground, arm)
    m.revolute("spin", arm, disc, axis="x")
    # own axes of the marker: x along -y of the arm, y along its x
    rim = arm.marker("rim", at=(0.3, 0, 0), rpy=(0, 0, -np.pi / 2))
    for name, handle in (("disc", disc), ("rim", rim)):
        for word, triple in (
            ("w", handle.angular_velocity), ("b", handle.body_angular_velocity),
            ("a", handle.angular_acceleration), ("c", handle.body_angular_acceleration),
        ):  # fmt: skip
            for axis, value in zip("xyz", triple, strict=True):
                m.output(f"{name}_{word}{axis}", value)
    m.output("still", m.ground.angular_velocity[0] + m.ground.angular_acceleration[2])
    mod = m.compile(target="numpy")
    phi, psi, omega, sigma = 0.4, 0.9, 1.3, 7.0
    x = mod.x0(turn=phi, spin=psi, turn_dot=omega, spin_dot=sigma)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))

    def triple(name: str) -> list[float]:
        return [y[name + axis] for axis in "xyz"]

    c, s = np.cos(phi), np.sin(phi)
    cp, sp = np.cos(psi), np.sin(psi)
    assert triple("disc_w") == pytest.approx([sigma * c, sigma * s, omega], abs=1e-14)
    assert triple("disc_b") == pytest.approx([sigma, omega * sp, omega * cp], abs=1e-14)
    assert triple("disc_a") == pytest.approx([-omega * sigma * s, omega * sigma * c, 0], abs=1e-13)
    assert triple("disc_c") == pytest.approx([0, omega * sigma * cp, -omega * sigma * sp], abs=1e-13)
    assert triple("rim_w") == triple("rim_b") == pytest.approx([0, 0, omega], abs=1e-14)
    assert y["still"] == 0.0
    path = tmp_path / "spinner.yaml"
    m.save(path)
    again = eg.load(path).compile(target="numpy")
    assert again.outputs(0.0, x) == pytest.approx(mod.outputs(0.0, x), abs=1e-15)


def test_a_robot_turns_as_pinocchio_says() -> None:
    path = EXAMPLES / "panda_description" / "urdf" / "panda.urdf"
    m = eg.load(path, lock=["panda_finger_joint1", "panda_finger_joint2"])
    for name in NAMES:
        m.output(name, f"{name}(panda_link6)")
    mod = m.compile(target="numpy")
    x = np.random.default_rng(3).uniform(-1, 1, mod.n_x)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    n = mod.n_q
    q, v, a = np.zeros((3, 9))
    q[:n], v[:n], a[:n] = x[:n], x[n:], mod.rhs(0.0, x)[n:]
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q, v, a)
    frame = model.getFrameId("panda_link6")
    axes = pinocchio.ReferenceFrame
    for suffix, frame_of in (("", axes.LOCAL_WORLD_ALIGNED), ("_body", axes.LOCAL)):
        velocity = pinocchio.getFrameVelocity(model, data, frame, frame_of).angular
        acceleration = pinocchio.getFrameAcceleration(model, data, frame, frame_of).angular
        assert [y[f"w{k}{suffix}"] for k in "xyz"] == pytest.approx(velocity, rel=1e-11)
        assert [y[f"w{k}{suffix}_dot"] for k in "xyz"] == pytest.approx(acceleration, rel=1e-11)


HELD = """
name: held
gravity: [0, 0, -9.81]
bodies: {{b: {{mass: 2, inertia: [0.1, 0.2, 0.3], markers: {{tip: {{at: [0.3, 0.1, -0.2]}}}}}}}}
joints: {{P: {{type: {joint}, between: [ground, b], {turning}}}}}
constraints: {{c: {{type: coupling, equation: "{equation}"{more}}}}}
"""
INERTIA, TIP, ON = np.diag([0.1, 0.2, 0.3]), np.array([0.3, 0.1, -0.2]), (0.3, 0.7)
Vector = NDArray[np.float64]
Row = tuple[Vector, float, float]  #: factors of the rates of (v, w), the rest, and the equation's value


def _turned(direction: Vector, w: Vector, value: float) -> Row:
    """An equation of w along a direction of ground or of the body, neither of which changes its value by turning."""
    return np.r_[np.zeros(3), direction], 0.0, direction @ w - value


def _moved(n: Vector, n_dot: Vector, r: Vector, v: Vector, w: Vector) -> Row:
    """n . (velocity of the tip) = 0."""
    speed = v + np.cross(w, r)
    return np.r_[n, np.cross(r, n)], n @ np.cross(w, np.cross(w, r)) + n_dot @ speed, n @ speed


EQUATIONS = {
    "wz(b) - 0.5": lambda R, v, w: _turned(np.array([0.0, 0.0, 1.0]), w, 0.5),
    "wx(b, in=b) - 0.5": lambda R, v, w: _turned(R[:, 0], w, 0.5),
    "wy_body(b) - 0.2*wz(b)": lambda R, v, w: _turned(R[:, 1] - 0.2 * np.eye(3)[2], w, 0.0),
    "vx(b.tip) - 0.4*vy(b.tip)": lambda R, v, w: _moved(np.array([1.0, -0.4, 0.0]), np.zeros(3), R @ TIP, v, w),
    "vz(b.tip, in=b)": lambda R, v, w: _moved(R[:, 2], np.cross(w, R[:, 2]), R @ TIP, v, w),
}


def _rate(equation: str | None, fixed: bool, y: Vector) -> Vector:
    """Newton's and Euler's equations of the body in ground axes, with multipliers; y is place, quaternion, v and w."""
    R, v, w = Rotation.from_quat(y[3:7]).as_matrix(), y[7:10], y[10:]
    own = R @ INERTIA @ R.T
    rows = [EQUATIONS[equation](R, v, w)[:2]] if equation else []
    rows += [(row, 0.0) for row in np.eye(6)[:3]] if fixed else []
    A, rest = np.array([row for row, _ in rows]).reshape(-1, 6), np.array([c for _, c in rows])
    K = np.block([[np.diag([2.0] * 3), np.zeros((3, 3)), A[:, :3].T], [np.zeros((3, 3)), own, A[:, 3:].T],
                  [A, np.zeros((len(rows), len(rows)))]])  # fmt: skip
    moved = np.linalg.solve(K, np.r_[0, 0, -2 * 9.81, -np.cross(w, own @ w), -rest])[:6]
    spin = 0.5 * np.r_[y[6] * w + np.cross(w, y[3:6]), -w @ y[3:6]]
    return np.r_[v, spin, moved]


def _led(equation: str | None, fixed: bool, y: Vector, span: float) -> Vector:
    found = solve_ivp(lambda t, y: _rate(equation, fixed, y), (0, span), y, rtol=1e-11, atol=1e-12, method="DOP853")
    return found.y[:, -1]


def _obeying(equation: str, y: Vector, metric: Vector) -> Vector:
    """The velocities that obey the equation, nearest by the metric (that of the mass: after an impact)."""
    row, _, value = EQUATIONS[equation](Rotation.from_quat(y[3:7]).as_matrix(), y[7:10], y[10:])
    push = np.linalg.solve(metric, row)
    return np.r_[y[:7], y[7:] - push * value / (row @ push)]


def _start(turning: str, y: Vector, free: bool) -> dict[str, float]:
    """The same state in the coordinates of the joint."""
    turn, v, w = Rotation.from_quat(y[3:7]), y[7:10], y[10:]
    found = dict(zip(("P_x_dot", "P_y_dot", "P_z_dot"), v, strict=True)) if free else {}
    if "parameters" in turning:
        found |= dict(zip(("P_e1", "P_e2", "P_e3", "P_e0"), y[3:7], strict=True))
        return found | dict(zip(("P_wx", "P_wy", "P_wz"), turn.as_matrix().T @ w, strict=True))
    sequence = turning.removeprefix("sequence: ").upper()
    angles = turn.as_euler(sequence)
    axes = [Rotation.from_euler(sequence[: k + 1], angles[: k + 1]).as_matrix()[:, "XYZ".index(sequence[k])]
            for k in range(3)]  # fmt: skip
    found |= dict(zip(("P_1", "P_2", "P_3"), angles, strict=True))
    return found | dict(zip(("P_1_dot", "P_2_dot", "P_3_dot"), np.linalg.solve(np.array(axes).T, w), strict=True))


WAYS = [("sequence: xyz", "lagrange"), ("sequence: yzy", "newton_euler"), ("rotation: euler_parameters", "embedding")]
CASES = [(case, equation) for case in ("free", "closes") for equation in EQUATIONS]
CASES += [("spherical", equation) for equation in EQUATIONS if equation.startswith("w")]


@pytest.mark.parametrize(("turning", "method"), WAYS)
@pytest.mark.parametrize(("case", "equation"), CASES)
def test_an_equation_of_angular_velocities_holds(
    case: str, equation: str, turning: str, method: str, tmp_path: Path
) -> None:
    """For good and for a time, whatever the coordinates and the method: the motion is that of Newton and Euler."""
    fixed, passing = case == "spherical", case == "closes"
    y = np.r_[np.zeros(3), Rotation.from_euler("XYZ", [0.3, 0.4, 0.5]).as_quat(), [0.2, -0.5, 0.3], [0.7, -0.4, 0.9]]
    y[7:10] *= not fixed
    if not passing:
        y = _obeying(equation, y, np.diag([1e9] * 3 + [1.0] * 3) if fixed else np.eye(6))
    more = f", closes: {ON[0]} - t, opens: {ON[1]} - t" if passing else ""
    path = tmp_path / "held.yaml"
    text = HELD.format(joint="spherical" if fixed else "free", turning=turning, equation=equation, more=more)
    text += "outputs:\n" + "".join(f"  {n}{k}: {n}{k}(b)\n" for n in "vw" for k in "xyz") + f"  left: {equation}\n"
    path.write_text(text, encoding="utf-8")
    mod = eg.load(path).compile(target="numpy", method=method)
    run = mod.simulate(1.0, initial=_start(turning, y, not fixed), rtol=1e-10, atol=1e-11)
    if passing:
        before = _led(None, fixed, y, ON[0])
        R = Rotation.from_quat(before[3:7]).as_matrix()
        mass = np.block([[2 * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), R @ INERTIA @ R.T]])
        end = _led(None, fixed, _led(equation, fixed, _obeying(equation, before, mass), ON[1] - ON[0]), 1.0 - ON[1])
    else:
        end = _led(equation, fixed, y, 1.0)
    held = (run.t > ON[0] + 1e-9) & (run.t < ON[1] - 1e-9) if passing else run.t >= 0
    assert np.abs(run["left"][held]).max() < 1e-9
    velocities = [run[f"{n}{k}"][-1] for n in "vw" for k in "xyz"]
    assert velocities == pytest.approx(end[7:], abs=1e-8)


@pytest.mark.parametrize("turning", ["euler_angles", "euler_parameters"])
@pytest.mark.parametrize("closes", [None, "0.2 - t"])
def test_an_angular_velocity_follows_an_input(turning: str, closes: str | None) -> None:
    """The equation needs the rate of the input, for a time as for good."""
    m = eg.Model("led")
    b = m.body("b", mass=2, inertia=(0.1, 0.2, 0.3))
    m.free("P", m.ground, b, rotation=turning)
    m.input("u", 0.5)
    m.coupling("c", equation="wz(b) - u", **({} if closes is None else {"closes": closes}))
    m.output("w", "wz(b)")
    run = m.compile(target="numpy").simulate(1.0, inputs={"u": "0.5 + sin(2*t)"})
    held = run.t > (0.0 if closes is None else 0.2 + 1e-9)
    assert np.abs(run["w"] - 0.5 - np.sin(2 * run.t))[held].max() < 1e-8
