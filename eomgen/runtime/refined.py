"""Stage runtime: steps of a run -> states between them, for curves and animations that look smooth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array

if TYPE_CHECKING:
    from .bound_model import BoundModel
    from .columns import Columns

FINE = 1000  #: points of a smooth curve, about
#: Error of the trapezoidal rule, in sizes of its terms, above which points are too far apart for a curve.  For a sine
#: it is 0.05 at most over one radian and 0.22 over two; beyond that a curve is a guess.
APART = 0.5
ENERGIES = ("T", "V", "energy")  #: columns of every run, unless the model has these names for its own


def cubic_between(t: Array, x: Array, slopes: Array | None, times: Array) -> Array:
    """States (n, k) at times (k,) within a run: cubics through the states and slopes of its steps.

    Without slopes straight lines, and likewise where the slopes say nothing of what is between two points that are far
    apart (``t_eval=[0, 60]``): where they are not those of a curve from one state to the other.  Where a time stands
    twice, as at an event that resets the state, the second state begins the next piece.

    Parameters
    ----------
    t : (m,) array
        Ascending or descending.
    x, slopes : (n, m) arrays
    times : (k,) array
    """
    way = 1.0 if t[-1] >= t[0] else -1.0
    k = np.clip(np.searchsorted(way * t, way * times, side="right") - 1, 0, len(t) - 2)
    h = t[k + 1] - t[k]
    s = np.where(h == 0.0, 1.0, (times - t[k]) / np.where(h == 0.0, 1.0, h))
    if slopes is None:
        straight: Array = x[:, k] + s * (x[:, k + 1] - x[:, k])
        return straight
    # Hermite's basis on [0, 1]
    start, end = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * s * (3.0 - 2.0 * s)
    cubic: Array = start * x[:, k] + end * x[:, k + 1]
    cubic += h * (s * (1.0 - s) ** 2 * slopes[:, k] - s * s * (1.0 - s) * slopes[:, k + 1])
    gone, told = x[:, k + 1] - x[:, k], 0.5 * h * (slopes[:, k] + slopes[:, k + 1])
    far = abs(gone - told) > APART * (abs(gone) + 0.5 * abs(h) * (abs(slopes[:, k]) + abs(slopes[:, k + 1])))
    return np.where(far, x[:, k] + s * gone, cubic)


def states_at(trajectory: Any, module: BoundModel, times: Array) -> tuple[Array, Array | None]:
    """States (n_x, k) of a run at times within it, on the constraints, and inputs (n_u, k) or None without any.

    The dense output of the run serves where it was kept.
    """
    names = module.u_names
    if trajectory.has_dense_output:
        dense = trajectory.at(times)
        return dense.x, dense.to_numpy(*names) if names else None
    slopes = getattr(trajectory.columns, "slopes", None)
    u = cubic_between(trajectory.t, trajectory.to_numpy(*names), None, times) if names else None
    states = cubic_between(trajectory.t, trajectory.x, slopes, times)
    if module.n_rows or module.layout.space:
        states = module.project(states, t=times, u=u)
    return states, u


def monotone_slopes(t: Array, y: Array) -> Array:
    """Slopes (m,) of a cubic through values (m,) that has no extremes between them (Fritsch and Butland 1984).

    A constant stays constant and a drift shows at the steps only.  Where a time stands twice a new curve begins.
    """
    h = np.diff(t)
    secants = np.where(h == 0.0, 0.0, np.diff(y) / np.where(h == 0.0, 1.0, h))
    before, after = np.append(secants[0], secants), np.append(secants, secants[-1])
    first, last = np.append(True, h == 0.0), np.append(h == 0.0, True)
    same = before * after > 0.0
    mean = np.where(same, 2.0 * before * after / np.where(same, before + after, 1.0), 0.0)
    slopes: Array = np.where(first, after, np.where(last, before, mean))
    return slopes


def refined_energies(trajectory: Any, times: Array, columns: Columns) -> Array:
    """Kinetic, potential and total energy (3, k) at times between the steps of a run.

    States between the steps have the error of their cubics, which is far above what the integrator lets the energy
    drift.  The total is taken at the steps; the potential energy, which needs positions only, at all times.
    """
    total = trajectory.energies[2]
    slopes = monotone_slopes(trajectory.t, total)
    E = cubic_between(trajectory.t, total[None], slopes[None], times)[0]
    V = columns.energies[1]
    return np.array([E - V, V, E])


def refined(trajectory: Any, names: tuple[str, ...]) -> tuple[Array, dict[str, Array]]:
    """Times and columns of a run, with points between its steps where they are few and the model is at hand."""
    t, columns, _ = _between_steps(trajectory, names, False)
    return t, columns


def refined_energy(trajectory: Any) -> tuple[Array, Array]:
    """Times and kinetic, potential and total energy (3, k) of a run, likewise."""
    t, _, energies = _between_steps(trajectory, (), True)
    assert energies is not None
    return t, energies


def _between_steps(
    trajectory: Any, names: tuple[str, ...], energies: bool
) -> tuple[Array, dict[str, Array], Array | None]:
    from ..errors import EvaluationError
    from .columns import Columns

    t = trajectory.t
    parts = -(-FINE // max(1, len(t) - 1))
    module = getattr(trajectory.columns, "module", None)
    if module is not None and type(trajectory.columns) is Columns and parts > 1 and len(t) > 1 and t[0] != t[-1]:
        steps = np.arange(parts) / parts
        times = np.append((t[:-1, None] + np.diff(t)[:, None] * steps).ravel(), t[-1])
        times = times[np.append(True, np.diff(times) != 0.0)]
        layout = module.layout
        own = [n for n in names if n in ENERGIES and n not in layout.x + layout.loops + layout.y + layout.u]
        try:
            states, u = states_at(trajectory, module, times)
            columns = Columns(module, times, states, np.empty((0, len(times))) if u is None else u)
            found = {name: columns[name] if name != "t" else times for name in names if name not in own}
            three = refined_energies(trajectory, times, columns) if energies or own else None
            if three is not None:
                found |= {name: three[ENERGIES.index(name)] for name in own}
            return times, found, three
        except EvaluationError:  # the cubic left what the model allows: its steps are drawn
            pass
    return t, {name: trajectory[name] for name in names}, trajectory.energies if energies else None
