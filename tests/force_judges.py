"""Judges of force elements: wrenches and twists made in NumPy, differences of rhs, the faults that a model reports."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import judges
import numpy as np
import pytest
from models import rotation

import eomgen as eg

TREE_METHODS = ("embedding", "lagrange", "recursive", "augmented", "newton_euler", "amalgamated", "gibbs_appell")


def problems(model: eg.Model) -> dict[str, str]:
    """What is wrong with a model: path -> message and remedy."""
    with pytest.raises(eg.ModelError) as error:
        model.derive()
    return {p.path: f"{p.message}; {p.remedy}" for p in error.value.problems}


def read_back(model: eg.Model, folder: Path) -> eg.Model:
    """The model that its file gives."""
    (folder / "written.yaml").write_text(model.to_yaml(), encoding="utf-8")
    return eg.load(folder / "written.yaml")


#: Two bodies in free flight with a force element between markers of them.
P = {"at": (0.2, -0.1, 0.15), "rpy": (0.3, -0.4, 0.7)}
Q = {"at": (-0.1, 0.25, 0.05), "rpy": (-0.2, 0.5, -0.6)}
INERTIAS = ([0.12, 0.2, 0.17], [0.3, 0.25, 0.4])
CENTERS = ((0.05, 0.02, -0.03), (-0.04, 0.06, 0.01))
MASSES = (1.3, 2.1)


class Wrench(NamedTuple):
    """A force (N) on a body (0 or 1, -1 for ground) at a point of space, and a torque, ground axes."""

    body: int
    point: np.ndarray
    force: np.ndarray
    torque: Any = (0.0, 0.0, 0.0)


class Seen(NamedTuple):
    """A marker in motion: axes, origin, velocity of the origin, angular velocity, ground axes."""

    R: np.ndarray
    r: np.ndarray
    v: np.ndarray
    w: np.ndarray


Judge = Callable[[Seen, Seen, judges.Bodies, float], Sequence[Wrench]]


def flyers(add: Callable[[eg.Model, Any, Any], None] | None = None) -> eg.Model:
    """Two free bodies with markers a.P and b.Q, and what ``add`` adds."""
    m = eg.Model("flyers")
    m.parameter("k", 30.0), m.parameter("c", 1.5)
    m.input("u", 0.4)
    handles = []
    for name, marker, mass, center, inertia in zip("ab", (P, Q), MASSES, CENTERS, INERTIAS, strict=True):
        body = m.body(name, mass=mass, com=center, inertia=inertia)
        m.free(f"j{name}", m.ground, body)
        handles.append(body.marker("P" if name == "a" else "Q", **marker))
    if add is not None:
        add(m, *handles)
    return m


def see(bodies: judges.Bodies, body: int, marker: dict[str, Any]) -> Seen:
    """A marker of a body."""
    r, v, _ = bodies.point(body, marker["at"])
    return Seen(bodies.R[body] @ rotation(marker["rpy"]), r, v, bodies.w[body])


def generalized(bodies: judges.Bodies, wrenches: Sequence[Wrench]) -> np.ndarray:
    """Generalized forces of wrenches."""
    total = np.zeros(bodies.J_r.shape[-1])
    for body, point, force, torque in wrenches:
        if body >= 0:
            J = bodies.J_r[body] + np.cross(bodies.J_w[body].T, point - bodies.r[body]).T
            total += J.T @ force + bodies.J_w[body].T @ np.asarray(torque)
    return total


def power(bodies: judges.Bodies, wrenches: Sequence[Wrench]) -> float:
    """Wrench . twist, summed."""
    total = 0.0
    for body, point, force, torque in wrenches:
        if body >= 0:
            v = bodies.v[body] + np.cross(bodies.w[body], point - bodies.r[body])
            total += float(force @ v + np.asarray(torque) @ bodies.w[body])
    return total


def judge(
    add: Callable[[eg.Model, Any, Any], None],
    loads: Judge,
    lost: Judge | None,
    states: Sequence[np.ndarray],
    folder: Path,
    digits: float = 1e-9,
) -> None:
    """Check an element at states of the two bodies.

    Its generalized forces against those of ``loads``, by both methods; the rate of the energy against the power of the
    ``lost`` part of the loads, all of them if None; the Jacobian against differences; the model against its file.
    """
    model = flyers(add)
    bare = flyers().compile(target="numpy")
    modules = [model.compile(method=method, target="numpy") for method in ("embedding", "lagrange")]
    again = read_back(model, folder).compile(target="numpy")
    t = 0.3
    for x in states:
        n = bare.n_q
        bodies = judges.Bodies(bare, x[:n], x[n:])
        markers = see(bodies, 0, P), see(bodies, 1, Q)
        wrenches = loads(*markers, bodies, t)
        expected = generalized(bodies, wrenches)
        size = max(1e-3, np.abs(expected).max())
        for mod in modules:
            found = bare.bias(t, x) - mod.bias(t, x)
            assert np.abs(found - expected).max() <= digits * size
            rate = judges.first(lambda c, mod=mod: np.sum(mod.energy(c), axis=0), x, mod.rhs(t, x), h=2e-4)
            given = power(bodies, wrenches if lost is None else lost(*markers, bodies, t))
            assert abs(rate - given) <= 1e-8 * max(1.0, abs(power(bodies, wrenches)), np.sum(mod.energy(x)))
            slopes = judges.fine_differences(mod, x, 1e-4, t)
            assert np.abs(mod.jacobian(t, x) - slopes).max() <= 1e-7 * np.abs(slopes).max()
        np.testing.assert_array_equal(again.rhs(t, x), modules[0].rhs(t, x))


def states(seed: int, count: int, reach: float = 0.6, speed: float = 1.0, turn: float = 0.5) -> list[np.ndarray]:
    """Random states: body b about (reach, 0, 0) from body a."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        x = random.uniform(-turn, turn, 24)
        x[:3], x[6:9] = random.uniform(-0.1, 0.1, (2, 3))
        x[6] += reach
        x[12:] *= speed / turn
        found.append(x)
    return found


def wong(z: Any, deepest: Any, k: float, n: float, rebound: float = 0.1) -> Any:
    """Pressure of soil at a depth below the greatest one so far; Wong's unloading and reloading by one line."""
    z = np.maximum(z, 0.0)
    most = np.maximum(np.maximum(z, deepest), 1e-12)
    top = k * most**n
    return np.where(z > 0, np.maximum(top - top / (rebound * most) * (most - z), 0.0), 0.0)
