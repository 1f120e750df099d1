"""Rotations against scipy.spatial.transform, in numbers and in SymPy; rates near no rotation to the last digits."""

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import judges
import mpmath as mp
import numpy as np
import pinocchio
import pytest
import rotations
import sympy
from analysed import rssr
from models import IN_C, reference
from numpy.typing import NDArray
from refusals import refuses
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from shipped_robots import EXAMPLES
from sweeps import TARGETS

import eomgen as eg
from eomgen.elements import rotations as rot

# -- Conversions and rates ---------------------------------------------------------------------------------------------
SEQUENCES = ["".join(s) for s in product("xyz", repeat=3) if s[0] != s[1] and s[1] != s[2]]
HALF_TURNS = [np.pi * np.array(n) / np.linalg.norm(n) for n in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 2, -3], [0, 1, 1])]
SPECIAL = [np.zeros(3), np.array([1e-9, -2e-9, 0]), np.array([3e-3, 4e-3, 8e-3]), *HALF_TURNS]
GENERAL = list(Rotation.random(12, random_state=3).as_rotvec())
Way = Callable[..., np.ndarray]
LAMBDIFIED: dict[Any, Any] = {}


def numbers(function: Callable[..., Any], *arguments: Any) -> np.ndarray:
    """As NumPy does it."""
    return np.asarray(function(*arguments))


def _replaced(arguments: Any, symbol: Callable[[str], Any]) -> tuple[list[Any], dict[str, float]]:
    """Arguments with a symbol in place of every number, and the numbers."""
    values: dict[str, float] = {}

    def one(x: float) -> Any:
        values[f"x{len(values)}"] = float(x)
        return symbol(f"x{len(values) - 1}")

    made = []
    for given in arguments:
        if isinstance(given, str):
            made.append(given)
        elif np.ndim(given) == 0:
            made.append(one(given))
        else:
            flat = [one(x) for x in np.ravel(given)]
            width = np.shape(given)[-1]
            made.append(flat if np.ndim(given) == 1 else [flat[k : k + width] for k in range(0, len(flat), width)])
    return made, values


def symbols(function: Callable[..., Any], *arguments: Any) -> np.ndarray:
    """In SymPy, with the numbers put in afterwards."""
    made, values = _replaced(arguments, lambda name: sympy.Symbol(name, real=True))
    key = (function, repr(made))
    if key not in LAMBDIFIED:  # made once, however many numbers are put in
        result = function(*made)
        known = [sympy.Symbol(name, real=True) for name in values]
        LAMBDIFIED[key] = sympy.lambdify(known, list(result), "math", cse=True), result.shape
    call, shape = LAMBDIFIED[key]
    found = np.array(call(*values.values()), dtype=float)
    return found if shape[1] == 1 else found.reshape(shape)


WAYS = pytest.mark.parametrize("way", [numbers, symbols], ids=["numbers", "symbols"])


def close(a: np.ndarray, b: np.ndarray, within: float = 1e-14) -> None:
    assert np.shape(a) == np.shape(b)
    assert np.abs(a - b).max() <= within, (a, b)


@WAYS
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_euler_angles(way: Way, sequence: str) -> None:
    random = np.random.default_rng(1)
    for angles in random.uniform(-3, 3, (4, 3)):
        theirs = Rotation.from_euler(sequence.upper(), angles)
        R = theirs.as_matrix()
        close(way(rot.matrix_from_euler_angles, sequence, angles), R)
        e = way(rot.euler_parameters_from_euler_angles, sequence, angles)
        close(e * np.sign(e[0]), theirs.as_quat(canonical=True, scalar_first=True), 1e-14)
        back = way(rot.euler_angles_from_matrix, sequence, R)
        close((back - theirs.as_euler(sequence.upper()) + 1) % (2 * np.pi), np.ones(3), 1e-13)
        if way is not symbols:
            close(back, theirs.as_euler(sequence.upper()), 1e-13)


CASES = [(way, v) for way in (numbers,) for v in [*GENERAL[:4], *SPECIAL]]
CASES += [(symbols, v) for v in [*GENERAL[:2], np.array([3e-3, 4e-3, 8e-3])]]


