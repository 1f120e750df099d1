"""The Carvallo-Whipple bicycle, of examples/bicycle.yaml and with a free frame, against what is published of it."""

from collections.abc import Callable
from functools import cache
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg

LINEAR = models.reference("bicycle_benchmark_linear")
NONLINEAR = models.reference("bicycle_basu_mandal_accelerations")
OWN = {key: np.array(rows, dtype=float) for key, rows in LINEAR["own_20_digits"].items()}
PUBLISHED = {key: np.array(rows, dtype=float) for key, rows in LINEAR["published"].items()}
G, REAR = (LINEAR["parameters_SI"][key] for key in ("g", "rR"))
STILL = dict.fromkeys(["x", "y", "yaw", "lean", "steer", "rear", "front", "lean_dot", "steer_dot"], 0.0)
METHODS = ["embedding", "lagrange"]


def free_bicycle() -> eg.Model:
    """The same with a free frame and two wheels that roll on the ground; both heights are constraints."""
    mod = models.build("bicycle").compile(target="numpy", kernels=["rhs"])
    p = dict(zip(mod.p_names, mod.p.tolist(), strict=True))
    free = eg.Model("free_bicycle", gravity=(0, 0, p["g"]))

    def tensor(body: str) -> dict[str, float]:
        return {key: p[f"I_{body}{key}"] for key in ("xx", "yy", "zz", "xz")}

    # origins at the hub of the rear wheel and where the steering axis meets the ground
    frame = free.body("frame", mass=p["m_B"], com=(p["x_B"], 0, p["z_B"] + p["r_R"]), inertia=tensor("B"))
    fork = free.body("fork", mass=p["m_H"], com=(p["x_H"] - p["w"] - p["c"], 0, p["z_H"]), inertia=tensor("H"))
    rear = free.body("rear_wheel", mass=p["m_R"], inertia=(p["I_Rx"], p["I_Ry"], p["I_Rx"]))
    front = free.body("front_wheel", mass=p["m_F"], inertia=(p["I_Fx"], p["I_Fy"], p["I_Fx"]))
    tilted, axle = (0, p["tilt"], 0), (-np.pi / 2, 0, 0)
    names = ["X", "Y", "Z", "yaw", "lean", "pitch"]
    free.free("pose", free.ground, frame, sequence="zxy", coordinates=names)
    free.revolute("steer", frame.at(p["w"] + p["c"], 0, p["r_R"], rpy=tilted), fork.at(0, 0, 0, rpy=tilted))
    free.revolute("rear", frame, rear, axis="y")
    free.revolute("front", fork.at(-p["c"], 0, -p["r_F"]), front, axis="y")
    ground = free.ground.at(0, 0, 0, rpy=(np.pi, 0, 0))
    free.rolling("rear_roll", rear.at(0, 0, 0, rpy=axle), ground, radius=p["r_R"])
    free.rolling("front_roll", front.at(0, 0, 0, rpy=axle), ground, radius=p["r_F"])
    free.independent("lean", "steer", "rear")
    free.guess(Z=-p["r_R"])
    return free


@cache
def free_module(method: str) -> Any:
    return free_bicycle().compile(method=method, target="numpy")


def upright(mod: Any, v: float) -> np.ndarray:
    return np.asarray(mod.x0(STILL, rear_dot=-v / REAR))


def linear(mod: Any, v: float) -> Any:
    return mod.linearize(upright(mod, v))


def close(found: np.ndarray, expected: np.ndarray, digits: float = 1e-11) -> None:
    assert np.abs(found - expected).max() <= digits * np.abs(expected).max()


def eigenvalues(v: int) -> np.ndarray:
    return np.array([complex(float(re), float(im)) for re, im in LINEAR["eigenvalues_by_speed"][str(v)]])


