"""Identification: a module -> random states and accelerations in which every inertial parameter shows its effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import STATE as RANK
from ..errors import EvaluationError, ProjectionError

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


def random_states(module: BoundModel, random: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    """Random q, v, a on the constraints, as fast as gravity makes the mechanism over its own length."""
    layout = module.layout
    s = layout.scales.q[:, None]
    rate = _rate(module)
    if not layout.n_c:
        long = np.array([kind == "length" for kind in layout.coordinate_kinds], dtype=bool)[:, None]
        q = np.where(long, layout.length, np.pi) * random.uniform(-1.0, 1.0, (module.n_q, count))
        for i, _ in layout.quaternion_slots:
            e = random.normal(size=(4, count))
            q[i : i + 4] = e / np.linalg.norm(e, axis=0)
        v, a = random.normal(size=(2, module.n_v, count))
        return q, rate * s * v, rate * rate * s * a
    states: list[Array] = []
    accelerations: list[Array] = []
    for _ in range(4 * count):
        if len(states) == count:
            break
        try:
            x, own = _on_constraints(module, random, rate)
        except EvaluationError:
            continue
        states.append(x)
        accelerations.append(own)
    if not states:
        raise ProjectionError(f"model {module.name!r}: no random state could be put on the constraints")
    x = np.array(states).T
    return x[: module.n_q], x[module.n_q :], np.array(accelerations).T


def _on_constraints(module: BoundModel, random: np.random.Generator, rate: float) -> tuple[Array, Array]:
    """A state x on the constraints, and accelerations that keep it there."""
    layout = module.layout
    n_q, scales = module.n_q, layout.scales
    q = scales.move(layout.q_reference, np.pi * random.uniform(-1.0, 1.0, module.n_v))
    x = module.project(np.concatenate([q, rate * scales.q * random.normal(size=module.n_v)]))
    free = free_directions(scales.jacobian(module.constraint_jacobian(x[:n_q], rows="all")))
    own = module.rhs(0.0, x)[n_q:]  # keeps the constraints, as does every change along what they leave free
    return x, own + scales.q * (free @ (rate * rate * random.normal(size=free.shape[1])))


def _rate(module: BoundModel) -> float:
    """sqrt(g / L), at which gravity and inertia are alike; 1 where there is no gravity."""
    still = np.zeros(module.n_v)
    terms = module.kernels.motion("inertial_terms")(module.layout.q_reference, still, still)
    fall = float(np.linalg.norm(terms[:, 9:12], axis=1).max())
    return float(np.sqrt(fall / module.layout.length)) if fall > 0.0 else 1.0


def free_directions(J: Array) -> Array:
    """Directions of scaled velocities that constraints leave, as orthonormal columns."""
    _, sizes, Vt = algebra.svd(J)
    return Vt[int((sizes > RANK * sizes.max(initial=0.0)).sum()) :].T
