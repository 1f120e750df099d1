"""Euler parameters in plain NumPy, written apart from eomgen: products of quaternions (scalar first)."""

import numpy as np


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The quaternion a b."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def matrix(e: np.ndarray) -> np.ndarray:
    """Rotation of a quaternion of any length, by e (0, x) e^-1."""
    inverse = np.array([e[0], *-e[1:]]) / (e @ e)
    return np.array([product(product(e, np.array([0.0, *x])), inverse)[1:] for x in np.eye(3)]).T


def rates(e: np.ndarray, w: np.ndarray) -> np.ndarray:
    """e' = e (0, w) / 2 for an angular velocity w in turned axes."""
    return 0.5 * product(e, np.array([0.0, *w]))


def coordinate_rates(layout: dict, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """q' by the names in the metadata alone."""
    result = dict.fromkeys(layout["q_names"], np.nan)
    velocities = dict(zip(layout["v_names"], v, strict=True))
    for name in result:
        if f"{name}_dot" in velocities:
            result[name] = velocities[f"{name}_dot"]
        elif name.endswith("_e0"):
            joint = name[:-3]
            e = np.array([q[layout["q_names"].index(f"{joint}_e{k}")] for k in range(4)])
            w = np.array([velocities[f"{joint}_w{axis}"] for axis in "xyz"])
            result.update(zip([f"{joint}_e{k}" for k in range(4)], rates(e, w), strict=True))
    return np.array(list(result.values()))


def from_matrix(R: np.ndarray) -> np.ndarray:
    """A unit quaternion of a rotation matrix: the eigenvector of Bar-Itzhack's matrix (2000)."""
    K = np.zeros((4, 4))
    K[0, 0] = np.trace(R)
    K[0, 1:] = K[1:, 0] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    K[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    e = np.linalg.eigh(K)[1][:, -1]
    return e * (np.sign(e[0]) or 1.0)