@pytest.mark.parametrize(("way", "vector"), CASES)
def test_conversions(way: Way, vector: np.ndarray) -> None:
    theirs = Rotation.from_rotvec(vector)
    R, e = theirs.as_matrix(), theirs.as_quat(scalar_first=True)
    close(way(rot.matrix_from_rotation_vector, vector), R)
    close(way(rot.matrix_from_euler_parameters, e), R)
    ours = way(rot.euler_parameters_from_matrix, R)
    assert ours[0] >= 0
    close(ours * np.sign(ours @ e), e)
    close(way(rot.euler_parameters_from_rotation_vector, vector), e * np.sign(np.append(e[0], 1)[0] or 1), 1e-15)
    opposite = e if way is symbols else -e
    for back in (way(rot.rotation_vector_from_matrix, R), way(rot.rotation_vector_from_euler_parameters, opposite)):
        close(Rotation.from_rotvec(back).as_matrix(), R)
        assert np.linalg.norm(back) <= np.pi + 1e-15
    mrp = way(rot.modified_rodrigues_from_euler_parameters, e)
    close(Rotation.from_mrp(mrp).as_matrix(), R)
    close(
        Rotation.from_quat(
            way(rot.euler_parameters_from_modified_rodrigues, theirs.as_mrp()), scalar_first=True
        ).as_matrix(),
        R,
    )
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle else np.array([1.0, 0, 0])
    close(way(rot.matrix_from_axis_angle, axis, angle), R)
    close(Rotation.from_quat(way(rot.euler_parameters_from_axis_angle, axis, angle), scalar_first=True).as_matrix(), R)
    if angle < 3.1:
        g = way(rot.rodrigues_from_euler_parameters, e)
        close(g, axis * np.tan(angle / 2), 1e-12)
        close(way(rot.euler_parameters_from_rodrigues, g), e)


def test_tiny_rotation_vectors_keep_their_digits() -> None:
    for size in (1e-200, 1e-12, 1e-5, 9.99e-3, 1.001e-2, 0.0199, 0.0201):
        v = size * np.array([0.6, 0.0, -0.8])
        back = rot.rotation_vector_from_euler_parameters(rot.euler_parameters_from_rotation_vector(v))
        assert np.abs(back - v).max() <= 1e-15 * size


@WAYS
def test_quaternion_algebra(way: Way) -> None:
    for one, two in zip(GENERAL[:4], GENERAL[4:8], strict=True):
        a, b = Rotation.from_rotvec(one), Rotation.from_rotvec(two)
        e, f = a.as_quat(scalar_first=True), b.as_quat(scalar_first=True)
        close(
            Rotation.from_quat(way(rot.multiply_quaternions, e, f), scalar_first=True).as_matrix(), (a * b).as_matrix()
        )
        close(way(rot.multiply_quaternions, e, way(rot.conjugate_quaternion, e)), np.array([1.0, 0, 0, 0]))
        close(way(rot.normalize_quaternion, 3.0 * e), e)
        close(way(rot.turn_vector, e, np.array([0.3, -1.0, 2.0])), a.apply([0.3, -1.0, 2.0]))


def matrix_of(kind: str, values: np.ndarray, sequence: str) -> np.ndarray:
    """The rotation matrix of parameters, by SciPy (Euler parameters normalized, Rodrigues parameters through atan)."""
    if kind == "euler_angles":
        return Rotation.from_euler(sequence.upper(), values).as_matrix()
    if kind == "euler_parameters":
        return Rotation.from_quat(values, scalar_first=True).as_matrix()
    if kind == "rotation_vector":
        return Rotation.from_rotvec(values).as_matrix()
    if kind == "modified_rodrigues":
        return Rotation.from_mrp(values).as_matrix()
    return Rotation.from_quat([1.0, *values], scalar_first=True).as_matrix()


KINDS = [("euler_angles", s) for s in SEQUENCES] + [(kind, "xyz") for kind in rot.PARAMETERS[1:]]


@WAYS
@pytest.mark.parametrize(("kind", "sequence"), KINDS)
def test_angular_velocity(way: Way, kind: str, sequence: str) -> None:
    random, h = np.random.default_rng(2), 3e-4
    sizes = (1.0, 1e-3, 0.0) if kind not in ("euler_angles", "euler_parameters") else (1.0,)
    for size in sizes[:1] if way is symbols else sizes:
        p = size * random.uniform(0.2, 1.1, 4 if kind == "euler_parameters" else 3)
        rates = random.uniform(-2, 2, len(p))
        if kind == "euler_parameters":  # unit length, kept: e . e' = 0
            p = p / np.linalg.norm(p)
            rates -= (rates @ p) * p
        f = {i: matrix_of(kind, p + i * h * rates, sequence) for i in (-2, -1, 1, 2)}
        slope = (8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * h)
        R = matrix_of(kind, p, sequence)
        for axes, spin in (("body", R.T @ slope), ("ground", slope @ R.T)):
            expected = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            found = way(rot.angular_velocity, kind, p, rates, axes, sequence)
            close(found, expected, 1e-10)
            G = way(rot.velocity_matrix, kind, p, axes, sequence)
            inverse = way(rot.rate_matrix, kind, p, axes, sequence)
            close(G @ inverse, np.eye(3), 1e-13)
            close(inverse @ found, rates, 1e-8)


