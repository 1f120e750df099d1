"""Judges from outside in NumPy: rigid bodies from their poses alone, multipliers, Newton's steps onto constraints.

Derivatives are central differences of tenth order, good to about 1e-13 of the function's size.  Solvers are judged by
dense solves with the functions of a module that are formulas: M, h, C, C_q and C_q v + C_t.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from scipy.spatial.transform import Rotation

STEP = 0.02
FIRST = np.array([5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260])
SECOND = np.array([5 / 3, -5 / 21, 5 / 126, -5 / 1008, 1 / 3150])
OFFSETS = np.array([1.0, 2.0, 3.0, 4.0, 5.0])


def first(
    f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, d: np.ndarray, h: float = STEP, size: float | None = None
) -> np.ndarray:
    """Derivative of f at x along d; f takes states as columns and gives results along the last axis.

    Steps are h / size, with the largest entry of d (at least 1) as the size unless it is given.
    """
    s = h / (max(1.0, np.abs(d).max(initial=0.0)) if size is None else size)
    plus, minus = (f(x[:, None] + sign * s * np.outer(d, OFFSETS)) for sign in (1, -1))
    return (plus - minus) @ FIRST / s


def second(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, d: np.ndarray, h: float = 2 * STEP) -> np.ndarray:
    """Second derivative of f at x along d."""
    size = max(1.0, np.abs(d).max(initial=0.0))
    s = h / size
    plus, minus = (f(x[:, None] + sign * s * np.outer(d, OFFSETS)) for sign in (1, -1))
    return (plus + minus - 2 * f(x[:, None])) @ SECOND / s**2


@dataclass(frozen=True)
class RigidBodies:
    """Masses (k,), centres (k, 3) and central inertias (k, 3, 3) in body axes, and gravity (3,)."""

    masses: np.ndarray
    centers: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray


def described(model: Any, p: Mapping[str, float] | None = None) -> RigidBodies:
    """The numbers of a model's bodies, from the standard parameters of a module and the model's gravity."""
    module = model.compile(target="numpy", kernels=["inertial_terms"])
    rows = np.array(list(module.standard_parameters(p).values())).reshape(-1, 10)
    masses, moments = rows[:, 0], rows[:, 1:4]
    centers = np.divide(moments, masses[:, None], out=np.zeros_like(moments), where=masses[:, None] > 0)
    about = rows[:, [4, 7, 8, 7, 5, 9, 8, 9, 6]].reshape(-1, 3, 3)  # their origins: xx, yy, zz, xy, xz, yz
    shift = [m * (np.eye(3) * (c @ c) - np.outer(c, c)) for m, c in zip(masses, centers, strict=True)]
    values = dict(zip(module.p_names, module.p.tolist(), strict=True)) | dict(p or {})
    gravity = [float(sympy.sympify(g, locals=sympy_names(values)).subs(values)) for g in model.gravity]
    return RigidBodies(masses, centers, about - np.array(shift).reshape(-1, 3, 3), np.array(gravity))


def sympy_names(names: Iterable[str]) -> dict[str, sympy.Symbol]:
    """Symbols by name, so that none is taken for a function of SymPy's."""
    return {name: sympy.Symbol(name) for name in names}


def vee(W: np.ndarray) -> np.ndarray:
    """Axial vectors (k, 3) of the skew parts of matrices (k, 3, 3)."""
    return np.stack([W[:, 2, 1] - W[:, 1, 2], W[:, 0, 2] - W[:, 2, 0], W[:, 1, 0] - W[:, 0, 1]], axis=1) / 2


