"""A robot against its judge: what the judge says of a state, and the largest differences over random states."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from model_files import described
from scipy.spatial.transform import Rotation

KERNELS = ["mass_matrix", "bias", "inverse_dynamics", "rhs", "poses", "centroidal"]


@dataclass(frozen=True)
class State:
    """One state, and what a judge says of it; damping of joints is added to its numbers."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    mass_matrix: np.ndarray
    bias: np.ndarray
    inverse_dynamics: np.ndarray
    acceleration: np.ndarray
    frames: dict[str, np.ndarray]
    com: np.ndarray
    u: dict[str, float]  #: inputs; ``tau`` is what they make


def angle_rates(angles: np.ndarray) -> np.ndarray:
    """E with omega (body axes) = E angles' for R = Rx Ry Rz; angles may be complex."""
    _, b, c = angles
    return np.array(
        [[np.cos(b) * np.cos(c), np.sin(c), 0], [-np.cos(b) * np.sin(c), np.cos(c), 0], [np.sin(b), 0, 1]],
        dtype=angles.dtype,
    )


def angle_rates_slope(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """E', by a complex step."""
    return angle_rates(angles + 1e-30j * rates).imag / 1e-30


def draw_parameters(random: np.random.Generator) -> np.ndarray:
    """Euler parameters of any turn, of a length other than one, which must not matter."""
    e = random.normal(size=4)
    return e / np.linalg.norm(e) * random.uniform(0.5, 2.0)


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference, of the largest entry."""
    return float(np.abs(ours - theirs).max(initial=0.0) / max(np.abs(theirs).max(initial=0.0), 1e-12))


class Compiled:
    """A robot's equations, compiled or as functions of NumPy, called state by state."""

    def __init__(self, equations: Any, target: str = "cython", **options: Any) -> None:
        self.module = equations.compile(target, kernels=KERNELS, **options)
        self.body_names = self.module.body_names

    def __call__(self, states: list[State]) -> list[dict[str, np.ndarray]]:
        return [self._at(s) for s in states]

    def _at(self, s: State) -> dict[str, np.ndarray]:
        m = self.module
        u = np.array([s.u[name] for name in m.u_names])
        still, x = np.zeros(m.n_u), np.concatenate([s.q, s.v])
        return {
            "M": m.mass_matrix(s.q),
            "h": m.bias(0.0, x, u=still),
            "inverse": m.inverse_dynamics(s.q, s.v, s.a, u=still),
            "forward": m.rhs(0.0, x, u=u)[m.n_q :],
            "poses": m.poses(s.q),
            "com": m.center_of_mass(s.q),
        }


def largest_differences(model: Any, run: Any, states: list[State]) -> dict[str, float]:
    """Per quantity, of the largest entry; of accelerations also by max(1, cond(M)/1e3).

    Those of ``scaled`` names once more with each coordinate measured by the root of its inertia, so that light joints
    count as much as heavy ones, and the much smaller condition of M in that measure.
    """
    frames = link_frames(model)
    worst: dict[str, float] = {}
    for s, ours in zip(states, run(states), strict=True):
        condition = max(1.0, np.linalg.cond(s.mass_matrix) / 1e3)
        size = np.sqrt(s.mass_matrix.diagonal())
        scaled = s.mass_matrix / np.outer(size, size)
        found = {
            "M": difference(ours["M"], s.mass_matrix),
            "h": difference(ours["h"], s.bias),
            "inverse": difference(ours["inverse"], s.inverse_dynamics),
            "forward": difference(ours["forward"], s.acceleration) / condition,
            "scaled M": difference(ours["M"] / np.outer(size, size), scaled),
            "scaled h": difference(ours["h"] / size, s.bias / size),
            "scaled forward": difference(ours["forward"] * size, s.acceleration * size)
            / max(1.0, np.linalg.cond(scaled) / 1e3),
            "com": float(np.abs(ours["com"] - s.com).max()),
            "frames": 0.0,
        }
        assert all(np.isfinite(x).all() for x in ours.values())
        assert set(s.frames) <= set(frames)
        for link in s.frames:
            body, at = frames[link]
            pose = at if body is None else ours["poses"][run.body_names.index(body)] @ at
            found["frames"] = max(found["frames"], float(np.abs(pose - s.frames[link]).max()))
        worst = {name: max(worst.get(name, 0.0), value) for name, value in found.items()}
    return worst


def link_frames(model: Any) -> dict[str, tuple[str | None, np.ndarray]]:
    """Link of the file -> our body (None for ground) and the frame in it (4, 4), read from the model file."""
    back = {new: old for old, new in model.renamed.get("bodies", {}).items()}
    found: dict[str, tuple[str | None, np.ndarray]] = {}
    for name, entry in described(model)["bodies"].items():
        body = None if name == "ground" else name
        if body is not None:
            found[back.get(body, body)] = body, np.eye(4)
        for marker, placed in entry.get("markers", {}).items():
            placed = {"at": placed} if isinstance(placed, list) else placed
            frame = np.eye(4)
            frame[:3, :3] = Rotation.from_euler("xyz", placed.get("rpy", (0.0, 0.0, 0.0))).as_matrix()
            frame[:3, 3] = placed.get("at", (0.0, 0.0, 0.0))
            found[back.get(marker, marker)] = body, frame
    return found
