"""A module and the equations it was made from, and all that several checks look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.kernel_table import NAMED
from ..base.limits.constraints import EXACT
from ..base.limits.numbers import TINY
from ..codegen.kernels import EXPRESSIONS
from ..codegen.terms import SystemTerms
from ..expr.core import Expr
from .digits import FOLDED, UNIT, bounded
from .limits import NUDGE
from .random_states import SystemState
from .truth import PreciseSystem, Truth

if TYPE_CHECKING:
    from ..reading.derivation import Derivation
    from ..runtime.bound_model import BoundModel

#: Kernels that are compared with the expressions that they were made from.
GRAPH_KERNELS = (
    "bias", "inverse_dynamics", "energy", "poses", "constraints", "constraint_jacobian", "velocity_constraints",
    "loop_coordinates", "loop_coordinate_jacobian", "alignment", "motion_outputs", "centroidal", "canonical", "events",
    "needed_wrenches", "wrench_geometry", "inertial_terms",
)  # fmt: skip
DEEP = 3  #: states that are looked at in many digits


class CheckedModel:
    """What the checks of one model share.

    Parameters
    ----------
    equations : Derivation
        What it was made from.
    states : sequence of SystemState
    """

    def __init__(self, module: BoundModel, equations: Derivation, states: Sequence[SystemState]) -> None:
        self.module, self.equations, self.states = module, equations, list(states)
        self.layout = module.layout
        self.kinematics = equations.kinematics
        self.mechanism = equations.kinematics.mechanism
        self.terms = SystemTerms(equations.kinematics, equations.mobility, equations.tree)
        self.system = PreciseSystem(equations, self.terms)
        self._bounds: dict[str, tuple[Array, Array]] = {}

    @cached_property
    def truths(self) -> list[Truth]:
        return [Truth(self.system, case) for case in self.states[:DEEP]]

    @cached_property
    def symbols(self) -> dict[str, Array]:
        terms, states = self.terms, self.states
        names = (*terms.q, *terms.v, *terms.a, *terms.p, *terms.u, terms.t)
        rows = np.array([[*c.x, *c.a, *c.p, *c.u, c.t] for c in states])
        return {name: rows[:, k] for k, name in enumerate(names)}

    def bounds(self, name: str, outputs: Callable[[], Sequence[Expr]]) -> tuple[Array, Array]:
        """Values (n, k) of expressions on the graph in double arithmetic, and the bounds of their rounding."""
        if name not in self._bounds:
            self._bounds[name] = bounded(list(outputs()), self.symbols, len(self.states))
        return self._bounds[name]

    def call(self, kernel: str, case: SystemState) -> Array:
        """A compiled kernel at a case; its result for one state."""
        kernels, takes = self.module.kernels, NAMED[kernel].inputs
        if takes == ("q", "v", "a"):
            return np.asarray(kernels.kernel(kernel)(case.q, case.v, case.a, **case.timed))
        return np.asarray(kernels.kernel(kernel, kind="state")(case.q if takes == ("q",) else case.x, **case.timed))

    def rhs(self, case: SystemState) -> Array:
        return self.module.rhs(case.t, case.x, **case.values)

    # -- the straight-line kernels and what they are on the graph -----------------------------------------------------
    @cached_property
    def graph_kernels(self) -> dict[str, Callable[[], Sequence[Expr]]]:
        """Kernels that are expressions of the graph, by name."""
        result = [*GRAPH_KERNELS, *(() if self.terms.by_columns else ("mass_matrix",))]
        names = self.module.core.names
        return {k: partial(EXPRESSIONS[k], self.terms) for k in result if k in names and 0 not in self.layout.shape(k)}

    # -- labels -------------------------------------------------------------------------------------------------------
    def labels(self, kernel: str) -> list[str]:
        layout = self.layout
        table: dict[str, Sequence[Sequence[str]]] = {
            "rhs": [[f"{n}'" for n in layout.x]],
            "mass_matrix": [layout.v, layout.v],
            "bias": [layout.v],
            "inverse_dynamics": [layout.v],
            "energy": [("kinetic", "potential")],
            "poses": [layout.bodies, ("1", "2", "3", "4"), ("1", "2", "3", "4")],
            "constraints": [layout.constraint_labels[: layout.n_h]],
            "constraint_jacobian": [layout.constraint_labels, layout.v],
            "velocity_constraints": [layout.constraint_labels],
            "loop_coordinates": [("value", "rate", "acceleration"), layout.loops],
            "loop_coordinate_jacobian": [layout.loops, layout.v],
            "motion_outputs": [layout.y],
            "alignment": [layout.info.alignment_labels],
        }
        labels = [""]
        for names in table.get(kernel, []):
            labels = [f"{label} {name}".strip() for label in labels for name in names]
        return labels if kernel in table else []

    # -- how far accelerations may be off -----------------------------------------------------------------------------
    def acceleration_limit(self, k: int, a: Array, multipliers: Array) -> Array:
        """What rounding allows accelerations (n_v,) at state k to be off by.

        The perturbation bound of K z = r, K = [M C^T; C 0] (Higham 2002, theorem 7.4, componentwise), with the
        bounds of M, C, h and gamma; elimination adds n roundings of each product (theorem 9.4), and solving for
        dependent coordinates first as many as their own system is ill-conditioned.  The state itself is projected by
        the right-hand side, which moves it by what rounding makes of the constraints.
        """
        module, layout, case, n = self.module, self.layout, self.states[k], self.layout.n_v
        M, E_M = self._at("mass_matrix", k, (n, n))
        C, E_C = (y[layout.rows] for y in self._at("constraint_jacobian", k, (layout.n_c, n)))
        E_h = self.bounds("bias", lambda: self.terms.bias)[1][:, k]
        E_g = self.bounds("gamma", lambda: self.terms.gamma)[1][layout.rows, k]
        if self.terms.by_columns:
            M = module.kernels.mass_matrix(case.q, **case.timed)
            E_M = n * UNIT * np.abs(M)
        d = np.sqrt(np.maximum(np.diag(M), 0.0))
        E_M = E_M + FOLDED * np.outer(d, d)
        E_C = E_C + FOLDED * np.abs(C).max(axis=1, initial=0.0)[:, None]
        m = len(layout.rows)
        K = np.block([[M, C.T], [C, np.zeros((m, m))]])
        E_K = np.block([[E_M, E_C.T], [E_C, np.zeros((m, m))]])
        z, E_r = np.abs(np.concatenate([a, multipliers])), np.concatenate([E_h, E_g])
        inverse = np.abs(_inverse(K))
        spread = E_K @ z + E_r + (n + m) * UNIT * (np.abs(K) @ z)
        limit = (inverse @ spread)[:n] * self.dependence(C)
        return np.asarray(limit + self.moved(k, C))

    def _at(self, kernel: str, k: int, shape: tuple[int, ...]) -> tuple[Array, Array]:
        if kernel not in self.graph_kernels:
            return np.zeros(shape), np.zeros(shape)
        value, bound = self.bounds(kernel, self.graph_kernels[kernel])
        return value[:, k].reshape(shape), bound[:, k].reshape(shape)

    def dependence(self, C: Array) -> float:
        """Condition of the system of the dependent velocities, scaled."""
        if not len(C):
            return 1.0
        dependent = np.delete(np.arange(self.layout.n_v), self.layout.independent)
        J = C[:, dependent] / np.maximum(np.linalg.norm(C, axis=1), TINY)[:, None]
        J = J / np.maximum(np.linalg.norm(J, axis=0), TINY)
        return float(algebra.cond(J)) if J.shape[0] == J.shape[1] and J.size else 1.0

    def shift(self, k: int, C: Array) -> Array:
        """By how much the projection may move a state (n_x,) on the constraints."""
        layout, case = self.layout, self.states[k]
        x = self.module.project(case.x, t=case.t, **case.values)
        moved = np.abs(x - case.x) + UNIT * np.abs(case.x)
        if len(C):
            rows = layout.rows
            back = np.abs(algebra.pinv(C))
            switched = rows[rows < layout.n_h]
            E_q = (
                back[:, : len(switched)] @ self._at("constraints", k, (layout.n_h,))[1][switched]
                if len(switched)
                else np.zeros(layout.n_v)
            )
            E_v = back @ self._at("velocity_constraints", k, (layout.n_c,))[1][rows]
            if layout.n_q == layout.n_v:
                moved[: layout.n_q] += E_q
            else:
                moved[: layout.n_q] += E_q.max()
            moved[layout.n_q :] += E_v
        return np.asarray(moved)

    def moved(self, k: int, C: Array) -> Array:
        """By how much the projection may move accelerations (n_v,)."""
        case = self.states[k]
        J = np.abs(self.slopes(case))
        return np.asarray((J @ self.shift(k, C))[self.layout.n_q :])

    def slopes(self, case: SystemState) -> Array:
        """dx'/dx (n_x, n_x), by plain differences: only its size matters here."""
        columns, base = [], self.rhs(case)
        for k in range(self.layout.n_x):
            x = np.array(case.x)
            h = NUDGE * (1.0 + abs(x[k]))
            x[k] += h
            columns.append((self.module.rhs(case.t, x, **case.values) - base) / h)
        return np.array(columns).T if columns else np.zeros((0, 0))


def _inverse(K: Array) -> Array:
    """K^-1, with rows and columns brought to like size first."""
    with np.errstate(all="ignore"):
        d = np.ones(len(K))
        for _ in range(3):
            size = np.abs(K * d * d[:, None]).max(axis=1, initial=0.0)
            d = d / np.sqrt(np.where(size > 0.0, size, 1.0))
        scaled = K * d * d[:, None]
    return np.asarray(algebra.pinv(scaled, rcond=EXACT) * d * d[:, None])
