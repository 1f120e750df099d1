"""Stage runtime: a kernel that failed at a state -> what it is due to, in words: inputs, elements, coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..base import algebra
from ..base.algebra import Array, correlated
from ..base.limits.numbers import SINGULAR

if TYPE_CHECKING:
    from .layout import Layout
    from .protocols import State, Timed


class Evaluates(Protocol):
    """The calls of a model, as :class:`~.kernels.Kernels` has them."""

    core: Any
    context: Any
    layout: Layout

    def state(self, name: str, nan: bool = False) -> State: ...

    def timed(self, name: str, nan: bool = False) -> Timed: ...


def find_culprit(
    kernels: Evaluates, status: int, t: float, x: Array, p: Array | None = None, u: Array | None = None
) -> str:
    """Names what a failure at a state is due to, as far as it can be told, with p and u of the call."""
    layout, q = kernels.layout, x[: kernels.layout.n_q]
    if status == 1:
        return _not_finite(kernels, t, x, p, u)
    if status == 2:
        M = kernels.state("embedded_mass_matrix", nan=True)(q, t=t, p=p, u=u)
        if not np.isfinite(M).all():
            return ""
        values, vectors = algebra.eigh(correlated(M))  # whatever the units of the coordinates
        if layout.metadata.get("indefinite"):
            return f"the eigenvalue nearest to 0 is {values[np.abs(values).argmin()]:.2g}"
        if values[0] > SINGULAR:
            return "because its reactions are not unique; method='embedding' does not need them"
        weights = np.abs(vectors[:, 0])
        moved = zip(layout.independent, weights, strict=True)
        names = [layout.velocity_labels[i] for i, w in moved if w > 0.1 * weights.max()]
        moving = " and ".join(names) if len(names) < 5 else ", ".join(names[:4]) + ", ..."
        size = "negative" if values[0] < -SINGULAR else "no"
        return f"moving {moving} meets {size} inertia (smallest eigenvalue {values[0]:.2g})"
    if status == 3:
        e = kernels.state("constraints", nan=True)(q, t=t, p=p, u=u)
        if not np.isfinite(e).all() or not e.size:
            return ""
        worst = int(np.abs(layout.scales.residual(e)).argmax())
        return f"largest residual at {layout.constraint_labels[worst]}, {abs(e[worst]):.3g}"
    if status == 4:
        return f"independent are {', '.join(layout.velocity_labels[i] for i in layout.independent)}"
    return ""


def _not_finite(kernels: Evaluates, t: float, x: Array, p: Array | None, u: Array | None) -> str:
    """Names what makes a result that is no number: inputs, loads of elements, the mass matrix."""
    layout = kernels.layout
    inputs = kernels.context.u if u is None else u
    bad = [name for name, value in zip(layout.u, inputs, strict=True) if not np.isfinite(value).all()]
    if bad:
        return f"the input{'s' * (len(bad) > 1)} {', '.join(bad)} given {'are' if len(bad) > 1 else 'is'} not"
    if layout.n_finite_forces and "finite_forces" in kernels.core.names and x.size >= layout.n_x:
        finite = kernels.state("finite_forces", nan=True)(x[: layout.n_x], t=t, p=p, u=u)
        bad = [name for name, fine in zip(layout.fragile_forces, finite, strict=True) if not fine > 0]
        known = layout.metadata.get("not_finite_where", {})
        own = {known[name]: None for name in bad if name in known}
        if bad and set(bad) <= set(layout.reaction_laws):
            return (
                f"the forces of {' and '.join(bad)} depend on reactions which they change so strongly that the motion "
                "may have several solutions or none (Painleve's paradox); give smaller coefficients"
                f"{''.join(f'; or {why}' for why in own)}"
            )
        held = [name for name in bad if f"{name}_closed" in layout.x]
        if held:
            return f"the equations of {' and '.join(held)} are not (outside their domain, or a wheel lies flat)"
        loads = [name for name in bad if name not in layout.reaction_laws]
        if loads:
            ends = [] if known.keys() >= {*loads} else ["its ends meet or lie inside the cylinder"]
            why = ", or ".join([*own, *ends, "its law is outside its domain"])
            return f"the loads of {' and '.join(loads)} are not ({why})"
    if "mass_matrix" in kernels.core.names and x.size >= layout.n_q:
        M = kernels.state("mass_matrix", nan=True)(x[: layout.n_q], t=t, p=p, u=u)
        if not np.isfinite(M).all():
            return "the mass matrix is not (a mass, an inertia or a length outside the domain of its law)"
    if layout.states and "rhs" in kernels.core.names and x.size == layout.n_x:
        fine = np.isfinite(kernels.timed("rhs", nan=True)(t, x, p=p, u=u))
        bad = [name for name, known in zip(layout.x, fine, strict=True) if not known]
        if bad and {*bad} <= {*layout.states}:
            many = len(bad) > 1
            return f"the rate{'s' * many} of {', '.join(bad)} {'are' if many else 'is'} not (outside the law's domain)"
    return ""
