"""Stage kinematics: hinges in a row about parallel axes -> the same links, all resolved in the axes of the first one.

Between links that only turn about one direction nothing need be rotated: vectors keep the components they have in the
axes of the first, and the sums of the angles since then turn the constants of each link (first moments, inertia,
distances) instead.  For a planar chain these are absolute angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

from ..frames import GROUND
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.spatial import Twist, Wrench
from ..graph.vectors import Mat3, Vec3
from ..joints.rotation_coordinates import about
from ..records import dataclass
from .axis_turns import about_z
from .joint_rates import JointRates
from .link_inertia import SpatialInertia
from .tree import Link, link_twists


@dataclass(frozen=True)
class ResolvedLink(Link):
    """A link whose parent is resolved in other axes than its own: ``axes`` turns parent link axes to those."""

    axes: Mat3

    def down(self, x: Vec3) -> Vec3:
        return super().down(vec.transpose_times(self.axes, x))

    def up(self, x: Vec3) -> Vec3:
        return vec.times(self.axes, super().up(x))

    def up_inertia(self, inertia: SpatialInertia) -> SpatialInertia:
        turned = inertia.turned(self.joint_rotation).turned(self.turn).turned(self.axes)
        return turned.shifted(self.position)


@dataclass(frozen=True)
class Resolved:
    """Links, their angular velocities and what goes with them, in the axes they are resolved in."""

    links: tuple[Link, ...]
    twists: tuple[Twist, ...]
    rates: list[JointRates]
    applied: list[Wrench]
    axes: tuple[Mat3 | None, ...]  #: link axes to the axes it is resolved in; None where they are the same

    @classmethod
    def in_own_axes(
        cls, links: Sequence[Link], twists: Sequence[Twist], rates: list[JointRates], applied: list[Wrench]
    ) -> Resolved:
        """As they are."""
        return cls(tuple(links), tuple(twists), rates, applied, (None,) * len(links))

    def inertias(self, given: Sequence[SpatialInertia]) -> list[SpatialInertia]:
        """Inertias in link axes -> in these axes."""
        return [i if axes is None else i.turned(axes) for i, axes in zip(given, self.axes, strict=True)]

    def with_columns(self, links: Sequence[Link]) -> Resolved:
        """The same with other columns, of these links."""
        pairs = zip(self.links, links, strict=True)
        return replace(self, links=tuple(replace(one, columns=other.columns) for one, other in pairs))


def resolve_parallel(
    graph: Graph, links: Sequence[Link], v: tuple[Expr, ...], rates: Sequence[JointRates], applied: Sequence[Wrench]
) -> Resolved:
    """Choose the axes; links on which no parallel hinge hangs keep their own."""
    still = vec.identity(graph)
    constants: list[Mat3] = []  # the turns between markers since the first of the row
    sums: list[Expr | None] = []  # the angles since then; None for the first
    axes: list[Mat3 | None] = []
    resolved: list[Link] = []
    for link in links:
        angle = _hinge_angle(link)
        holder = axes[link.parent] if link.parent != GROUND else None
        follows = angle is not None and link.parent != GROUND and _hinge_angle(links[link.parent]) is not None
        if follows and angle is not None and about_z(link.turn):
            before = sums[link.parent]
            total = angle if before is None else before + angle
            constant = vec.product(constants[link.parent], link.turn)
            constants.append(constant)
            sums.append(total)
            axes.append(vec.product(constant, about(graph, 2, total)))
            position = link.position if holder is None else vec.times(holder, link.position)
            resolved.append(replace(link, turn=still, joint_rotation=still, position=position))
            continue
        constants.append(still)
        sums.append(None)
        axes.append(None)
        if holder is not None:
            values = {f.name: getattr(link, f.name) for f in fields(Link)}
            link = ResolvedLink(**values | {"position": vec.times(holder, link.position)}, axes=holder)
        resolved.append(link)
    moved = []
    for link, rate in zip(links, rates, strict=True):
        holder = axes[link.parent] if link.parent != GROUND else None
        if holder is not None:
            rate = replace(rate, slide=vec.times(holder, rate.slide), slide_rate=vec.times(holder, rate.slide_rate))
        moved.append(rate)
    loads = [
        load if turn is None else (vec.times(turn, load[0]), vec.times(turn, load[1]))
        for load, turn in zip(applied, axes, strict=True)
    ]
    return Resolved(tuple(resolved), tuple(link_twists(graph, tuple(resolved), v)), moved, loads, tuple(axes))


def _hinge_angle(link: Link) -> Expr | None:
    """The angle about z of a link that does nothing but turn about it; else None."""
    if len(link.columns) != 1 or not about_z(link.joint_rotation):
        return None
    angular, linear = link.columns[0]
    if not all(x.is_zero for x in (angular[0], angular[1], *linear)):
        return None
    c, s = link.joint_rotation[0][0], link.joint_rotation[1][0]
    graph, positive = c.graph, s.node[0] == "sin"
    inner = s.node if positive else graph.nodes[s.node[1]] if s.node[0] == "neg" else ("",)
    if c.node[0] != "cos" or inner[0] != "sin" or inner[1] != c.node[1]:
        return None
    angle = Expr(graph, c.node[1])
    return angle if positive else -angle
