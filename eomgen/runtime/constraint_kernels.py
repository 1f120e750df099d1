"""Stage runtime: the kernels of a module -> its constraints and cut joints as one record of functions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..base.algebra import Array
from ..numeric.constraint_system import ConstraintSystem, CutJoints
from .kernels import Kernels


@lru_cache(maxsize=64)
def constraint_system(kernels: Kernels) -> ConstraintSystem:
    """The constraints of positions with the parameters of the kernels; dC/dq for C_q where q' is given."""
    layout = kernels.layout
    C = kernels.state("constraints", nan=True)
    slopes = "coordinate_slopes" if layout.n_coordinate_slopes else "constraint_jacobian"
    C_q, none = kernels.state(slopes, nan=True), np.zeros((0, layout.n_q))
    places = layout.n_h or not layout.given_rates  # rows of given velocities alone say nothing of q
    y, y_q = kernels.motion("loop_coordinates"), kernels.state("loop_coordinate_jacobian", nan=True)
    alignment, zero = kernels.state("alignment", nan=True), np.zeros(layout.n_v)

    def cut(q: Array, t: float) -> tuple[Array, Array]:
        return np.asarray(y(q, zero, zero, t=t), dtype=float)[0], y_q(q, t=t)

    joints = CutJoints(layout.loops, layout.loop_kinds, layout.loop_scales, cut)
    aligned = (lambda q, t: alignment(q, t=t)) if layout.n_alignments else None
    named = layout.place_scales, layout.q, layout.coordinate_kinds, layout.constraint_labels
    evaluate = (lambda q, t: (C(q, t=t), C_q(q, t=t))) if places else lambda q, t: (np.zeros(0), none)
    return ConstraintSystem(evaluate, *named, joints, aligned)
