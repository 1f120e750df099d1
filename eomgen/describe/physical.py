"""Masses and inertias that no rigid body can have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.numbers import COMPUTED, TENSOR, TENSOR_TERMS
from ..base.value_rules import BODIES, EXCESS, NOT_NEGATIVE, SWITCH, inertia_scales, judge_bodies, longest_within
from ..frames import GROUND
from ..graph.core import Expr, symbols_of
from ..graph.evaluate import evaluate
from ..graph.vectors import Mat3, Vec3
from .mechanism import Body, JointSpec
from .requirements import Requirements


def check_bodies(
    bodies: Sequence[Body], joints: Sequence[JointSpec], requirements: Requirements
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Note masses and inertias that no body can have, as far as the values of parameters tell.

    Returns
    -------
    negative : tuple of str
        Names of bodies with a negative mass or moment that are taken as they are.
    notes : tuple of str
        What of them is to be noted.
    """
    notes: list[str] = []
    negative: dict[str, None] = {}
    faults = requirements.faults
    masses = [requirements.known([body.mass]) for body in bodies]
    tensors = [requirements.known(_entries(body)) for body in bodies]
    numbers = [_numbers_of(body, points) for body, points in zip(bodies, _points(bodies, joints), strict=True)]
    values = [x for own in numbers for group in own for x in _known(requirements, group)]
    flaws = judge_bodies(values, [_described(*one, True) for one in zip(bodies, numbers, strict=True)])
    scales = inertia_scales(
        [0.0 if mass is None else mass[0] for mass in masses],
        [np.zeros((3, 3)) if tensor is None else tensor.reshape(3, 3) for tensor in tensors],
        longest_within(_known_points(requirements, points) for points in _points(bodies, joints)),
    )
    for body, mass, tensor, scale in zip(bodies, masses, tensors, scales, strict=True):
        path = f"bodies.{body.name}"
        found: list[tuple[str, str, str]] = []
        remedy = f"give a mass of 0 or more, {SWITCH}"
        if mass is not None and mass[0] < 0:
            how = "" if body.mass.value is not None else " at the declared values"
            found.append((f"{path}.mass", f"is {mass[0]:g}{how}", remedy))
        elif body.check == "error":
            requirements.inside(f"{path}.mass", body.mass, NOT_NEGATIVE, remedy)
        if not faults.under(f"{path}.inertia"):
            if not is_symmetric(body.inertia, None if tensor is None else tensor.tolist(), COMPUTED * scale):
                found.append((f"{path}.inertia", *ASYMMETRIC))
            else:
                found += [(path + ".inertia", *flaw[1:]) for flaw in flaws if flaw.key == f".{body.name}.inertia"]
        for place, message, told in found:
            if body.check == "error":
                faults.add(place, message, told, "EG-INERTIA")
            else:
                if told not in (EXCESS, ASYMMETRIC[1]):
                    negative[body.name] = None
                if body.check == "note":
                    notes.append(f"{place}: {message}; it is used as given")
    if any(symbols_of(_entries(body)) for body in bodies if body.check == "error"):
        alike: dict[Any, tuple[Body, list[Sequence[Expr]]]] = {}  # of bodies that are alike the first stands for all
        for body, own in zip(bodies, numbers, strict=True):
            alike.setdefault((body.check, *(tuple(x.id for x in group) for group in own)), (body, own))
        data = [_described(body, own, body.check == "error") for body, own in alike.values()]
        requirements.keep("bodies", BODIES, [x for _, own in alike.values() for g in own for x in g], (data,))
    return tuple(negative), tuple(notes)


def _numbers_of(body: Body, points: Sequence[Vec3]) -> list[Sequence[Expr]]:
    """Mass, tensor, axis of the one moment that was given, and points: what judges bodies, in this order."""
    return [[body.mass], _entries(body), () if body.plane is None else body.plane, *points]


def _described(body: Body, numbers: Sequence[Sequence[Expr]], judged: bool) -> tuple[str, bool, int, bool]:
    """What :func:`~..base.value_rules.judge_bodies` takes beside the numbers."""
    return body.name, body.plane is not None, len(numbers) - 3, judged


def _known(requirements: Requirements, group: Sequence[Expr]) -> list[float]:
    found = requirements.known(group)
    return [math.nan] * len(group) if found is None else found.tolist()


def _entries(body: Body) -> list[Expr]:
    return [entry for row in body.inertia for entry in row]


def _points(bodies: Sequence[Body], joints: Sequence[JointSpec]) -> list[list[Vec3]]:
    """Centre of mass, joints and the point of the inertia of each body; the centre of no mass does not count."""
    points: list[list[Vec3]] = [[] if body.mass.is_zero else [body.com] for body in bodies]
    for own, body in zip(points, bodies, strict=True):
        own += [] if body.about is None else [body.about]
    for spec in joints:
        for marker in (spec.predecessor, spec.successor):
            if marker.body != GROUND:
                points[marker.body].append(marker.frame.position)
    return points


def _known_points(requirements: Requirements, points: Sequence[Vec3]) -> list[Array]:
    found = [requirements.known(point) for point in points]
    return [point for point in found if point is not None]


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
