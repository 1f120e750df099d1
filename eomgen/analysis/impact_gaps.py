"""Analysis: names of gaps (coordinates, outputs) -> their values, normals and rates at a state; what is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.impacts import ELSEWHERE
from ..base.names import hint, joined
from ..errors import cannot, ill_typed, incomplete, no_such, off_range
from ..runtime.input_kinds import Expressed
from ..runtime.layout import Layout
from ..runtime.near_names import without_dots
from ..runtime.room import read_number
from ..runtime.signal_rates import derive, drift, moving_inputs, rate_pairs
from ..runtime.tapes import DeclaredSignal

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing


class Gaps:
    """Coordinates and outputs that are followed as gaps.

    Parameters
    ----------
    module : BoundModel
        With parameters and constant inputs bound.
    names : sequence of str
    forcing : Forcing, optional
        Inputs that vary.
    """

    def __init__(self, module: BoundModel, names: Sequence[str], forcing: Forcing | None = None) -> None:
        self.module, self.layout, self.names, self.forcing = module, module.layout, tuple(names), forcing
        layout = module.layout
        self.outputs = [(i, layout.y.index(n)) for i, n in enumerate(names) if n not in layout.q + layout.loops]
        self.loops = [(i, layout.loops.index(n)) for i, n in enumerate(names) if n in layout.loops]
        self.tree = [(i, layout.q.index(n)) for i, n in enumerate(names) if n in layout.q]

        self._kernels: dict[str, Any] = {}

    def _kernel(self, name: str) -> Any:
        if name not in self._kernels:
            self._kernels[name] = self.module.kernels.motion(name)
        return self._kernels[name]

    def inputs(self, t: float, x: Array) -> Array | None:
        """u (n_u,) at a state; None for the module's own."""
        return self.forcing(t, x) if self.forcing else None

    def values(self, t: Any, x: Array) -> Array:
        """Of one state (n,), or of states (n_x, k) at times (k,): (n, k)."""
        q, v = np.ascontiguousarray(x[: self.layout.n_q]), np.ascontiguousarray(x[self.layout.n_q :])
        result = np.empty((len(self.names), *x.shape[1:]))
        for i, j in self.tree:
            result[i] = q[j]
        if self.loops or self.outputs:
            u = None if not self.forcing else self.forcing(t, x) if x.ndim == 1 else self.forcing.sample(t, x)
            if self.loops:
                values = self._kernel("loop_coordinates")(q, v, np.zeros_like(v), t=t, u=u)
                for i, j in self.loops:
                    result[i] = values[0, j]
            if self.outputs:
                values = self._kernel("motion_outputs")(q, v, np.zeros_like(v), t=t, u=u)
                for i, j in self.outputs:
                    result[i] = values[j]
        return result

    def normals(self, t: float, x: Array) -> Array:
        """Derivatives of the rates by v, (n, n_v).

        Raises
        ------
        UsageError
            A gap that depends on velocities.
        """
        layout, u = self.layout, self.inputs(t, x)
        q, v = np.ascontiguousarray(x[: layout.n_q]), np.ascontiguousarray(x[layout.n_q :])
        rows = np.zeros((len(self.names), layout.n_v))
        for i, _ in self.tree:
            rows[i, layout.velocity_labels.index(self.names[i])] = 1.0
        if self.loops:
            every = self.module.kernels.state("loop_coordinate_jacobian")(q, t=t, u=u)
            for i, j in self.loops:
                rows[i] = every[j]
        if self.outputs:
            slopes = self._kernel("output_derivatives")(q, v, np.zeros_like(v), t=t, u=u)
            for i, j in self.outputs:
                if np.abs(slopes[j, layout.n_q : layout.n_x + layout.n_v]).max(initial=0.0) > 0.0:
                    raise cannot(
                        f"gap {self.names[i]}: this output depends on velocities; a gap must depend on positions only"
                    )
                rows[i] = by_velocity(layout, q, slopes[j, : layout.n_q])
        return rows

    def rates(self, t: float, x: Array, rows: Array | None = None) -> Array:
        """Of one state, (n,): along v, and by themselves in time."""
        rows = self.normals(t, x) if rows is None else rows
        v = x[self.layout.n_q :]
        rates = rows @ v
        if self.outputs:
            u, each = self.inputs(t, x), Gaps(self.module, self.names)
            if u is not None:
                each.module = self.module.bind(None, u)
            rates += drift(lambda time: each.values(time, x), t)
            for i, j in self.outputs if self.layout.n_u else ():
                rates[i] += self._pushed(t, x, j)
        if self.loops:
            q = np.ascontiguousarray(x[: self.layout.n_q])
            values = self._kernel("loop_coordinates")(
                q, np.ascontiguousarray(v), np.zeros_like(v), t=t, u=self.inputs(t, x)
            )
            for i, j in self.loops:
                rates[i] = values[1, j]
        return np.asarray(rates)

    def _pushed(self, t: float, x: Array, output: int) -> float:
        """What the rates of inputs add to the rate of an output; those of inputs that are held are 0."""
        layout, n, u = self.layout, self.layout.n_x + self.layout.n_v, self.inputs(t, x)
        q, v = np.ascontiguousarray(x[: layout.n_q]), np.ascontiguousarray(x[layout.n_q :])
        slopes = self._kernel("output_derivatives")(q, v, np.zeros_like(v), t=t, u=u)[output, n : n + layout.n_u]
        rates = moving_inputs(layout, self.module.u if u is None else u)
        for index in np.flatnonzero(slopes):
            if self.forcing is not None and index in self.forcing.varying:
                rates[index] = _rate_of_input(self.forcing, int(index), t, x)
        return float(slopes @ rates)


