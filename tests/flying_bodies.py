"""Free bodies in space whose contacts are judged, and the judges: slopes of the energy, depths by the energy."""

from typing import Any

import numpy as np

import eomgen as eg

STIFF = 2e4
ELASTIC = {"stiffness": STIFF}


def flying(count: int, gravity: Any = (0, 0, 0)) -> tuple[eg.Model, list[Any]]:
    m = eg.Model("flying", gravity=gravity)
    bodies = [m.body(f"b{k}", mass=1.0 + k, inertia=(0.01, 0.012, 0.015)) for k in range(count)]
    for k, body in enumerate(bodies):
        m.free(f"j{k}", m.ground, body, rotation="euler_parameters")
    return m, bodies


def state(mod: Any, places: Any, turns: Any) -> np.ndarray:
    """A state at rest with bodies at places, turned."""
    found = np.zeros(mod.n_x)
    for k, (place, turn) in enumerate(zip(places, turns, strict=True)):
        x, y, z, w = turn.as_quat()
        own = [i for i, name in enumerate(mod.q_names) if name.startswith(f"j{k}_")]
        found[own] = [*place, w, x, y, z]
    return found


def moved(mod: Any, x: np.ndarray, k: int, h: float) -> np.ndarray:
    """The state after the velocity of one number has acted for a short time."""
    v = np.zeros(mod.n_v)
    v[k] = 1.0
    speeds = np.concatenate([x[: mod.n_q], v])
    rate = mod.rhs(0.0, speeds)[: mod.n_q]
    return np.asarray(mod.project(np.concatenate([x[: mod.n_q] + h * rate, np.zeros(mod.n_v)])))


def check_slopes(mod: Any, x: np.ndarray) -> None:
    """The generalized forces are minus the slopes of the energy along the velocities."""
    h = 1e-6
    sides = [moved(mod, x, k, way * h) for way in (1, -1) for k in range(mod.n_v)]
    slopes = np.subtract(*mod.energy(np.array(sides).T)[1].reshape(2, -1)) / (2 * h)
    force = -mod.bias(0.0, x)
    np.testing.assert_allclose(force, np.negative(slopes), rtol=2e-4, atol=2e-4 * np.abs(force).max())


def depth_of(mod: Any, x: np.ndarray) -> float:
    return float((mod.energy(x)[1] * 2.5 / STIFF) ** 0.4)
