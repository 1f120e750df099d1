"""Stage kinematics, parts of reactions: ``reaction(A).x`` -> components of the joint's wrench, which are solved for.

The wrench that passes through a joint holds what acts along its coordinates too (a drive, friction).  The reaction is
the rest, which does no work in the motions that the joint allows, as in :mod:`~eomgen.analysis.reactions`: what acts
along a coordinate is a torque where that turns, a force where it slides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ..describe.mechanism import CarriedQuantity, JointSpec
from ..forces.branches import beyond_zero
from ..forces.joint_reactions import reaction_symbol
from ..frames import Marker
from ..graph import vectors as vec
from ..graph.core import Expr, Graph, sqrt
from ..graph.vectors import Mat3, Vec3
from .eliminate import eliminate


class Placed(Protocol):
    """What the parts need to know of the motion."""

    graph: Graph

    def rotation(self, marker: Marker) -> Mat3: ...
    def coordinate(self, name: str) -> tuple[Expr, Expr]: ...


def part_of_reaction(motion: Placed, spec: JointSpec, quantity: CarriedQuantity) -> Expr:
    """The part, in symbols of the joint's wrench along the axes of S."""
    wrench = [reaction_symbol(motion.graph, spec.name, k) for k in range(6)]
    force, moment = force_and_moment(motion, spec, wrench)
    if quantity.part == "size":
        return beyond_zero(vec.dot(force, force), sqrt)
    if quantity.part == "normal":  # across the z axis of the joint
        return beyond_zero(force[0] * force[0] + force[1] * force[1], sqrt)
    found = vec.times(motion.rotation(spec.successor), moment if quantity.part.startswith("m") else force)
    if quantity.axes is not None:
        found = vec.transpose_times(motion.rotation(quantity.axes), found)
    return found["xyz".index(quantity.part[-1])]


def force_and_moment(motion: Placed, spec: JointSpec, wrench: Sequence[Expr]) -> tuple[Vec3, Vec3]:
    """Force and moment that do no work in the motions that the joint allows, of the wrench that passes through it."""
    graph, x = motion.graph, wrench
    force, moment = (x[0], x[1], x[2]), (x[3], x[4], x[5])
    if spec.joint.role == "loop":
        return force, moment
    columns = spec.joint.subspace(graph, [motion.coordinate(name)[0] for name in spec.coordinates])
    turns = [(angular, linear) for angular, linear in columns if not all(part.is_zero for part in angular)]
    slides = [linear for angular, linear in columns if all(part.is_zero for part in angular)]
    pushed = _spanned(graph, slides, [vec.dot(s, force) for s in slides])
    wanted = [vec.dot(w, moment) + vec.dot(s, force) - vec.dot(s, pushed) for w, s in turns]
    turned = _spanned(graph, [w for w, _ in turns], wanted)
    return vec.sub(force, pushed), vec.sub(moment, turned)


def _spanned(graph: Graph, directions: Sequence[Vec3], work: Sequence[Expr]) -> Vec3:
    """The shortest vector that does the given work along directions."""
    found = vec.zero(graph)
    if directions:
        gram = [[vec.dot(a, b) for b in directions] for a in directions]
        for factor, direction in zip(eliminate(gram, work), directions, strict=True):
            found = vec.add(found, vec.scale(factor, direction))
    return found