def _rate_of_input(forcing: Forcing, index: int, t: float, x: Array) -> float:
    """The rate of an input that varies, by its place in u.

    Raises
    ------
    UsageError
        It depends on the state.
    """
    name, value = forcing.names[index], forcing.formulas.get(index, forcing.varying[index])
    words = f"input {name} depends on the state, and so does its rate, which an impact changes"
    if getattr(value, "depends_on_state", False):
        raise cannot(words)
    known = isinstance(value, Expressed) or (hasattr(value, "derivative") and value.derivative() is not None)
    if known and not isinstance(value, DeclaredSignal):
        rate = derive(name, dict(rate_pairs(forcing.layout)).get(name, f"d/dt {name}"), value)
        rate = rate.function(forcing.parameters) if isinstance(rate, Expressed) else rate
        return float(rate(t, x) if callable(rate) else rate)
    if any(forcing(t, x + move)[index] != forcing(t, x)[index] for move in ELSEWHERE * np.eye(len(x))):
        raise cannot(words)
    return float(drift(lambda time: forcing(time, x)[[index]], t)[0])


def by_velocity(layout: Layout, q: Array, slope: Array) -> Array:
    """Derivative of a rate by v from that of the value by q: N^T slope."""
    if layout.space is None:
        return slope
    return np.array([slope @ layout.space.rates(q, e) for e in np.eye(layout.n_v)])


def allowance(layout: Layout, names: Sequence[str], tolerance: float) -> Array:
    """Sizes (n,) at which gaps count as 0: a part of the model's length, or of 1 for angles."""
    return np.array([tolerance * (1.0 if layout.unit(name) == "rad" else layout.length) for name in names])


def check_gaps(
    layout: Layout, gaps: Any = None, lock: Any = (), words: tuple[str, str] = ("gaps", "lock")
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Gaps with their restitutions and the names that are locked, if all of them are there and can be.

    Parameters
    ----------
    layout : Layout
    gaps, lock
        As a user gives them.
    words : (str, str)
        What these are called where the user gives them.

    Raises
    ------
    UsageError
    """
    word, other = words
    if gaps is not None and not isinstance(gaps, Mapping):
        raise ill_typed(f"{word} must be a mapping of names to restitutions, {{name: 0.5}}, not {gaps!r}")
    locked = (lock,) if isinstance(lock, str) else lock
    if not isinstance(locked, Sequence) or not all(isinstance(name, str) for name in locked):
        raise ill_typed(f"{other} must be a list of coordinates, not {lock!r}")
    if not gaps and not locked:
        raise incomplete("an impact needs gaps={name: restitution} or lock=[coordinates]")
    if layout.given_rates:
        raise cannot("impacts need a model with q' = v, and the rates of this model's coordinates are given")
    gaps, locked = without_dots(gaps or {}, layout.instances), [layout.plain(name) for name in locked]
    coordinates = [*layout.velocity_labels, *layout.loops]
    placed = [name for name in coordinates if name in layout.q + layout.loops]
    for what, names, allowed in ((word, gaps, [*placed, *layout.y]), (other, locked, coordinates)):
        for name in names:
            if name not in allowed:
                near = joined(hint(name, allowed), f"there are {', '.join(allowed) or 'none'}")
                raise no_such(f"{what}: no coordinate or output {name!r}; {near}")
    found: dict[str, float] = {}
    for name, e in (gaps or {}).items():
        found[name] = read_number(f"{word}: the restitution of {name}", e)
        if not 0.0 <= found[name] <= 1.0:
            raise off_range(f"{word}: the restitution of {name} must be between 0 and 1, not {e}")
    return found, tuple(locked)
