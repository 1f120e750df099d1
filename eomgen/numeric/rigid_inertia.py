"""Numeric: mass, inertia about the centre of mass -> what no rigid body can have, or nothing.

A body is possible where its pseudo-inertia matrix is positive semidefinite: mass not negative, principal moments not
negative and none above the sum of the other two (Wensing, Kim, Slotine, IEEE Robotics and Automation Letters 3,
2018).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.limits.numbers import COMPUTED, DIGITS, MOMENT, ROUNDED, TRIANGLE
from . import algebra

#: What may be done about a body or a motion without a possible inertia, by the word of ``check_inertia``.
CHECKS = ("error", "note", "off")


SWITCH = "or accept it with check_inertia: note (an option of load too, and --check-inertia)"
SHIFTED = f"give a moment of at least m d^2 about a point at the distance d, {SWITCH}"
NEGATIVE = (
    "check the signs of the products (xy, xz, yz are entries of the tensor: minus the integral of x y dm) and the "
    f"point that the inertia is about, {SWITCH}"
)
EXCESS = (
    "no rigid body has such moments; check the units (kg m^2) and the point (the centre of mass, unless about gives "
    f"another), {SWITCH}"
)


def word_of_check(value: object) -> str | None:
    """The word that a value of ``check_inertia`` means, true being ``error`` and false ``off``; None for no such."""
    if isinstance(value, bool):
        return "error" if value else "off"
    return value if isinstance(value, str) and value in CHECKS else None


@np.errstate(over="ignore", invalid="ignore")
def longest_within(bodies: Iterable[Sequence[ArrayLike]]) -> float:
    """The longest distance between two points of one body, wherever the frames of bodies lie.

    Parameters
    ----------
    bodies : iterable of sequences of (3,) arrays
        Points of each body in its own frame (m): its centre of mass and its joints.

    Returns
    -------
    float
        m; 0 where no body has two points that differ by more than their rounding.
    """
    longest = 0.0
    for points in bodies:
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        size = float(np.abs(places).max(initial=0.0))
        places = places / (size or 1.0)  # squares of what is large overflow
        for k, place in enumerate(places):
            apart = float(np.linalg.norm(places[k + 1 :] - place, axis=1).max(initial=0.0))
            longest = max(longest, apart * size if apart > ROUNDED else 0.0)
    return longest


@np.errstate(over="ignore", invalid="ignore")
def inertia_scales(masses: Sequence[float], tensors: Sequence[ArrayLike], length: float) -> list[float]:
    """m l^2 of each body, which what rounding leaves of its inertia is judged by.

    Parameters
    ----------
    masses : sequence of float
        kg; a body without mass counts with the largest of all, a mechanism without mass by its largest moment.
    tensors : sequence of (3, 3) arrays
        kg m^2.
    length : float
        Of :func:`longest_within` (m): the programs that compute inertias shift them over such distances.  If it is 0,
        the largest radius of gyration takes its place.

    Returns
    -------
    list of float
        kg m^2.
    """
    heaviest = max((abs(m) for m in masses), default=0.0)
    if heaviest == 0.0:
        return [max((float(np.abs(tensor).max()) for tensor in tensors), default=0.0)] * len(masses)
    sizes = [abs(m) or heaviest for m in masses]
    square = length * length or max(abs(float(np.trace(tensor))) / m for m, tensor in zip(sizes, tensors, strict=True))
    return [m * square for m in sizes]


def fault_of_inertia(
    tensor: ArrayLike, plane: Sequence[float] | None = None, scale: float = 0.0
) -> tuple[str, str] | None:
    """What is wrong with an inertia about the centre of mass.

    Parameters
    ----------
    tensor : (3, 3) array
        Symmetric, kg m^2.
    plane : three numbers, optional
        The axis of a body that moves in a plane only, of which one moment was given: only that moment is judged.
    scale : float, optional
        m l^2 (kg m^2) of :func:`inertia_scales`; moments below its rounding say nothing.

    Returns
    -------
    (message, remedy) or None
        None for what a distribution of mass can have.  Two moments that are 0 pass: one moment alone is that of a body
        that moves in a plane.
    """
    full = np.asarray(tensor, dtype=float).reshape(3, 3)
    largest = float(np.abs(full).max())
    if not math.isfinite(largest):
        return "has an entry that is not finite", "give finite numbers, whose products are finite too"
    unit = 2.0 ** (math.frexp(largest)[1] - 1)  # a power of two: exact, and no sum of entries overflows
    full, computed = full / unit, COMPUTED * (scale / unit)
    if plane is not None:
        n = np.asarray(plane, dtype=float)
        moment, size = float(n @ full @ n), float(np.abs(full).max())
        if moment < -max(DIGITS * size, computed):
            return f"the moment about the centre of mass is {moment * unit:.6g}", SHIFTED
        return None
    a, b, c = algebra.eigvalsh(full).tolist()
    size = max(abs(a), abs(c))
    if a < -max(DIGITS * size, computed):
        return f"has a negative principal moment {a * unit:.6g}", NEGATIVE
    if b > max(MOMENT * size, computed) and c > (1 + TRIANGLE) * (a + b) + computed:
        shown = ", ".join(f"{moment * unit:.6g}" for moment in (a, b, c))
        return f"principal moments {shown}: one exceeds the sum of the others", EXCESS
    return None
