"""Stage kinematics: Mechanism -> its length scale, by which lengths are compared with angles."""

from __future__ import annotations

from itertools import combinations

from ..describe.mechanism import Mechanism
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.rounding_bounds import settled_vector, size_of
from ..graph.vectors import Vec3
from ..joints.rods import Distance, RevoluteSpherical
from ..limits.descriptions import HAIR, NO_LENGTH

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
    square = total / float(len(squares))
    size = graph.apply("sqrt", square)
    mass = inertia = graph.zero
    for body in mechanism.bodies:
        mass, inertia = mass + body.mass, inertia + (body.inertia[0][0] + body.inertia[1][1] + body.inertia[2][2])
    none = graph.apply("lt", size, NO_LENGTH)  # parameters may make all of them 0
    if not mass.is_zero and not inertia.is_zero:
        hair = graph.apply("lt", square * mass, inertia * (0.5 * HAIR * HAIR))
        none = graph.apply("or", none, graph.apply("and", graph.apply("lt", 0.0, mass), hair))
    return graph.apply("select", none, 1.0, size)


def _square(a: Vec3, b: Vec3) -> Expr:
    """The square of a distance, exactly 0 where it is rounding of the places."""
    apart = settled_vector(vec.sub(a, b), size_of(a, b))
    return vec.dot(apart, apart)
