"""Stage kinematics: Mechanism -> its length scale, by which lengths are compared with angles."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..base.limits.numbers import HAIR, NO_LENGTH
from ..describe.mechanism import Mechanism
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..graph.rounding_bounds import settled_vector, size_of
from ..graph.vectors import Vec3
from ..joints.rods import Distance, RevoluteSpherical

PAIRS = 12  #: joints of a body up to which all distances between them count, beyond it those from the first to all


def length_scale(mechanism: Mechanism) -> Expr:
    """Root mean square of the lengths of rods and of the distances between joints on one body.

    Where there is none, of the distances from joints to centres of mass; 1 if there is none of these either.  A length
    that is nothing beside the radius of gyration of the bodies, as what rounding in a file leaves of a 0, is none.
    Minimum-norm corrections compare lengths with angles; measured in this length, neither units nor frames of bodies
    matter.
    """
    graph = mechanism.graph
    points: dict[int, list[Vec3]] = {}
    squares = []
    for spec in mechanism.joints:
        for marker in (spec.predecessor, spec.successor):
            points.setdefault(marker.body, []).append(marker.frame.position)
        if isinstance(spec.joint, Distance | RevoluteSpherical):
            squares.append(spec.joint.length * spec.joint.length)
    for places in points.values():
        pairs = combinations(places, 2) if len(places) <= PAIRS else ((places[0], x) for x in places[1:])
        squares += [_square(a, b) for a, b in pairs]
    squares = [x for x in squares if not x.is_zero]
    if not squares:
        bodies = [k for k, places in points.items() if k >= 0 and not mechanism.bodies[k].mass.is_zero and places]
        squares = [_square(mechanism.bodies[k].com, x) for k in bodies for x in points[k]]
        squares = [x for x in squares if not x.is_zero]
    if not squares:
        return graph.one
    total = graph.zero
    for square in squares:
        total = total + square
    size = graph.apply("sqrt", total / float(len(squares)))
    least = max(NO_LENGTH, HAIR * _radius_of_gyration(mechanism, size))
    return graph.apply("select", graph.apply("lt", size, least), 1.0, size)  # parameters may make all of them 0


def _radius_of_gyration(mechanism: Mechanism, size: Expr) -> float:
    """That of all bodies with the declared parameters, each about its own centre.

    0 without masses or values, and where parameters given late may change it, unless ``size`` is a hair beside it.
    """
    entries = [x for b in mechanism.bodies for x in (b.mass, b.inertia[0][0], b.inertia[1][1], b.inertia[2][2])]
    if not entries or any(p.value is None for p in mechanism.parameters):
        return 0.0
    numbers = compile_evaluator([size, *entries], [p.name for p in mechanism.parameters])
    declared, *found = numbers([p.value for p in mechanism.parameters])
    mass, inertia = sum(found[::4]), sum(found) - sum(found[::4])
    radius = float(np.sqrt(0.5 * inertia / mass)) if mass > 0.0 and 0.0 < inertia < np.inf else 0.0
    return radius if declared < HAIR * radius or all(x.node[0] == "const" for x in entries) else 0.0


def _square(a: Vec3, b: Vec3) -> Expr:
    """The square of a distance, exactly 0 where it is rounding of the places."""
    apart = settled_vector(vec.sub(a, b), size_of(a, b))
    return vec.dot(apart, apart)