def test_symbols_give_textbook_forms() -> None:
    a, b, c = sympy.symbols("a b c")
    R = rot.matrix_from_euler_angles("zxz", [a, b, c])
    expected = sympy.rot_ccw_axis3(a) * sympy.rot_ccw_axis1(b) * sympy.rot_ccw_axis3(c)
    assert (R - expected).expand() == sympy.zeros(3, 3)
    # Shabana, Computational Dynamics, sec. 7.3: G-bar of the sequence z x z
    G = rot.velocity_matrix("euler_angles", [a, b, c], "body", "zxz")
    rows = "[[sin(b)*sin(c), cos(c), 0], [sin(b)*cos(c), -sin(c), 0], [cos(b), 0, 1]]"
    assert sympy.Matrix(sympy.sympify(rows)) == G
    e = sympy.symbols("e0:4")
    E = rot.velocity_matrix("euler_parameters", e, "ground")
    assert E[0, :] == sympy.Matrix([[-2 * e[1], 2 * e[0], -2 * e[3], 2 * e[2]]])
    assert rot.matrix_from_euler_parameters(sympy.Matrix(e))[0, 1] == 2 * e[1] * e[2] - 2 * e[0] * e[3]


def test_a_matrix_that_is_no_rotation_is_refused_with_its_determinant() -> None:
    for matrix, determinant in ((2 * np.eye(3), "8"), (np.diag([1.0, 1.0, -1.0]), "-1")):
        with pytest.raises(ValueError, match=f"not a rotation.* 1, which is {determinant}"):
            rot.euler_parameters_from_matrix(matrix)
    with pytest.raises(ValueError, match=r"not one of shape \(2, 2\)"):
        rot.rotation_vector_from_matrix(np.eye(2))


# -- Series of rates ---------------------------------------------------------------------------------------------------
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


@pytest.mark.parametrize("angle", [1e-8, 0.03, 0.0999, 0.1001, 1.7])
@pytest.mark.parametrize("axes", ["body", "ground"])
def test_rates_of_rotation_vectors(angle: float, axes: str) -> None:
    """I -+ (1 - cos a) / a^2 [v] + (a - sin a) / a^3 [v]^2 and its inverse (Shuster, 1993, eq. 278)."""
    v = angle * AXIS
    with mp.workdps(50):
        a = mp.sqrt(sum(mp.mpf(float(x)) ** 2 for x in v))
        x, y, z = (mp.mpf(float(c)) for c in v)
        tilde = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        sign = -1 if axes == "body" else 1
        exact = mp.eye(3) + sign * (1 - mp.cos(a)) / a**2 * tilde + (a - mp.sin(a)) / a**3 * (tilde * tilde)
        inverse = exact**-1
        pairs = [
            (rot.velocity_matrix("rotation_vector", v, axes), exact),
            (rot.rate_matrix("rotation_vector", v, axes), inverse),
        ]
        for found, expected in pairs:
            gap = max(abs(mp.mpf(float(found[i, j])) - expected[i, j]) for i in range(3) for j in range(3))
            assert gap <= (4e-16 if angle < 0.1 else 4e-15 / angle)  # quotients lose what cancels in them


# -- angular velocities and accelerations ------------------------------------------------------------------------------
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


DESCRIPTIONS = [("sequence: xyz", "lagrange"), ("sequence: yzy", "newton_euler"),
                ("rotation: euler_parameters", "embedding")]  # fmt: skip
LAWS = [(case, equation) for case in ("free", "closes") for equation in EQUATIONS]
LAWS += [("spherical", equation) for equation in EQUATIONS if equation.startswith("w")]


@pytest.mark.parametrize(("turning", "method"), DESCRIPTIONS)
@pytest.mark.parametrize(("case", "equation"), LAWS)
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


