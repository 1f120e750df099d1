"""Analysis: names of outputs by which gaps slide -> sliding velocities and their rows at a state; what is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.impacts import ROUNDED
from ..base.names import hint, joined
from ..errors import UsageError, ill_placed, ill_typed, no_such, off_range
from ..runtime.layout import Layout
from ..runtime.near_names import without_dots
from ..runtime.room import read_number
from .impact_friction import Sliding
from .impact_gaps import Gaps

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing

#: Gap -> coefficient of friction and names of the sliding velocities.
Rough = Mapping[str, tuple[float, tuple[str, ...]]]

#: Units of gaps and sliding velocities whose impulses are in N s or N m s.
RATES = ("m/s", "m*s^-1", "m s^-1", "rad/s", "1/s")
SI = ("", "m", "rad", *RATES)


def check_friction(layout: Layout, friction: Any, gaps: Mapping[str, float], word: str = "friction") -> Rough:
    """Coefficients of friction of gaps and what slides there, if all of it is there and can be.

    Parameters
    ----------
    layout : Layout
    friction
        As a user gives it: {gap: (coefficient, name or two names)}.
    gaps : mapping of str to float
        The gaps of the call.
    word : str
        What it is called where the user gives it.

    Raises
    ------
    UsageError
    """
    if friction is None:
        return {}
    if not isinstance(friction, Mapping):
        raise ill_typed(f"{word} must be a mapping {{gap: (coefficient, sliding velocity)}}, not {friction!r}")
    found: dict[str, tuple[float, tuple[str, ...]]] = {}
    placed = [name for name in (*layout.velocity_labels, *layout.loops) if name in layout.q + layout.loops]
    allowed = [*placed, *layout.y]
    for gap, given in without_dots(friction, layout.instances).items():
        if gap not in gaps:
            raise no_such(f"{word}: {gap!r} is no gap of this call; {joined(hint(gap, gaps), _listed(gaps))}")
        if isinstance(given, str) or not isinstance(given, Sequence) or len(given) != 2:
            raise ill_typed(
                f"{word}: of gap {gap} give the coefficient and the output that is its sliding velocity, "
                f"(0.3, 'slide'), not {given!r}"
            )
        mu = read_number(f"{word}: the coefficient of {gap}", given[0])
        if not mu >= 0.0:
            raise off_range(f"{word}: the coefficient of {gap} must be 0 or greater, not {given[0]}")
        names = (given[1],) if isinstance(given[1], str) else tuple(given[1])
        if not 1 <= len(names) <= 2 or not all(isinstance(name, str) for name in names):
            raise ill_typed(
                f"{word}: of gap {gap} give one sliding velocity, or two at right angles in space, not {given[1]!r}"
            )
        names = tuple(layout.plain(name) for name in names)
        for name in names:
            if name not in allowed:
                near = joined(hint(name, allowed), _listed(allowed))
                raise no_such(f"{word}: no coordinate or output {name!r} for the sliding of {gap}; {near}")
        for name in (gap, *names):
            if layout.unit(name) not in SI:
                raise UsageError(
                    f"{word}: the output {name} is in {layout.unit(name)}, and friction at {gap} needs SI units: give "
                    "another output without a unit",
                    code="EG-UNIT",
                )
        found[gap] = mu, names
    return found


def _listed(names: Any) -> str:
    return f"there are {', '.join(names) or 'none'}"


def _is_velocity(layout: Layout, output: str) -> bool:
    """Whether an output is a velocity by how it is written or by its unit, though perhaps no velocity moves it."""
    return output in layout.metadata.get("velocity_outputs", ()) or layout.unit(output) in RATES


def find_sliding(
    module: BoundModel, rough: Rough, gaps: Sequence[str], t: float, x: Array, forcing: Forcing | None = None
) -> Sliding:
    """The sliding velocities of gaps at a state.

    Parameters
    ----------
    module : BoundModel
        With parameters and inputs bound.
    rough : mapping
        As from :func:`check_friction`.
    gaps : sequence of str
        All gaps of the impact.
    t : float
    x : (n_x,) array
    forcing : Forcing, optional
        Inputs that vary.

    Raises
    ------
    UsageError
        An output is not linear in the velocities.
    """
    layout, n_q = module.layout, module.layout.n_q
    names = [name for gap in gaps if gap in rough for name in rough[gap][1]]
    owner = np.array([i for i, gap in enumerate(gaps) if gap in rough for _ in rough[gap][1]], dtype=np.int64)
    mu = np.array([rough[gap][0] if gap in rough else 0.0 for gap in gaps])
    rows, rates = np.zeros((len(names), layout.n_v)), np.zeros(len(names))
    q, v = np.ascontiguousarray(x[:n_q]), np.ascontiguousarray(x[n_q:])
    still = np.zeros_like(v)
    outputs = any(name in layout.y for name in names)
    slopes, rest, values = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
    if outputs:
        slopes, rest = (module.kernels.motion("output_derivatives")(q, w, still, t=t) for w in (v, still))
        values = module.kernels.motion("motion_outputs")(q, v, still, t=t)
    for k, name in enumerate(names):
        j = layout.y.index(name) if name in layout.y else -1
        if j < 0 or not (_is_velocity(layout, name) or slopes[j, n_q : layout.n_x].any()):  # a place, whose rate it is
            own = Gaps(module, (name,), forcing)
            rows[k], rates[k] = own.normals(t, x)[0], own.rates(t, x)[0]
            continue
        by_v = slopes[j, n_q : layout.n_x]
        uneven = np.abs(by_v - rest[j, n_q : layout.n_x]) > ROUNDED * np.abs(by_v)
        if uneven.any() or np.abs(slopes[j, layout.n_x : layout.n_x + layout.n_v]).max(initial=0.0) > 0.0:
            raise ill_placed(
                f"output {name} cannot be the sliding velocity of {gaps[owner[k]]}: it must be linear in the "
                "velocities and know no accelerations, as vx(rod.tip)"
            )
        rows[k], rates[k] = by_v, values[j]
    return Sliding(tuple(names), owner, mu, rows, rates)
