"""Analysis: the result of a search for equilibrium: position, what was solved for, supports, stability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import DIFFERENCES
from ..base.limits.constraints import STATE
from ..base.texts import as_html, as_text, number, without_noise
from ..runtime.constraint_kernels import constraint_system
from ..runtime.near_names import unknown
from .balance import Balance, balance_forces, force_slopes
from .eigenvalue_rounding import stability_of_matrix
from .linear import linearize
from .linearization import Linearization
from .stability import SecondOrder, stiffness_errors, verdict

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from .search import Search, SearchPoint


class Equilibrium:
    """A position in which all forces are in balance; ``eq["theta"]`` reads a coordinate or an unknown found.

    Attributes
    ----------
    x : (n_x,) array
        The state, at rest.
    q : (n_q,) array
    coordinates : dict of str to float
        All of them, those of cut joints included.
    states : dict of str to float
        First-order states, whose rates vanish too.
    unknowns : dict of str to float
        Parameters and inputs that were solved for.
    forces : dict of str to float
        What is left of the generalized force along each independent coordinate (N, N m), and of the rates of states.
    supports : dict of str to float
        Generalized force (N, N m) that holds each held coordinate, where no unknowns balance it.
    eigenvalues : (n,) complex array
        Of the motion near it, held coordinates held (1/s).
    stability : {'asymptotically stable', 'stable (undamped)', 'marginal', 'unstable', 'no freedom'}
        By the eigenvalues, or by the sign of the stiffness; as ``Linearization.stability``.
    linear : Linearization or None
        About the equilibrium; None where supports hold it.
    module : BoundModel
        With the unknowns found bound.
    steps : int
        Steps of Newton's iteration.
    """

    def __init__(self, module: BoundModel, t: float, x: Array, found: dict[str, Any]) -> None:
        self.module, self.t, self.x, self.q = module, t, x, x[: module.n_q]
        self.coordinates: dict[str, float] = found["coordinates"]
        self.states: dict[str, float] = found["states"]
        self.unknowns: dict[str, float] = found["unknowns"]
        self.forces: dict[str, float] = found["forces"]
        self.supports: dict[str, float] = found["supports"]
        self.linear: Linearization | None = found["linear"]
        self.eigenvalues: Any = found["eigenvalues"]
        self.stability: str = found["stability"]
        self.steps: int = found["steps"]

    def __getitem__(self, name: str) -> float:
        values = {**self.coordinates, **self.states, **self.unknowns}
        if name not in values:
            raise unknown("coordinate, state or unknown", name, values)
        return values[name]

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Label and value of each line of the description."""
        layout = self.module.layout
        units = [layout.unit(name) for name in self.coordinates]
        typical = {"rad": 1.0, "m": layout.length}
        sizes = [
            max(abs(self.coordinates[name]), typical.get(unit, 0.0))
            for name, unit in zip(self.coordinates, units, strict=True)
        ]
        shown = without_noise([*self.coordinates.values()], units, sizes)
        lines = [(name, f"{value:.10g}") for name, value in zip(self.coordinates, shown, strict=True)]
        lines += [(name, f"{value:.10g}") for name, value in self.states.items()]
        lines += [(f"{name} (solved)", f"{value:.10g}") for name, value in self.unknowns.items()]
        lines += [(f"support at {name}", f"{value:.6g}") for name, value in self.supports.items()]
        lines.append(("largest force left", f"{max(map(abs, self.forces.values()), default=0.0):.2g}"))
        lines.append(("eigenvalues", ", ".join(number(value) for value in self.eigenvalues)))
        return [*lines, ("stability", self.stability)]

    def __repr__(self) -> str:
        return as_text(f"Equilibrium of {self.module.name}", self.facts)

    def _repr_html_(self) -> str:
        return as_html(f"Equilibrium of {self.module.name}", self.facts)


def describe(search: Search, point: SearchPoint, steps: int) -> Equilibrium:
    """The result at a balanced position."""
    t, module, q, s = search.t, point.module, point.q, point.s
    layout = module.layout
    held = search.gradients(module, q) if search.supported else None
    here = balance_forces(module, t, q, s, held)
    found: dict[str, Any] = {
        "coordinates": read_coordinates(module, q, t),
        "states": dict(zip(layout.states, s.tolist(), strict=True)),
        "unknowns": dict(zip(search.names, point.unknowns.tolist(), strict=True)),
        "forces": {layout.velocity_labels[k]: float(f) for k, f in zip(here.velocities, here.forces, strict=True)},
        "supports": {},
        "linear": None,
        "steps": steps,
    }
    if held is None:
        linear = linearize(module, here.x, t)
        found |= {"linear": linear, "eigenvalues": linear.eigenvalues, "stability": linear.stability}
    else:
        free = balance_forces(module, t, q, s)
        pull = algebra.lstsq((held @ free.B).T, free.forces, rcond=STATE)
        rows = search.held_rows(module, q)
        found["supports"] = {row.label: -float(f) / row.scale for row, f in zip(rows, pull, strict=True)}
        A, second = _held_motion(search, module, here, t)
        if second is None:
            stability = stability_of_matrix(A, error=DIFFERENCES)
        else:
            stability = verdict(second, A, error=DIFFERENCES)
        found |= {"eigenvalues": np.sort_complex(algebra.eigvals(A)), "stability": stability}
    return Equilibrium(module, t, here.x, found)


def _held_motion(search: Search, module: BoundModel, here: Balance, t: float) -> tuple[Array, SecondOrder | None]:
    """A of the motion with the held coordinates held, and its equations of second order where it has such."""
    n_q, s = module.n_q, module.layout.scales.q
    tree = module.kernels.mass_matrix(here.x[:n_q], t=t)
    M = here.B.T @ tree @ here.B
    slopes, rates = force_slopes(module, t, here, lambda q: search.gradients(module, q))
    kept = here.positions < len(s) - here.n_states  # states are among the velocities
    positions, slopes, rates = here.positions[kept], slopes[:, kept], rates[:, kept]
    damping = module.jacobian(t, here.x)[n_q:, n_q:]
    K, C = -slopes, -here.B.T @ tree @ damping @ here.B
    A = np.block([
        [rates[positions], here.B[positions]],
        [-algebra.solve(M, K), -algebra.solve(M, C)],
    ])  # fmt: skip
    if len(positions) != len(M) or np.any(here.v):
        return A, None
    K_error = stiffness_errors(M, A[len(M) :, : len(M)], np.zeros(0), s[positions], DIFFERENCES)
    C_error = DIFFERENCES * np.abs(here.B).T @ np.abs(tree) @ np.abs(damping) @ np.abs(here.B)
    return A, SecondOrder(M, C, K, C_error, K_error)


def read_coordinates(module: BoundModel, q: Array, t: float) -> dict[str, float]:
    """All coordinates by name, those of cut joints included."""
    values = dict(zip(module.q_names, q.tolist(), strict=True))
    if module.layout.n_loop_coordinates:
        y = constraint_system(module.kernels).cut.evaluate(q, t)[0]
        values |= dict(zip(module.layout.loops, y.tolist(), strict=True))
    return values
