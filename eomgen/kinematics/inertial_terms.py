"""Stage kinematics: Kinematics -> the motion of each body and its ten inertial parameters, both about its own origin.

In both the equations of a tree are linear: with the twist (w, v) of a body, the rates (alpha, A) of its origin less
gravity, and its mass m, first moment m c and inertia I about the origin, the joints need the wrench

    force = m A + alpha x mc + w x (w x mc),   moment = I alpha + w x I w + mc x A

(C. G. Atkeson, C. H. An, J. M. Hollerbach, Estimation of inertial parameters of manipulator loads and links,
Int. J. Robotics Research 5(3) (1986), 101-119, eq. 8 to 14).  All is in the axes of the body that the user described.
"""

from __future__ import annotations

from ..describe.mechanism import Body
from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.spatial import Twist
from ..graph.tensors import add_matrices, shift_tensor, symmetric
from ..graph.vectors import Vec3
from .kinematics import Kinematics

MOTION = 12  #: numbers of the motion of one body


def inertial_terms(kinematics: Kinematics) -> list[Expr]:
    """Per body, in the order of the mechanism: w, v, alpha, A less gravity (12); m, m c, I xx yy zz xy xz yz (10)."""
    graph, links = kinematics.graph, kinematics.links
    twists: list[Twist] = []
    for link, (angular, linear) in zip(links, kinematics.twists, strict=True):
        turned = vec.times(link.frame.rotation, angular)
        shift = vec.cross(link.frame.position, turned)
        twists.append((turned, vec.add(vec.times(link.frame.rotation, linear), shift)))
    rates = kinematics.total_derivative([x for angular, linear in twists for x in (*angular, *linear)])
    falls: list[Vec3] = []  # gravity in link axes
    motions: dict[int, list[Expr]] = {}
    for k, link in enumerate(links):
        falls.append(link.down(kinematics.mechanism.gravity if link.parent == GROUND else falls[link.parent]))
        angular, linear = twists[k]
        alpha, change = (_three(rates, 6 * k + at) for at in (0, 3))
        fall = vec.times(link.frame.rotation, falls[k])
        lifted = vec.sub(vec.add(change, vec.cross(angular, linear)), fall)
        motions[link.body] = [*angular, *linear, *alpha, *lifted]
    still = [graph.zero] * MOTION
    return [x for k, body in enumerate(kinematics.mechanism.bodies) for x in (*motions.get(k, still), *_inertia(body))]


def _three(values: list[Expr], at: int) -> Vec3:
    return values[at], values[at + 1], values[at + 2]


def _inertia(body: Body) -> list[Expr]:
    """m, m c, I about the origin; as given where they were given so."""
    moment = body.moment if body.moment is not None else vec.scale(body.mass, body.com)
    about = body.inertia_origin
    if about is None:
        about = add_matrices(symmetric(body.inertia), shift_tensor(body.mass, body.com))
    diagonal = (about[0][0], about[1][1], about[2][2])
    return [body.mass, *moment, *diagonal, about[0][1], about[0][2], about[1][2]]
