"""Analysis: a place that cannot be reached -> which joint stays open there, and by how much."""

from __future__ import annotations

import numpy as np

from ..numeric.closure import Equations, System, close
from ..numeric.scales import Array
from .following import Follower


def describe_gap(follower: Follower, t: float, y: Array, near: Array) -> str:
    """The largest gap that is left when all equations are met as well as they can be.

    Parameters
    ----------
    follower : Follower
    t : float
    y : (n_led,) array
        Values of the led coordinates.
    near : (n_q,) array
        A closed position beside it.
    """
    layout = follower.layout

    def position(q: Array) -> tuple[Array, Array]:
        return follower.closure(q, t)

    def led(q: Array) -> tuple[Array, Array]:
        return follower.led_values(q, t), follower.matrix(q, t)[layout.n_c :] / follower.scales.q * follower.led_scales[
            :, None
        ]

    equations = Equations(led, y, follower.led_scales, follower.wraps.tolist(), follower.led) if len(y) else None
    system = System(position, follower.scales, np.ones(layout.n_v), equations)
    with np.errstate(all="ignore"):
        q, _ = close(system, near)
    C = follower.closure(q, t)[0]
    worst = int(np.argmax(np.abs(follower.scales.residual(C)))) if C.size else -1
    gap = abs(float(C[worst])) if C.size else 0.0
    labels = [*layout.constraint_labels]
    if len(y):
        miss = np.abs(follower.led_values(q, t) - y)
        k = int(np.argmax(miss / follower.led_scales))
        if not C.size or miss[k] / follower.led_scales[k] > abs(follower.scales.residual(C)[worst]):
            return f"beyond, {follower.led[k]} would miss its value by {miss[k]:.3g}"
    unit = "m" if layout.metadata.get("constraint_kinds", ())[worst] == "length" else "rad"
    place = (
        f"at t = {t:.6g} s" if not len(y) else ", ".join(f"{n} = {v:.6g}" for n, v in zip(follower.led, y, strict=True))
    )
    return f"beyond, {place}, {labels[worst]} stays open by {gap:.3g} {unit}"
