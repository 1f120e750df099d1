"""Stage describe, checks of bodies: masses and inertias that no rigid body can have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..frames import GROUND
from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.substitute import symbols_of
from ..graph.vectors import Mat3, Vec3
from ..limits.descriptions import TENSOR, TENSOR_TERMS
from ..limits.inertia import COMPUTED
from ..numeric.rigid_inertia import EXCESS, SWITCH, fault_of_inertia, inertia_scales, longest_within
from .description import Faults
from .mechanism import Body, JointSpec


def check_bodies(
    bodies: Sequence[Body], joints: Sequence[JointSpec], values: Mapping[str, float], faults: Faults
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Note masses and inertias that no body can have, as far as the declared values of parameters tell.

    Returns
    -------
    negative : tuple of str
        Names of bodies with a negative mass or moment that are taken as they are.
    notes : tuple of str
        What of them is to be noted.
    """
    notes: list[str] = []
    negative: dict[str, None] = {}
    masses = [_numbers([body.mass], values) for body in bodies]
    tensors = [_numbers([entry for row in body.inertia for entry in row], values) for body in bodies]
    scales = inertia_scales(
        [0.0 if mass is None else mass[0] for mass in masses],
        [np.reshape(tensor or np.zeros(9), (3, 3)) for tensor in tensors],
        _longest(bodies, joints, values),
    )
    for body, mass, tensor, scale in zip(bodies, masses, tensors, scales, strict=True):
        path = f"bodies.{body.name}"
        found: list[tuple[str, str, str]] = []
        if mass is not None and mass[0] < 0:
            how = "" if body.mass.value is not None else " at the declared values"
            found.append((f"{path}.mass", f"is {mass[0]:g}{how}", f"give a mass of 0 or more, {SWITCH}"))
        if not faults.under(f"{path}.inertia"):
            if not is_symmetric(body.inertia, tensor, COMPUTED * scale):
                found.append((f"{path}.inertia", *ASYMMETRIC))
            elif tensor is not None:
                plane = None if body.plane is None else _numbers(body.plane, values)
                if fault := fault_of_inertia(tensor, plane, scale):
                    found.append((f"{path}.inertia", *fault))
        for place, message, remedy in found:
            if body.check == "error":
                faults.add(place, message, remedy)
            else:
                if remedy not in (EXCESS, ASYMMETRIC[1]):
                    negative[body.name] = None
                if body.check == "note":
                    notes.append(f"{place}: {message}; it is used as given")
    return tuple(negative), tuple(notes)


def _longest(bodies: Sequence[Body], joints: Sequence[JointSpec], values: Mapping[str, float]) -> float:
    """The longest distance (m) within a body of its centre of mass, its joints and the point its inertia is about.

    Points that are not known at the declared values, and the centre of no mass, do not count.
    """
    points: list[list[Vec3]] = [[] if body.mass.is_zero else [body.com] for body in bodies]
    for own, body in zip(points, bodies, strict=True):
        own += [] if body.about is None else [body.about]
    for spec in joints:
        for marker in (spec.predecessor, spec.successor):
            if marker.body != GROUND:
                points[marker.body].append(marker.frame.position)
    known = [[_numbers(point, values) for point in own] for own in points]
    return longest_within([point for point in own if point is not None] for own in known)


def _numbers(expressions: Sequence[Expr], values: Mapping[str, float]) -> list[float] | None:
    if not symbols_of(expressions) <= values.keys():
        return None
    result = [float(x) for x in evaluate(expressions, values)]
    return result if np.all(np.isfinite(result)) else None


ASYMMETRIC = ("the tensor is not symmetric", "entries [i][j] and [j][i] must be equal")


def is_symmetric(inertia: Mat3, tensor: Sequence[float] | None = None, computed: float = 0.0) -> bool:
    """Whether a tensor equals its mirror image: at its values if they are known, else wherever one looks.

    ``computed`` is what rounding may leave of its entries (kg m^2).
    """
    pairs = [(inertia[i][j], inertia[j][i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    if all(a == b for a, b in pairs):
        return True
    if tensor is not None:
        full = np.reshape(tensor, (3, 3))
        atol = max(TENSOR_TERMS * float(np.max(np.abs(full), initial=0.0)), computed)
        return bool(np.allclose(full, full.T, rtol=TENSOR, atol=atol))
    # written differently above and below the diagonal: equal if they agree wherever one looks
    flat = [x for pair in pairs for x in pair]
    names = sorted(symbols_of(flat))
    for seed in (1, 2, 3):
        draws = np.random.default_rng(seed).uniform(0.5, 1.5, len(names))
        result = np.asarray(evaluate(flat, dict(zip(names, draws.tolist(), strict=True))), dtype=float)
        if not np.allclose(result[::2], result[1::2], rtol=TENSOR, atol=TENSOR_TERMS):
            return False
    return True