class Bodies:
    """Motion of all bodies at one state of a module, by differences of its poses alone.

    Attributes
    ----------
    R, r : (k, 3, 3), (k, 3)
    J_w, J_r : (k, 3, n): angular velocity and velocity of the body origin per generalized velocity
    w, v : (k, 3) at the given velocities; w_dot, r_ddot: their rates for vanishing generalized accelerations
    """

    def __init__(self, module: Any, q: np.ndarray, v: np.ndarray, t: float = 0.0) -> None:
        def poses(columns: np.ndarray) -> np.ndarray:
            return module.poses(columns, t=t)

        n = len(q)
        here = module.poses(q, t=t)
        self.R, self.r = here[:, :3, :3], here[:, :3, 3]
        slopes = np.stack([first(poses, q, e) for e in np.eye(n)], axis=-1) if n else np.zeros((*here.shape, 0))
        turned = np.einsum("kabj,kcb->kacj", slopes[:, :3, :3], self.R)
        self.J_w = np.stack([vee(turned[..., j]) for j in range(n)], axis=-1)
        self.J_r = slopes[:, :3, 3]
        self.w, self.v = self.J_w @ v, self.J_r @ v
        bend = second(poses, q, v)
        self.w_dot = vee(np.einsum("kab,kcb->kac", bend[:, :3, :3], self.R))
        self.r_ddot = bend[:, :3, 3]

    def point(self, body: int, at: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity (3,) and velocity Jacobian (3, n) of a point fixed in a body, -1 for ground."""
        at = np.asarray(at, dtype=float)
        n = self.J_r.shape[-1]
        if body < 0:
            return at, np.zeros(3), np.zeros((3, n))
        arm = self.R[body] @ at
        J = self.J_r[body] + np.cross(self.J_w[body].T, arm).T
        return self.r[body] + arm, self.v[body] + np.cross(self.w[body], arm), J

    def newton_euler(self, rigid: RigidBodies) -> tuple[np.ndarray, np.ndarray]:
        """M (n, n) and h (n,) with gravity alone: M a + h = generalized forces of everything else."""
        n = self.J_r.shape[-1]
        M, h = np.zeros((n, n)), np.zeros(n)
        for k, mass in enumerate(rigid.masses):
            arm = self.R[k] @ rigid.centers[k]
            J = self.J_r[k] + np.cross(self.J_w[k].T, arm).T
            w = self.w[k]
            a = self.r_ddot[k] + np.cross(self.w_dot[k], arm) + np.cross(w, np.cross(w, arm))
            tensor = self.R[k] @ rigid.inertias[k] @ self.R[k].T
            M += mass * J.T @ J + self.J_w[k].T @ tensor @ self.J_w[k]
            h += mass * J.T @ (a - rigid.gravity)
            h += self.J_w[k].T @ (tensor @ self.w_dot[k] + np.cross(w, tensor @ w))
        return M, h


def loop_terms(module: Any, q: np.ndarray, v: np.ndarray, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """C_q (all rows) and gamma of C_q a + gamma = 0 for constraints without t, gamma by differences of C_q v."""
    C_q = module.constraint_jacobian(q, t=t, rows="all")

    def rate(columns: np.ndarray) -> np.ndarray:
        return np.einsum("ijk,j->ik", module.constraint_jacobian(columns, t=t, rows="all"), v)

    return C_q, first(rate, q, v)


def augmented(M: np.ndarray, h: np.ndarray, C_q: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Accelerations from [[M, C_q^T], [C_q, 0]] [a; l] = [-h; -gamma] (Shabana, sec. 5.6), redundant rows allowed.

    Rows are made orthonormal first (by singular values), which leaves their solutions as they are.
    """
    n = len(h)
    U, sizes, Vt = np.linalg.svd(C_q / np.abs(C_q).max(initial=1.0))
    rank = int((sizes > 1e-9).sum())
    G = Vt[:rank]
    right = (U.T @ (gamma / np.abs(C_q).max(initial=1.0)))[:rank] / sizes[:rank]
    size = np.abs(M).max() or 1.0
    K = np.block([[M / size, G.T], [G, np.zeros((rank, rank))]])
    return np.linalg.solve(K, np.concatenate([-h / size, -right]))[:n]


# -- Of the solvers of constraints -------------------------------------------------------------------------------------
def central(values: Callable[[float], Any], h: float) -> Any:
    """A derivative at 0 to fourth order."""
    return (8.0 * (values(h) - values(-h)) - (values(2 * h) - values(-2 * h))) / (12.0 * h)


def sizes(module: Any) -> np.ndarray:
    """Units of velocities (n_v,): 1 of angles, the mechanism's size of lengths."""
    kinds = module.metadata["velocity_kinds"]
    return np.array([module.metadata["length_scale"] if kind == "length" else 1.0 for kind in kinds])


def displaced(module: Any, q: np.ndarray, d: np.ndarray) -> np.ndarray:
    """q after displacements d along the velocities, of Euler parameters by SciPy's rotations."""
    q, balls = np.array(q), [tuple(pair) for pair in module.metadata["quaternion_slots"]]
    plain_q = [k for k in range(module.n_q) if not any(i <= k < i + 4 for i, _ in balls)]
    plain_v = [k for k in range(module.n_v) if not any(j <= k < j + 3 for _, j in balls)]
    q[plain_q] += d[plain_v]
    for i, j in balls:
        turned = Rotation.from_quat(q[i : i + 4], scalar_first=True) * Rotation.from_rotvec(d[j : j + 3])
        f = turned.as_quat(scalar_first=True)
        q[i : i + 4] = f if f @ q[i : i + 4] > 0.0 else -f
    return q


def closed(module: Any, x: np.ndarray, t: float = 0.0) -> np.ndarray:
    """[q; v] that Newton's steps of least norm reach from x, no entry of a step above 0.5, and the nearest velocities.

    In units of the mechanism's size; the term of Levenberg and Marquardt is the mean residual, of 1e-8 at least, in
    parts of the largest row.
    """
    s, rows, h = sizes(module), np.array(module.metadata["constraint_scales"]), module.metadata["n_h"]
    q, v = displaced(module, x[: module.n_q], np.zeros(module.n_v)), x[module.n_q : module.n_q + module.n_v] / s
    C, longest = np.zeros(0), 1.0 if h else 0.0
    for _ in range(60):
        J = module.constraint_jacobian(q, t=t, rows="all") * s / rows[:, None]
        C = module.constraints(q, t=t, rows="all") / rows[:h]
        if longest < 1e-13:
            break
        G = J[:h] @ J[:h].T
        step = -J[:h].T @ np.linalg.solve(G + max(1e-8, np.abs(C).mean()) * G.diagonal().max() * np.eye(h), C)
        longest = np.abs(step).max()
        q = displaced(module, q, s * step * min(1.0, 0.5 / max(longest, 1e-300)))
    left = module.velocity_constraints(np.concatenate([q, s * v]), t=t, rows="all") / rows
    return np.concatenate([q, s * (v - np.linalg.lstsq(J, left, rcond=1e-9)[0])])


def solved(module: Any, x: np.ndarray, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations, and what constraints exert along the velocities, from M, h, C_q and the rate of C_q v + C_t."""
    q, v, n = x[: module.n_q], x[module.n_q : module.n_q + module.n_v], module.n_v
    M, h = module.mass_matrix(q), module.bias(t, x)

    def rate(s: float) -> Any:
        """C' at the same velocities, s later."""
        return module.velocity_constraints(np.concatenate([displaced(module, q, s * v), v]), t=t + s, rows="all")

    if not module.n_c:
        return np.linalg.solve(M, -h), np.zeros(n)
    s, rows = sizes(module), np.array(module.metadata["constraint_scales"])
    C_q = module.constraint_jacobian(q, t=t, rows="all")
    gamma = central(rate, 1e-3 / max(1.0, np.abs(v / s).max()))
    a = s * augmented(s[:, None] * M * s, s * h, C_q * s / rows[:, None], gamma / rows)
    return a, M @ a + h


def random_states(module: Any, seed: int, count: int, position: float = 0.15, speed: float = 3.0) -> list[np.ndarray]:
    """States on the manifold near the declared initial position, with random velocities."""
    random = np.random.default_rng(seed)
    start = module.x0()
    n = module.n_q
    length = module.metadata["length_scale"]
    sizes, rates = (
        np.array([length if kind == "length" else 1.0 for kind in module.metadata[key]])
        for key in ("coordinate_kinds", "velocity_kinds")
    )
    found = []
    for _ in range(count):
        x = start.copy()
        x[:n] += position * sizes * random.uniform(-1, 1, n)
        x[n:] = speed * rates * random.uniform(-1, 1, len(rates))
        found.append(module.project(x))
    return found


def agree(a: np.ndarray, b: np.ndarray, digits: float, cond: float = 1.0) -> None:
    """Accelerations agree to 10^-k: |difference| <= 1e-k max(1, cond(M)/1e3) max|v'|."""
    allowed = digits * max(1.0, cond / 1e3) * np.abs(b).max(initial=0.0)
    worst = np.abs(a - b).max(initial=0.0)
    assert worst <= allowed, f"differ by {worst:.3g}, allowed {allowed:.3g}\n{a}\n{b}"


def slopes(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: Any = 1e-6) -> np.ndarray:
    """Derivatives of a function by central differences; ``step`` is one number, or one of each variable."""
    steps = np.diag(np.broadcast_to(step, len(x)))
    return np.array([(f(x + d) - f(x - d)) / (2 * d.sum()) for d in steps]).T


def differences(mod: Any, x: np.ndarray, step: Any = 1e-7, t: float = 0.0) -> np.ndarray:
    """The Jacobian of rhs by central differences."""
    return slopes(lambda y: mod.rhs(t, y), x, step)


def fine_differences(mod: Any, x: np.ndarray, step: float, t: float = 0.0) -> np.ndarray:
    """The same to the tenth order, all at once."""
    n, steps = len(x), step * np.kron(np.eye(len(x)), OFFSETS)
    sides = mod.rhs(t, x[:, None] + steps) - mod.rhs(t, x[:, None] - steps)
    return np.asarray(sides.reshape(n, n, -1) @ FIRST / step)
