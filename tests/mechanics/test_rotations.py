"""Rotations against scipy.spatial.transform, in numbers and in SymPy; rates near no rotation to the last digits."""

from collections.abc import Callable
from itertools import product
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation

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
    assert (
        sympy.Matrix(
            [
                [sympy.sin(b) * sympy.sin(c), sympy.cos(c), 0],
                [sympy.sin(b) * sympy.cos(c), -sympy.sin(c), 0],
                [sympy.cos(b), 0, 1],
            ]
        )
        == G
    )
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