@pytest.mark.parametrize("method", METHODS)
def test_canonical_matrices(module: Callable[..., Any], method: str) -> None:
    """M q'' + v C1 q' + (g K0 + v^2 K2) q = 0 for lean and steer, at every whole speed from 0 to 10 m/s."""
    mod = module("bicycle", method)
    M, C, K = linear(mod, 0.0).second_order("lean", "steer")
    for reference in (OWN, PUBLISHED):
        close(M, reference["M"])
        close(K / G, reference["K0"])
    assert np.abs(C).max() <= 1e-12
    for v in range(1, 11):
        found = linear(mod, v)
        assert found.is_steady
        M, C, K = found.second_order("lean", "steer")
        for reference in (OWN, PUBLISHED):
            close(M, reference["M"])
            close(C / v, reference["C1"])
            close((K - G * reference["K0"]) / v**2, reference["K2"])


@pytest.mark.parametrize("method", METHODS)
def test_eigenvalues_from_0_to_10_metres_per_second(module: Callable[..., Any], method: str) -> None:
    mod = module("bicycle", method)
    for v in range(11):
        expected = eigenvalues(v)
        found = linear(mod, v)
        assert found.states[:2] == ("lean", "steer")
        four = [found.states.index(name) for name in ("lean", "steer", "lean_dot", "steer_dot")]
        close(np.sort_complex(np.linalg.eigvals(found.A[np.ix_(four, four)])), np.sort_complex(expected))
        # among those of all: place, heading, speed and wheel angles add zeros, constraints nothing
        assert len(found.eigenvalues) == 7 + 3
        close(np.array([found.eigenvalues[np.abs(found.eigenvalues - z).argmin()] for z in expected]), expected)
        assert (np.abs(found.eigenvalues) < 1e-6).sum() == 6


def test_critical_speeds(module: Callable[..., Any]) -> None:
    """Weave and capsize: a pair crosses the imaginary axis, a real one crosses zero; between them it is stable."""
    mod = module("bicycle", target="numpy")
    speeds = {key: float(value) for key, value in LINEAR["critical_speeds"].items()}
    weave, capsize = speeds["v_weave"], speeds["v_capsize"]
    values = linear(mod, weave).eigenvalues
    pair = values[np.abs(values.imag) > 1.0]
    assert len(pair) == 2
    assert np.abs(pair.real).max() < 1e-11 * np.abs(values).max()
    _, _, K = linear(mod, capsize).second_order("lean", "steer")
    assert abs(np.linalg.det(K)) < 1e-11 * np.abs(K).max() ** 2
    values = linear(mod, speeds["v_double_root"]).eigenvalues
    right = values[values.real > 1.0]
    assert len(right) == 2
    assert abs(right[0] - right[1]) < 1e-5  # a double root moves as the square root of rounding
    verdicts = [linear(mod, v).stability for v in (weave - 1e-3, weave + 1e-3, capsize - 1e-3, capsize + 1e-2)]
    assert verdicts == ["unstable", "marginal", "marginal", "unstable"]  # at best marginal: it may go anywhere


def basu_mandal() -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Given, following and accelerations of the published state in our coordinates (mapping in the file)."""
    s, a = NONLINEAR["input"], NONLINEAR["reference_published"]
    given = {
        "x": 0.0, "y": 0.0, "yaw": -s["theta"], "lean": np.pi / 2 - s["psi"], "steer": -s["psif"], "rear": 0.0,
        "front": 0.0, "lean_dot": -s["psid"], "steer_dot": -s["psifd"], "rear_dot": -s["betard"],
    }  # fmt: skip
    following = {
        "pitch": np.pi - s["phi"], "Z": -s["z"], "yaw_dot": -s["thetad"], "pitch_dot": -s["phid"],
        "front_dot": -s["betafd"], "X_dot": -s["xd"], "Y_dot": s["yd"], "Z_dot": -s["zd"],
    }  # fmt: skip
    accelerations = {
        "X_ddot": -a["xdd"], "Y_ddot": a["ydd"], "Z_ddot": -a["zdd"], "yaw_ddot": -a["thetadd"],
        "lean_ddot": -a["psidd"], "pitch_ddot": -a["phidd"], "steer_ddot": -a["psifdd"], "rear_ddot": -a["betardd"],
        "front_ddot": -a["betafdd"],
    }  # fmt: skip
    return given, following, accelerations


def values(mod: Any, x: np.ndarray) -> dict[str, float]:
    """Coordinates, velocities, accelerations and outputs by name."""
    n = mod.n_q
    found = dict(zip(mod.x_names, x, strict=True)) | dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    return found | {f"{name[:-4]}_ddot": a for name, a in zip(mod.v_names, mod.rhs(0.0, x)[n:], strict=True)}


@cache
def measured(method: str) -> Any:
    """The example with the motion of the rear wheel's centre among its outputs, named as in the free description."""
    m = models.build("bicycle")
    for axis in "xyz":
        for prefix, suffix in (("", ""), ("v", "_dot"), ("a", "_ddot")):
            m.output(f"{axis.upper()}{suffix}", f"{prefix}{axis}(rear_wheel)")
    return m.compile(method=method, target="numpy")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("description", [measured, free_module])