# -- euler parameters --------------------------------------------------------------------------------------------------
def free_body(rotation: str, inertia: tuple[float, float, float], sequence: str | None = None) -> eg.Model:
    m = eg.Model("thrown")
    b = m.body("b", mass=2.0, com=(0, 0, 0), inertia=inertia)
    m.free("f", m.ground, b, rotation=rotation, sequence=sequence)
    return m


def test_a_free_body_tumbles_as_jacobi_says() -> None:
    """torque_free_rigid_body.json: angular velocity by Jacobi's elliptic functions; energy and momentum are kept."""
    case = reference("torque_free_rigid_body")["reference"]["jacobi_start_w2_0"]
    w0 = [float(x) for x in case["omega0"]]
    module = free_body("euler_parameters", (1, 2, 3)).compile(target="numpy")
    start = {"f_wx": w0[0], "f_wy": w0[1], "f_wz": w0[2], "f_x_dot": 0.1}
    times = np.unique(np.concatenate([[1, 2, 5, 10], np.linspace(0, 100, 101)]))
    traj = module.simulate((0, 100), initial=start, t_eval=times, rtol=1e-13, atol=1e-14)
    w = np.array([traj[f"f_w{axis}"] for axis in "xyz"])
    for text, expected in case["omega"].items():
        k = int(np.flatnonzero(times == float(text))[0])
        np.testing.assert_allclose(w[:, k], [float(x) for x in expected], atol=1e-11)
    e = np.array([traj[f"f_e{k}"] for k in range(4)])
    np.testing.assert_allclose((e * e).sum(axis=0), 1.0, atol=1e-14)
    momentum = np.array([rotations.matrix(e[:, k]) @ ([1, 2, 3] * w[:, k]) for k in range(len(times))])
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * np.linalg.norm(momentum[0])
    assert traj.energy_drift < 1e-8


@pytest.mark.parametrize(("sequence", "method"), [("xyz", "embedding"), ("xyz", "lagrange"), ("zxz", "recursive")])
def test_euler_angles_stop_at_their_singularity_and_pass_by_it(sequence: str, method: str) -> None:
    """A ball spins about a fixed axis exactly through, and nearly through, the singular orientation at t = 1 s."""
    module = free_body("euler_angles", (0.4, 0.4, 0.4), sequence).compile(method=method, target="numpy")
    w = np.array([0.7, -0.5, 0.9])  # in body axes, constant
    middle = np.pi / 2 if len(set(sequence)) == 3 else 0.0
    for miss in (0.0, 1e-2):
        at_one = Rotation.from_euler(sequence.upper(), [0.3, middle + miss, 0.2])
        begin = (at_one * Rotation.from_rotvec(-w)).as_matrix()
        x = module.x0(angles(begin, w, sequence))
        if not miss:
            refuses("EG-STALLED f euler_parameters", module.simulate, (0, 2), initial=x, rtol=1e-10, atol=1e-12)
            continue
        traj = module.simulate((0, 2), initial=x, rtol=1e-11, atol=1e-12)
        end = module.poses(traj.x[: module.n_q, -1])[0, :3, :3]
        np.testing.assert_allclose(end, (at_one * Rotation.from_rotvec(w)).as_matrix(), atol=1e-7)
        assert traj.energy_drift < 1e-8


def angles(R: np.ndarray, w: np.ndarray, sequence: str) -> dict[str, float]:
    """Euler angles of a rotation and their rates for an angular velocity in body axes, by SciPy and differences."""
    here = Rotation.from_matrix(R).as_euler(sequence.upper())

    def turned(h: float) -> np.ndarray:
        later = (Rotation.from_matrix(R) * Rotation.from_rotvec(h * w)).as_euler(sequence.upper())
        return here + np.remainder(later - here + np.pi, 2 * np.pi) - np.pi

    h = 2e-3
    slopes = sum(c * (turned(k * h) - turned(-k * h)) for k, c in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1)) / h
    values = {f"f_{k + 1}": x for k, x in enumerate(here)}
    return values | {f"f_{k + 1}_dot": x for k, x in enumerate(slopes)}


def test_initial_values() -> None:
    module = free_body("euler_parameters", (1, 2, 3)).compile(target="numpy")
    np.testing.assert_array_equal(module.x0()[3:7], [1, 0, 0, 0])
    half = 0.3
    x = module.x0(f_e0=np.cos(half), f_e3=np.sin(half), f_z=2.0, f_wz=1.5)
    np.testing.assert_allclose(x, [0, 0, 2, np.cos(half), 0, 0, np.sin(half), 0, 0, 0, 0, 0, 1.5], atol=1e-15)
    assert np.linalg.norm(module.x0(f_e0=0.7071068, f_e1=0.7071068)[3:7]) == pytest.approx(1.0, abs=1e-15)
    refuses("EG-CONTRADICTION f_e0 0.5 1", module.x0, f_e0=0.5)
    refuses("EG-NAME-UNKNOWN f_wx", module.x0, f_e0_dot=0.5)
    refuses("EG-UNSUPPORTED f_wx", getattr, module, "minimal")
    refuses("EG-UNSUPPORTED minimal", module.kinematics, np.zeros(6))


