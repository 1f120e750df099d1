"""Stage kinematics: what each joint adds to the motion of its link, relative to the parent, and how that changes."""

from __future__ import annotations

from collections.abc import Mapping

from ..graph import vectors as vec
from ..graph.core import Expr
from ..graph.differentiate import jvp
from ..graph.vectors import Vec3
from ..records import dataclass
from .kinematics import Kinematics


@dataclass(frozen=True)
class JointRates:
    """Motion of one link relative to its parent.

    Attributes
    ----------
    spin, spin_rate : Vec3
        Relative angular velocity sum s v and the sum s' v, link axes.
    slide, slide_rate : Vec3
        Velocity of the link's origin seen from the parent, and its change at v' = 0, parent link axes.
    """

    spin: Vec3
    spin_rate: Vec3
    slide: Vec3
    slide_rate: Vec3


def joint_rates(kinematics: Kinematics) -> list[JointRates]:
    """The rates of every link, in tree order."""
    graph, links, v = kinematics.graph, kinematics.links, kinematics.v
    along: Mapping[Expr, Expr] = kinematics.flow | kinematics.clock
    columns = [x for link in links for angular, _ in link.columns for x in angular]
    flows = jvp([*columns, *(x for link in links for x in link.position)], along)
    slides = flows[len(columns) :]
    slide_rates = jvp(slides, along)
    result = []
    at = 0
    for k, link in graph.marked(enumerate(links)):
        spin = spin_rate = vec.zero(graph)
        for c, (angular, _) in enumerate(link.columns):
            rate = v[link.first + c]
            spin = vec.add(spin, vec.scale(rate, angular))
            spin_rate = vec.add(spin_rate, vec.scale(rate, _three(flows, at)))
            at += 3
        result.append(JointRates(spin, spin_rate, _three(slides, 3 * k), _three(slide_rates, 3 * k)))
    return result


def slide_accelerations(kinematics: Kinematics, rates: list[JointRates], a: tuple[Expr, ...]) -> list[Vec3]:
    """What accelerations ``a`` add to ``slide_rate``: the slide is linear in the velocities."""
    slides = [x for r in rates for x in r.slide]
    pushes = jvp(slides, dict(zip(kinematics.v, a, strict=True)))
    return [_three(pushes, 3 * k) for k in range(len(rates))]


def _three(values: list[Expr], at: int) -> Vec3:
    return values[at], values[at + 1], values[at + 2]
