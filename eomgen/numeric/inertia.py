"""Numeric: mass, inertia about the centre of mass -> what no rigid body can have, or nothing.

A body is possible where its pseudo-inertia matrix is positive semidefinite: mass not negative, principal moments not
negative and none above the sum of the other two (Wensing, Kim, Slotine, IEEE Robotics and Automation Letters 3,
2018).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

#: A moment may exceed the sum of the other two by this part of it before it counts as wrong: published inertias of real
#: machines, measured or rounded, exceed it by up to a tenth (PUMA 560, link 3).
TRIANGLE = 0.1
#: A moment may be negative by this part of the largest one, from rounding.
ROUNDING = 1e-6


SWITCH = "check_inertia: false takes it as it is"
SHIFTED = f"an inertia about another point is at least m d^2; {SWITCH}"
NEGATIVE = (
    "check the products: xy, xz, yz bear the tensor's own sign (minus the integral of x y dm), and the point it is "
    f"about; {SWITCH}"
)
EXCESS = (
    "no body has such an inertia; it is taken about the centre of mass unless about says otherwise, in kg m^2; "
    f"{SWITCH}"
)


def fault_of_inertia(tensor: ArrayLike, plane: Sequence[float] | None = None) -> tuple[str, str] | None:
    """What is wrong with an inertia about the centre of mass.

    Parameters
    ----------
    tensor : (3, 3) array
        Symmetric, kg m^2.
    plane : three numbers, optional
        The axis of a body that moves in a plane only, of which one moment was given: only that moment is judged.

    Returns
    -------
    (message, remedy) or None
        None for what a distribution of mass can have.  Two moments that are 0 pass: one moment alone is that of a body
        that moves in a plane.
    """
    full = np.asarray(tensor, dtype=float).reshape(3, 3)
    if plane is not None:
        n = np.asarray(plane, dtype=float)
        moment, size = float(n @ full @ n), float(np.abs(full).max())
        if moment < -ROUNDING * size:
            return f"the moment about the centre of mass is {moment:.6g}", SHIFTED
        return None
    a, b, c = np.linalg.eigvalsh(full)
    size = max(abs(a), abs(c))
    if a < -ROUNDING * size:
        return f"has a negative principal moment {a:.6g}", NEGATIVE
    if b > 1e-9 * size and c > (1 + TRIANGLE) * (a + b):
        return f"principal moments {a:.6g}, {b:.6g}, {c:.6g}: one exceeds the sum of the others", EXCESS
    return None