def test_names_units_columns_and_expressions() -> None:
    m = free_body("euler_parameters", (1, 2, 3))
    m.output("twice", "2*f_e1_dot + f_wx + f_wy_dot")
    m.torque("drag", "b", ("-0.1*f_wx", 0, "0.2*f_e1"), axes="body")
    module = m.compile(target="numpy")
    assert module.q_names == ("f_x", "f_y", "f_z", "f_e0", "f_e1", "f_e2", "f_e3")
    assert module.v_names == ("f_x_dot", "f_y_dot", "f_z_dot", "f_wx", "f_wy", "f_wz")
    traj = module.simulate(1.0, initial={"f_wx": 1.0, "f_wy": 0.2, "f_wz": 0.3})
    assert traj.x_names == module.q_names + module.v_names
    expected = 2 * traj["f_e1_dot"] + traj["f_wx"] + traj["f_wy_dot"]
    np.testing.assert_allclose(traj["twice"], expected, atol=1e-12)
    e, w = (np.array([traj[n] for n in names]) for names in (module.q_names[3:], module.v_names[3:]))
    np.testing.assert_allclose(
        [traj[f"f_e{k}_dot"] for k in range(4)], np.array([rotations.rates(*p) for p in zip(e.T, w.T, strict=True)]).T
    )
    # Euler's equation of the first axis, from outside
    np.testing.assert_allclose(traj["f_wx_dot"], (2 - 3) * w[1] * w[2] - 0.1 * w[0], atol=1e-12)
    assert traj.units["f_wx"] == "rad/s"
    assert traj.units["f_wx_dot"] == "rad/s^2"
    assert "f_e0" not in traj.units
    assert traj.units["f_e0_dot"] == "1/s"


def stone(rotation: str = "euler_parameters", **keys: Any) -> eg.Model:
    m = eg.Model("stone", gravity=(0, 0, -9.81))
    m.free("f", m.ground, m.body("b", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(1, 2, 2.5)), rotation=rotation, **keys)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_no_rotation_and_no_number_are_named(target: str) -> None:
    module = stone().compile(target=target, **(IN_C if target == "cython" else {}))
    start = module.x0(f_wx=1.0)
    first = module.q_names.index("f_e0")
    for size in (0.0, 1e-170):
        x = np.array(start)
        x[first : first + 4] = size
        for call in (module.rhs, module.jacobian, lambda t, x: module.project(x)):
            refuses("EG-NOT-FINITE f_e0 f_e3 1", call, 0.0, x)
    x[first : first + 4] = [1e-30, 0, 0, 0]  # of any length but zero
    module.rhs(0.0, x)
    batch = np.stack([x, x], axis=1)
    batch[first, 1] = 0.0
    refuses("EG-NOT-FINITE f_e0 f_e3", module.rhs, 0.0, batch)
    for name, value in (("f_e2", np.nan), ("f_wy", np.inf)):
        x = np.array(start)
        x[module.x_names.index(name)] = value
        for call in (module.rhs, module.jacobian):
            refuses(f"EG-NOT-FINITE {name}", call, 0.0, x)
    x = np.array(start)
    x[0] = np.nan  # no acceleration depends on it
    refuses("EG-NOT-FINITE f_x", module.simulate, 1.0, initial=x)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda m: m.free("g", "ground", "b", rotation="quaternion"), "EG-CHOICE joints.g.rotation: euler_parameters"),
        (lambda m: m.torque("t", "f_e1", 1.0), "EG-REFERENCE forces.t.joint: 'f_e1' body"),
        (lambda m: m.initial(f_e0_dot=1.0), "EG-NAME-UNKNOWN initial.f_e0_dot: f_wx"),
        (lambda m: m.parameter("f_wx", 1.0), "EG-NAME-TAKEN joints.f: 'f_wx'"),
        (lambda m: m.initial(f_e0=0.9, f_e1=0.9), "EG-CONTRADICTION f_e0 0.9 1.27279"),
        (lambda m: m.independent("f_e0"), "EG-PARTITION independent: 'f_e0' f_wx"),
    ],
)
def test_faults_of_descriptions(change: Any, fault: str) -> None:
    m = stone()
    change(m)
    refuses(fault, m.check)


