"""Stage verification, jacobians: a module alone -> its Jacobians against differences of its right-hand side.

For modules without equations, such as those of exported packages: nothing but NumPy is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.algebra import Array
from ..errors import EomgenError
from .cases import Case
from .comparison import Comparison, failed, pairs, size_of
from .differences import FIRST_STEP, SHORTER, extrapolate
from .finding import Finding
from .identities import KERNEL, condition_at

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

CASES = 2  #: states that are tried
STEPS = (FIRST_STEP, SHORTER * FIRST_STEP)
NAMES = {"jacobian": "x", "input_jacobian": "u", "parameter_jacobian": "p"}  #: kernel -> what it differentiates by


def jacobians(module: BoundModel, cases: Sequence[Case]) -> list[Finding]:
    """One finding for each Jacobian of the complete right-hand side that the module has."""
    found = []
    for name, by in NAMES.items():
        size = {"x": module.n_x, "u": module.n_u, "p": module.n_p}[by]
        exact = by == "x" or (module.layout.projects and not module.layout.given_rates)
        if size and exact and name in module.core.names:
            check = f"{name}: extrapolated differences of rhs"
            try:
                found.append(_compare(module, check, name, by, cases[:CASES]))
            except EomgenError as error:
                found.append(failed(check, error))
    return found


def _compare(module: BoundModel, check: str, name: str, by: str, cases: Sequence[Case]) -> Finding:
    found, layout = Comparison(check), module.layout
    names = {"x": layout.x, "u": module.u_names, "p": module.p_names}[by]
    left_out: set[str] = set()
    for c in cases:
        J, rate = getattr(module, name)(c.t, c.x, p=c.p, u=c.u), module.rhs(c.t, c.x, p=c.p, u=c.u)
        scales, condition = _scales(module, c, by), condition_at(module, c)
        noise = KERNEL * condition * max(size_of(rate), size_of(layout.scales.q))
        for j, label in enumerate(names):
            size = max(size_of(J * scales), size_of(rate))
            compared: tuple[Array, Array] | None = None
            for step in STEPS:
                try:
                    slope, error = extrapolate(_along(module, c, by, j, float(scales[j])), noise, step)
                except EomgenError:
                    continue
                compared = slope - J[:, j] * scales[j], error + KERNEL * condition * size
                if (np.abs(compared[0]) <= compared[1]).all():
                    break
            if compared is None:
                left_out.add(label)
                continue
            found.add(c.number, *compared, size, pairs([f"{n}'" for n in layout.x], [label]))
    found.cases = len(cases)
    if left_out:
        found.note = f"without {', '.join(sorted(left_out))}: no consistent state was found nearby"
    return found.finding()


def _scales(module: BoundModel, c: Case, by: str) -> Array:
    """Sizes of the variables, over which differences are taken."""
    layout = module.layout
    if by == "x":
        kinds = layout.coordinate_kinds
        own = np.array([layout.length if kind == "length" else 1.0 for kind in kinds])
        return np.concatenate([own, layout.scales.q])
    values = c.u if by == "u" else c.p
    return np.where(values != 0.0, np.abs(values), 1.0) * (1.0 if by == "u" else 0.2)


def _along(module: BoundModel, c: Case, by: str, j: int, scale: float) -> Callable[[float], Array]:
    def f(s: float) -> Array:
        given = {"x": np.array(c.x), "u": np.array(c.u), "p": np.array(c.p)}
        given[by][j] += s * scale
        return module.rhs(c.t, given["x"], p=given["p"], u=given["u"])

    return f
