"""Stage runtime: outputs and places of markers by name -> functions of q and v that a state can be assembled to.

An output of q and t alone, and a place such as ``x(rod.tip)``, is wanted of a position; an output that is linear in the
velocities, such as ``vx(rod.tip)``, of the velocities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError
from ..limits.runs import DIFFERENCE
from ..numeric.constraint_system import ConstraintSystem, CutJoints
from ..numeric.scales import Array
from .kernels import Kernels
from .layout import Layout
from .near_names import UnknownNameError, place_of_marker, unknown
from .show_parts import load_show


class WantedPosition(NamedTuple):
    """A function of q and t."""

    name: str
    scale: float  #: typical size
    evaluate: Callable[[Array, float], tuple[float, Array]]  #: (q, t) -> y, dy/dq (n_q,)


class WantedRate(NamedTuple):
    """An output that is linear in the velocities: y = y_v v + y_0."""

    name: str
    scale: float
    evaluate: Callable[[Array, float], tuple[Array, float]]  #: (q, t) -> y_v (n,), y_0

    def at(self, q: Array, t: float) -> tuple[Array, float, float]:
        """y_v (n,), y_0 and the typical size."""
        return (*self.evaluate(q, t), self.scale)


def admit(initial: Any, name: str, plain: str) -> str:
    """Make a name that is no coordinate a value that can be held, if it can be one; returns the name as it is listed.

    ``initial`` is an :class:`~.initial.Initial`, ``plain`` the name of an instance's element without dots.
    """
    if plain in initial.wanted_rates or name in initial.coordinates:
        return plain if plain in initial.wanted_rates else name
    found = find_wanted(initial.kernels, plain if plain in initial.layout.y else name, initial.t)
    if found is None:
        return plain
    if isinstance(found, WantedRate):
        initial.wanted_rates[plain] = found
    else:
        initial.system = with_wanted(initial.system, [found])
        initial.coordinates += (found.name,)
    return found.name


def find_wanted(kernels: Kernels, name: str, t: float) -> WantedPosition | WantedRate | None:
    """The function that an output or a place of a marker is; None if the name is neither.

    Raises
    ------
    UsageError
        An output that depends on accelerations, or on velocities otherwise than linearly; no such marker.
    """
    if found := place_of_marker(name):
        return _place(kernels, name, found[1], "xyz".index(found[0]))
    return _output(kernels, name, t) if name in kernels.layout.y else None


def with_wanted(system: ConstraintSystem, wanted: Sequence[WantedPosition]) -> ConstraintSystem:
    """The constraints with these functions among the coordinates that can be held."""
    cut, space = system.cut, system.scales

    def evaluate(q: Array, t: float) -> tuple[Array, Array]:
        y, y_q = cut.evaluate(q, t)
        moves = np.stack([space.rates(q, unit) for unit in np.eye(len(space.q))], axis=1)
        found = [function.evaluate(q, t) for function in wanted]
        rows = np.array([slope @ moves for _, slope in found])
        return np.concatenate([y, [value for value, _ in found]]), np.vstack([y_q.reshape(-1, len(space.q)), rows])

    names = tuple(function.name for function in wanted)
    scales = np.concatenate([cut.scales, [function.scale for function in wanted]])
    extended = CutJoints(cut.names + names, cut.kinds + ("turn",) * len(names), scales, evaluate)
    return system._replace(cut=extended)


def _output(kernels: Kernels, name: str, t: float) -> WantedPosition | WantedRate:
    layout = kernels.layout
    n_q, n_v, k = layout.n_q, layout.n_v, layout.y.index(name)
    outputs, slopes = kernels.motion("motion_outputs"), kernels.motion("output_derivatives")
    zero = np.zeros(n_v)
    probes = [slopes(layout.q_reference, v, zero, t=t)[k] for v in (zero, np.linspace(0.3, 1.1, n_v))]
    by_v, by_a = (np.array([probe[a : a + n_v] for probe in probes]) for a in (n_q, n_q + n_v))
    if by_a.any() or not np.allclose(*by_v):
        on = "accelerations" if by_a.any() else "velocities, and not linearly"
        raise UsageError(f"the output {name!r} depends on {on}, so it cannot be an initial value; give coordinates")

    def position(q: Array, t: float) -> tuple[float, Array]:
        return float(outputs(q, zero, zero, t=t)[k]), np.asarray(slopes(q, zero, zero, t=t)[k, :n_q])

    def rate(q: Array, t: float) -> tuple[Array, float]:
        return np.asarray(slopes(q, zero, zero, t=t)[k, n_q : n_q + n_v]), float(outputs(q, zero, zero, t=t)[k])

    row = by_v[0] if by_v.any() else probes[0][:n_q]
    scale = _scale(layout, layout.unit(name).removesuffix("/s"), row)
    return WantedRate(name, scale, rate) if by_v.any() else WantedPosition(name, scale, position)


def _scale(layout: Layout, unit: str, gradient: Array) -> float:
    known = {"m": layout.length, "rad": 1.0}
    return known.get(unit) or float(np.abs(gradient).max(initial=0.0)) or 1.0


def _place(kernels: Kernels, name: str, marker: str, axis: int) -> WantedPosition:
    layout, poses = kernels.layout, kernels.state("poses")
    data = load_show("data", "initial values at markers").read_picture(layout.metadata, kernels.context.p)
    if marker not in data.markers:
        raise unknown("marker", marker, data.markers)
    frame = data.markers[marker]
    if frame.body < 0:
        raise UnknownNameError(f"{name!r} is a place on the ground, which does not move")

    def value(q: Array, t: float) -> float:
        pose = poses(q, t=t)[frame.body]
        return float(pose[axis, :3] @ frame.position + pose[axis, 3])

    def evaluate(q: Array, t: float) -> tuple[float, Array]:
        steps = DIFFERENCE * np.where([kind == "length" for kind in layout.coordinate_kinds], layout.length, 1.0)
        moves = np.diag(steps)
        slope = [(value(q + dq, t) - value(q - dq, t)) / (2.0 * h) for dq, h in zip(moves, steps, strict=True)]
        return value(q, t), np.array(slope)

    return WantedPosition(name, layout.length, evaluate)