def loop(rotation: str) -> eg.Model:
    m = rssr(rotation)
    for k, axis in enumerate("xyz"):
        m.output(f"a{axis}", m.bodies["rod"].at(0.2, 0.1, 0.05).acceleration[k])
    return m


def as_parameters(angles: Any, parameters: Any, x: np.ndarray) -> np.ndarray:
    """A state of the model in Euler angles as one in Euler parameters, by poses and their rates."""
    named = dict(zip(angles.x_names, x, strict=True))

    def relative(q: np.ndarray) -> np.ndarray:
        crank, rod = angles.poses(q)[:2, :3, :3]
        return crank.T @ rod

    q, v, h = x[: angles.n_q], x[angles.n_q :], 1e-3
    R = relative(q)
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    R_dot = sum(c * (relative(q + k * h * v) - relative(q - k * h * v)) for k, c in enumerate(weights, 1)) / h
    W = R.T @ R_dot
    named |= {f"S_e{k}": y for k, y in enumerate(rotations.from_matrix(R))}
    named |= {"S_wx": W[2, 1], "S_wy": W[0, 2], "S_wz": W[1, 0]}
    return np.array([named[name] for name in parameters.x_names])


def test_loops_in_parameters_are_those_in_angles() -> None:
    """Outputs, energies and runs agree; accelerations are those of multipliers, the Jacobian that of differences."""
    angles, parameters = (loop(kind).compile(target="numpy") for kind in ("euler_angles", "euler_parameters"))
    by_lagrange = loop("euler_parameters").compile("lagrange", target="numpy", kernels=["rhs"])
    n = parameters.n_q
    for th, spin in ((0.3, 0.0), (-0.4, -3.0)):
        x = angles.x0(th=th, th_dot=5.0, S_1_dot=spin)
        y = as_parameters(angles, parameters, x)
        np.testing.assert_allclose(parameters.project(y), y, atol=1e-9)
        np.testing.assert_allclose(parameters.outputs(0.0, y), angles.outputs(0.0, x), rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(parameters.energy(y), angles.energy(x), rtol=1e-9)
        y = parameters.project(y)
        x_dot = parameters.rhs(0.0, y)
        np.testing.assert_allclose(by_lagrange.rhs(0.0, y), x_dot, rtol=0, atol=1e-9 * np.abs(x_dot).max())
        q_dot = rotations.coordinate_rates(parameters.metadata, y[:n], y[n:])
        np.testing.assert_allclose(x_dot[:n], q_dot, atol=1e-12)

        def rates(columns: np.ndarray, v: np.ndarray = y[n:]) -> np.ndarray:
            return np.einsum("ijk,j->ik", parameters.constraint_jacobian(columns, rows="all"), v)

        C_q, gamma = parameters.constraint_jacobian(y[:n], rows="all"), judges.first(rates, y[:n], q_dot)
        a = judges.augmented(parameters.mass_matrix(y[:n]), parameters.bias(0.0, y), C_q, gamma)
        np.testing.assert_allclose(x_dot[n:], a, atol=1e-8 * np.abs(a).max())
        J = parameters.jacobian(0.0, y)
        np.testing.assert_allclose(J, judges.differences(parameters, y, 1e-6), atol=3e-7 * np.abs(J).max())
        scaled = np.array(y)
        scaled[[name[-3:-1] == "_e" for name in parameters.x_names]] *= 1.7  # the length of e means nothing
        np.testing.assert_allclose(parameters.rhs(0.0, scaled)[n:], x_dot[n:], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(parameters.project(scaled), y, atol=1e-12)
    runs = [one.simulate(0.2, initial=start, rtol=1e-10, atol=1e-12) for one, start in ((angles, x), (parameters, y))]
    for name in ("th", "ph", "ax", "energy"):
        assert runs[1][name][-1] == pytest.approx(runs[0][name][-1], rel=1e-6, abs=1e-6)
    e = np.array([runs[1][f"T_e{k}"][-1] for k in range(4)])  # of the joint that was cut
    rod, rocker = parameters.poses(runs[1].x[:n, -1])[1:, :3, :3]
    np.testing.assert_allclose(rotations.matrix(e), rod.T @ rocker, atol=1e-10)
