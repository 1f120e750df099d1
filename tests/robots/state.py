"""What a judge says of one state, in our coordinates; and how equations in other velocities become ours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
