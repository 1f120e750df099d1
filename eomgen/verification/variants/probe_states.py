"""Stage verification, states: a model with probes -> states on its manifold, its outputs there, and their limits.

Error model.  Results of a stable calculation are those of a state and of data that differ from the given ones by a few
roundings.  A relative change eps of every coordinate changes the accelerations by at most eps sum_j |da_i/dx_j| s_j,
with the sizes s of the coordinates; the same change of the entries of M and C_q changes them by at most
eps cond(M) cond(C_q) max|a| after both are scaled to unit rows (Higham, *Accuracy and Stability*, 2002, ch. 7 and 20).
The limit is :data:`ROUNDINGS` times the sum of the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ... import pipeline
from ...analysis.reactions import reactions
from ...describe.builder import Builder
from ...describe.description import Description
from ...errors import EomgenError
from ...limits.rounding import EPS
from ...limits.verification import DEPENDENT
from ...numeric import algebra
from ...numeric.scales import Array
from ...records import dataclass
from ...runtime.bound_model import BoundModel
from .body_frames import length_of
from .probes import ANGULAR, LINEAR, PLACE, SPEED, SPIN
from .variant import kinds_of, velocities_of

#: Roundings of the size of the result that a calculation may collect; the largest ratio seen stands in docs.
ROUNDINGS = 200.0
OBSERVED = ("outputs",)  #: kernels of a variant whose outputs alone are compared: making all takes five times as long
STATES = 3


@dataclass(frozen=True)
class Original:
    """A model with probes, its states, and what was found at them.

    Attributes
    ----------
    description : Description
    module : Module
    kinds : dict
        Output -> what it is.
    states : (n_x, k) array
    values : (n_y, k) array of outputs
    reactions : (n_joints, 6, k) array or None
    sizes : (n_y, k) array
        The size of what each output is made of.
    force : (k,) array
        The size of forces: the largest reaction, and what accelerates the total mass.
    limits : (k,) array
        Relative error that rounding allows at each state; infinite where it gives none.
    """

    description: Description
    module: Any
    kinds: Mapping[str, str]
    states: Array
    values: Array
    reactions: Array | None
    sizes: Array
    force: Array
    limits: Array
    length: float

    def named(self, k: int) -> dict[str, float]:
        """Coordinates and velocities of a state by name, those of cut joints among them."""
        result = dict(zip(self.module.x_names, self.states[:, k].tolist(), strict=True))
        for name, value in zip(self.module.y_names, self.values[:, k].tolist(), strict=True):
            what, _, coordinate = self.kinds[name].partition(" ")
            if what in ("coordinate", "velocity"):
                result.setdefault(coordinate, value)
        return result


def compiled(description: Description, **options: Any) -> BoundModel:
    """A module of a description, by default of the target that needs no compiler."""
    return compiled_model(Builder.from_description(description), **options)


def compiled_model(
    model: Builder, method: str = "auto", independent: Sequence[str] | None = None, target: str = "numpy",
    kernels: Sequence[str] | None = None,
) -> BoundModel:  # fmt: skip
    """A module of a model, by default of the target that needs no compiler and with all kernels."""
    return BoundModel(pipeline.compile_core(pipeline.derive(model, method, independent), target, kernels))


def observe(
    description: Description, kinds: Mapping[str, str], random: Any, count: int = STATES, motion_only: bool = False
) -> Original:
    """Compile a description with probes, find states, and evaluate.

    ``motion_only`` leaves out reactions and limits, which take longest; the caller has limits of its own then.
    """
    module = compiled(description)
    length = length_of(description)
    states = sample(module, description, length, random, count)
    values = module.outputs(0.0, states) if len(module.y_names) else np.zeros((0, states.shape[1]))
    sizes = sizes_of(module, kinds, values, states, length)
    if motion_only:
        limits, reactions = np.full(states.shape[1], np.nan), None
    else:
        limits = np.array([relative_limit(module, x, description, length) for x in states.T])
        reactions = reactions_of(module, states)
    force = np.full(states.shape[1], np.finfo(float).tiny)
    if reactions is not None:
        force += np.abs(reactions[:, :3]).max(axis=(0, 1)) + np.abs(reactions[:, 3:]).max(axis=(0, 1)) / length
    if "probe_mass" in module.y_names:
        number = module.y_names.index("probe_mass")
        linear = [i for i, name in enumerate(module.y_names) if kinds[name] in LINEAR]
        force += np.abs(values[number]) * sizes[linear].max(axis=0, initial=0.0)
    return Original(description, module, kinds, states, values, reactions, sizes, force, limits, length)


def reactions_of(module: Any, states: Array) -> Array | None:
    """Reactions (n_joints, 6, k), None where there are none."""
    if module.metadata.get("wrenches") is None:
        return None
    return reactions(module, 0.0, states)


def sample(module: Any, description: Description, length: float, random: Any, count: int) -> Array:
    """The initial state and states near it, on the constraints; an attempt that leaves them is made smaller."""
    start = np.asarray(module.x0())
    kinds, rates = kinds_of(description), velocities_of(description)
    sizes = [length if kinds.get(name) == "length" else 1.0 for name in module.q_names]
    sizes += [length if rates.get(name) == "length" else 1.0 for name in module.v_names]
    sizes += [0.0] * (len(start) - len(sizes))
    states = [start]
    for _ in range(count - 1):
        for spread in (0.3, 0.1, 0.03, 0.0):
            away = random.normal(size=len(start)) * np.array(sizes)
            away[: module.n_q] *= spread
            try:
                x = np.asarray(module.project(start + away))
                if np.isfinite(module.rhs(0.0, x)).all():
                    states.append(x)
                    break
            except EomgenError:
                continue
    return np.array(states).T


def sizes_of(module: Any, kinds: Mapping[str, str], values: Array, states: Array, length: float) -> Array:
    """For each output the size of its terms: the motion of all bodies counts, as one follows from the others."""
    groups: dict[str, list[int]] = {}
    for i, name in enumerate(module.y_names):
        groups.setdefault(kinds[name], []).append(i)

    def largest(names: tuple[str, ...]) -> Array:
        rows = [i for name in names for i in groups.get(name, ())]
        return np.abs(values[rows]).max(axis=0) if rows else np.zeros(values.shape[1])

    turning = largest(SPIN)
    speed = largest(SPEED) + length * turning + length
    # at rest without loads nothing accelerates: a length a second squared is the least size
    linear = largest(LINEAR) + length * largest(ANGULAR) + length * turning**2 + length
    place = largest(PLACE) + length
    # potentials are differences of larger numbers: the work of what accelerates the mass over a place
    energy = float(np.max(largest(("kinetic_energy", "potential_energy")))) + largest(("total_mass",)) * linear * place
    by_kind = dict.fromkeys(LINEAR, linear) | dict.fromkeys(ANGULAR, linear / length)
    by_kind |= dict.fromkeys(SPEED, speed) | dict.fromkeys(SPIN, speed / length) | dict.fromkeys(PLACE, place)
    by_kind |= dict.fromkeys(("kinetic_energy", "potential_energy"), energy)
    sizes = np.empty_like(values)
    for kind, rows in groups.items():
        for i in rows:
            sizes[i] = by_kind.get(kind, 1.0 + np.abs(values[i]).max(initial=0.0))
    return np.maximum(sizes, np.finfo(float).tiny)


def relative_limit(module: Any, x: Array, description: Description, length: float) -> float:
    """The relative error (1) of accelerations v' that rounding allows at a state x (n_x,).

    Infinite where the Jacobian of x' is not finite, such as that of a force sqrt(abs(x)) at x = 0.
    """
    try:
        J = module.jacobian(0.0, x)
    except EomgenError:
        return np.inf
    q = x[: module.n_q]
    condition = 1.0
    kinds, rates = kinds_of(description), velocities_of(description)
    s_q = np.array([length if kinds.get(name) == "length" else 1.0 for name in module.q_names])
    s_v = np.array([length if rates.get(name) == "length" else 1.0 for name in module.v_names])
    if module.n_dof:
        condition *= _condition(np.atleast_2d(module.embedded_mass_matrix(q)))
    if module.n_rows:
        rows = np.atleast_2d(module.constraint_jacobian(q, rows="all")) * s_v
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        singular = algebra.singular_values(rows / np.where(lengths > 0, lengths, 1.0))
        kept = singular[singular > DEPENDENT * singular.max(initial=0.0)]
        condition *= float(kept.max() / kept.min()) if kept.size else 1.0
    slopes = np.abs(J[module.n_q : module.n_q + module.n_v])
    v = np.abs(x[module.n_q : module.n_q + module.n_v]) / s_v
    fast = max(1.0, float(v.max(initial=0.0)))
    state = np.concatenate([s_q, s_v * fast, np.zeros(len(x) - module.n_q - module.n_v)])
    change = float(((slopes @ state) / s_v).max(initial=0.0))
    a = float((np.abs(module.rhs(0.0, x)[module.n_q : module.n_q + module.n_v]) / s_v).max(initial=0.0))
    return ROUNDINGS * EPS * (condition + change / max(a, fast**2))


def _condition(matrix: Array) -> float:
    """Condition of a symmetric matrix after its diagonal is scaled to 1."""
    root = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / np.where(root > 0, root, 1.0) / np.where(root > 0, root, 1.0)[:, None]
    values = np.abs(algebra.eigvalsh(scaled))
    return float(values.max() / values.min()) if values.min() > 0 else np.inf
