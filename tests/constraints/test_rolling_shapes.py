"""Convex shapes that roll: an ellipsoid against points of its surface and a ball, an egg against its energy."""

from __future__ import annotations

import numpy as np
import pytest

import eomgen as eg

G = 9.81
X = {"f_e0": 0.9, "f_e1": 0.2, "f_e2": -0.3, "f_e3": np.sqrt(1 - 0.94), "f_x": 0.3, "f_y": -0.1}
SPIN = {"f_wx": 0.7, "f_wy": -1.1, "f_wz": 2.0}


def stone(com: tuple[float, float, float] = (0.0, 0.0, 0.01), at: float = 0.0, **shape: object) -> eg.Model:
    m = eg.Model("stone", gravity=(0.4, 0, -G))
    body = m.body("stone", mass=1.3, com=com, inertia=(2e-3, 3e-3, 4e-3))
    m.free("f", m.ground, body, rotation="euler_parameters")
    m.rolling("roll", body.at(0, 0, at), **shape)
    m.guess(f_z=0.2)
    return m


@pytest.mark.parametrize("target", ["numpy", "cython"])
@pytest.mark.parametrize(
    ("shape", "at"),
    [
        ({"shape": "ellipsoid", "semi_axes": (0.2, "r", 0.2)}, 0.0),
        ({"shape": "convex", "support": "r"}, 0.0),
        ({"shape": "convex", "support": "r + 0.05*nz"}, -0.05),  # a ball about another point
    ],
)
def test_a_round_one_is_a_ball(target: str, shape: dict[str, object], at: float) -> None:
    m, ball = stone(at=at, **shape), stone(shape="sphere", radius=0.2)
    m.parameter("r", 0.2)
    x = m.compile(target=target).x0(**X, **SPIN)
    other = ball.compile(target="numpy")
    assert x == pytest.approx(other.x0(**X, **SPIN), abs=1e-12)
    assert m.compile(target=target).rhs(0.0, x) == pytest.approx(other.rhs(0.0, x), abs=1e-9)


def surface(a: float, b: float, c: float) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 1500), np.linspace(0, np.pi, 800))
    return np.stack([a * np.cos(u) * np.sin(v), b * np.sin(u) * np.sin(v), c * np.cos(v)]).reshape(3, -1)


@pytest.mark.parametrize("support", ["ellipsoid", "sqrt((0.2*nx)**2 + (0.12*ny)**2 + (0.07*nz)**2)"])
def test_the_lowest_point_lies_on_the_plane_and_rests(support: str) -> None:
    """Of all points of the surface the lowest has height 0 and no velocity."""
    more = {"semi_axes": (0.2, 0.12, 0.07)} if support == "ellipsoid" else {"support": support}
    mod = stone(shape="ellipsoid" if support == "ellipsoid" else "convex", **more).compile(target="numpy")
    x = mod.x0(**X, **SPIN)
    pose = mod.poses(x[: mod.n_q])[0]
    points = pose[:3, :3] @ surface(0.2, 0.12, 0.07) + pose[:3, 3:]
    lowest = points[:, points[2].argmin()]
    assert lowest[2] == pytest.approx(0.0, abs=2e-6)
    v = dict(zip(mod.x_names, x, strict=True))
    turn = pose[:3, :3] @ [v["f_wx"], v["f_wy"], v["f_wz"]]
    speed = np.array([v["f_x_dot"], v["f_y_dot"], v["f_z_dot"]]) + np.cross(turn, lowest - pose[:3, 3])
    assert np.abs(speed).max() < 5e-3  # the nearest point of the grid
    run = mod.simulate(1.0, {**X, **SPIN}, rtol=1e-10, atol=1e-12)
    T, V = mod.energy(run.x)
    assert np.abs(T + V - T[0] - V[0]).max() < 1e-7 * T.max()