def test_accelerations_of_basu_mandal(description: Callable[[str], Any], method: str) -> None:
    mod = description(method)
    given, following, accelerations = basu_mandal()
    if description is free_module:
        given = {name: value for name, value in given.items() if name not in ("x", "y")} | {"X": 0.0, "Y": 0.0}
    found = values(mod, mod.x0(given))
    assert max(abs(found[name] - value) for name, value in following.items()) < 2e-13
    assert set(accelerations) <= set(found)
    for name, value in accelerations.items():
        assert abs(found[name] - value) <= 2e-12, name


def test_two_descriptions_move_alike() -> None:
    """Far from upright, at random: 8 coordinates and 5 equations, or 9 and 6."""
    random, one, other = np.random.default_rng(4), measured("embedding"), free_module("embedding")
    for _ in range(6):
        start = {name: random.uniform(-0.8, 0.8) for name in ("yaw", "lean", "steer", "rear", "front")}
        start |= {f"{name}_dot": random.uniform(-2.0, 2.0) for name in ("lean", "steer")}
        start["rear_dot"] = random.uniform(-30.0, -5.0)
        a = values(one, one.x0(start, x=0.3, y=-0.2))
        b = values(other, other.x0(start, X=a["X"], Y=a["Y"]))
        for suffix, digits in (("", 1e-12), ("_dot", 1e-11), ("_ddot", 1e-10)):
            names = [n + suffix for n in ("X", "Y", "Z", "yaw", "lean", "pitch", "steer", "rear", "front")]
            close(np.array([a[n] for n in names]), np.array([b[n] for n in names]), digits)


def test_wheels_press_on_the_ground() -> None:
    """Multipliers of the heights, upright at rest (the loads that brim's tests of this bicycle have)."""
    mod = free_module("embedding")
    x = mod.x0(dict.fromkeys(("X", "Y", "yaw", "lean", "steer", "rear", "front"), 0.0))
    C_q = mod.constraint_jacobian(x[: mod.n_q])
    h = mod.bias(0.0, x)
    loads = np.linalg.lstsq(C_q.T, h, rcond=None)[0]
    assert np.abs(C_q.T @ loads - h).max() < 1e-10  # an equilibrium, unstable as it is
    up = np.abs(C_q[:, mod.q_names.index("Z")] * loads)  # of a unit lift of both wheels
    np.testing.assert_allclose(np.sort(up[up > 1e-6]), [309.303529411765, 612.836470588236], rtol=1e-12)


def test_it_rights_itself_between_weave_and_capsize(module: Callable[..., Any]) -> None:
    mod = module("bicycle", target="cython")
    start = upright(mod, 4.6)
    start[mod.x_names.index("lean_dot")] = 0.5
    run = mod.simulate((0, 10), mod.project(start), rtol=1e-10, atol=1e-12)
    assert np.ptp(run["lean"]) > 0.1
    late = run.t > 8.0
    for name in ("lean", "steer", "lean_dot", "steer_dot"):
        assert np.abs(run[name][late]).max() < 0.1 * np.abs(run[name]).max(), name
    T, V = mod.energy(run.x)
    assert np.abs(T + V - T[0] - V[0]).max() <= 1e-9 * T.max()
    assert run.residuals.position < 1e-10
    assert run.residuals.velocity < 1e-10
    assert run["yaw"][-1] != 0.0  # it goes on straight, in another direction
    assert run["x_dot"][-1] ** 2 + run["y_dot"][-1] ** 2 > 4.6**2  # what lean and steer lose goes into speed
