"""Analysis: a place that cannot be reached -> which joint stays open there, and by how much."""

from __future__ import annotations

import numpy as np

from ..base.algebra import Array
from ..base.limits.constraints import CONTRADICTION
from ..errors import TO_BE_FINITE
from ..numeric.closure import close
from .driven_coordinates import DrivenCoordinates


def describe_gap(driven: DrivenCoordinates, t: float, y: Array, near: Array) -> str:
    """The largest gap that is left when all equations are met as well as they can be.

    Parameters
    ----------
    driven : DrivenCoordinates
    t : float
    y : (n_led,) array
        Values of the led coordinates.
    near : (n_q,) array
        A closed position beside it.
    """
    layout, scales = driven.layout, driven.scales
    system, led = driven.system.at(t), dict(zip(driven.led, y.tolist(), strict=True))
    with np.errstate(all="ignore"):  # coordinates of the tree are held exactly, so that the gap opens at a joint
        q, _ = close(system.closure(led), system.with_values(near, led))
    position = system.position
    C = position(q)[0]
    if not C.size:
        return "beyond it, all joints close"
    gaps = np.abs(scales.residual(C))
    undefined = ~np.isfinite(position(np.array(near))[0])  # whatever the position, by the time
    if undefined.any():
        owners = dict.fromkeys(layout.constraint_labels[i].partition(".")[0] for i in np.flatnonzero(undefined))
        what = f"no finite value: {TO_BE_FINITE}"
        return f"beyond it, at t = {t:.6g} s, {', '.join(owners)} has {what}"
    place = ", ".join(f"{n} = {v:.6g}" for n, v in zip(driven.led, y, strict=True)) or f"t = {t:.6g} s"
    if not gaps.max() > CONTRADICTION:
        return f"beyond it, at {place}, the loops close again: a driver's value jumps, or is out of reach in between"
    joints = [k for k, label in enumerate(layout.constraint_labels[: len(C)]) if not label.endswith(".motion")]
    if joints and gaps[joints].max() > CONTRADICTION:  # rather than the driver
        worst = joints[int(np.argmax(gaps[joints]))]
    else:
        worst = int(np.argmax(gaps))
    unit = "m" if layout.metadata["constraint_kinds"][worst] == "length" else "rad"
    return f"beyond it, at {place}, {layout.constraint_labels[worst]} stays open by {abs(C[worst]):.3g} {unit}"
