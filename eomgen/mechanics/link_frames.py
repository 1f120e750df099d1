"""Links about parallel axes, or that slide along the parent's axes -> the same links in fewer frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property

from ..elements.frames import GROUND
from ..elements.joints import about
from ..expr import vectors as vec
from ..expr.core import Expr, Graph
from ..expr.differentiate import jvp
from ..expr.records import dataclass
from ..expr.spatial import Twist, Wrench
from ..expr.tensors import subtract_matrices, symmetric
from ..expr.vectors import Mat3, Vec3
from .kinematics import Kinematics
from .tree import Link, SpatialInertia, about_z, link_twists, no_inertia

# -- joint rates -------------------------------------------------------------------------------------------------------


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
            spin_rate = vec.add(spin_rate, vec.scale(rate, vec.three(flows, at)))
            at += 3
        result.append(JointRates(spin, spin_rate, vec.three(slides, 3 * k), vec.three(slide_rates, 3 * k)))
    return result


def slide_accelerations(kinematics: Kinematics, rates: Sequence[JointRates], a: Sequence[Expr]) -> list[Vec3]:
    """What accelerations ``a`` add to ``slide_rate``: the slide is linear in the velocities."""
    slides = [x for r in rates for x in r.slide]
    pushes = jvp(slides, dict(zip(kinematics.v, a, strict=True)))
    return [vec.three(pushes, 3 * k) for k in range(len(rates))]


# -- parallel axes -----------------------------------------------------------------------------------------------------

# Between links that only turn about one direction nothing need be rotated: vectors keep the components they have in the
# axes of the first, and the sums of the angles since then turn the constants of each link (first moments, inertia,
# distances) instead.  For a planar chain these are absolute angles.


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


# -- link axes ---------------------------------------------------------------------------------------------------------

# The velocity of a free joint is along the axes of its marker on the parent, so that its columns of the motion subspace
# are full of sines and cosines.  Along the link's own axes they are unit vectors, and whatever is projected on them or
# eliminated with them is shorter: with w = R v for these three velocities the system M v' + h = 0 becomes
# (R M R^T) w' + R h = 0, where v' = R^T w' (w' taken at rest, as h holds the velocity terms).  What hangs on ground by
# such a joint falls freely: gravity is left out of h and added to v'. The accelerations of examples/satellite.yaml take
# 535 operations so and 641 otherwise, those of quadrotor_load.yaml 569 and 724.


Rows = tuple[tuple[Expr, ...], ...]


@dataclass(frozen=True)
class SlidingTriple:
    """Three velocities of a link: the first, link axes to the axes they are along, gravity in these if it falls."""

    link: int
    first: int
    rotation: Mat3
    gravity: Vec3 | None


@dataclass(frozen=True)
class Turned:
    """M w' + h = 0 in turned velocities; ``form`` derives (M, h) when they are first asked for."""

    form: Callable[[], tuple[Rows, tuple[Expr, ...]]]
    blocks: tuple[SlidingTriple, ...]

    @cached_property
    def system(self) -> tuple[Rows, tuple[Expr, ...]]:
        """M and h."""
        return self.form()

    def accelerations(self, solution: Sequence[Expr]) -> list[Expr]:
        """v' from w'."""
        return turn_back(self.blocks, solution)


def turn_links(kinematics: Kinematics) -> tuple[Kinematics, tuple[SlidingTriple, ...]]:
    """The kinematics with unit vectors for the columns of such joints, and where these are."""
    links: list[Link] = []
    blocks: list[SlidingTriple] = []
    graph = kinematics.graph
    for k, link in enumerate(kinematics.links):
        if _slides_along_parent(link):
            unit = [(vec.zero(graph), axis) for axis in vec.identity(graph)]
            falls = link.parent == GROUND
            gravity = vec.transpose_times(link.turn, kinematics.mechanism.gravity) if falls else None
            blocks.append(SlidingTriple(k, link.first, link.joint_rotation, gravity))
            link = replace(link, columns=(*unit, *link.columns[3:]))
        links.append(link)
    return (replace(kinematics, links=tuple(links)) if blocks else kinematics), tuple(blocks)


def turn_forces(blocks: Sequence[SlidingTriple], forces: Sequence[Expr]) -> list[Expr]:
    """Forces along the velocities v -> along w."""
    result = list(forces)
    for b in blocks:
        x, y, z = forces[b.first : b.first + 3]
        result[b.first : b.first + 3] = vec.transpose_times(b.rotation, (x, y, z))
    return result


def turn_back(blocks: Sequence[SlidingTriple], accelerations: Sequence[Expr]) -> list[Expr]:
    """w' -> v'."""
    result = list(accelerations)
    for b in blocks:
        x, y, z = accelerations[b.first : b.first + 3]
        along = vec.times(b.rotation, (x, y, z))
        result[b.first : b.first + 3] = along if b.gravity is None else vec.add(along, b.gravity)
    return result


def falling(blocks: Sequence[SlidingTriple]) -> frozenset[int]:
    """Links from which outwards gravity is left out."""
    return frozenset(b.link for b in blocks if b.gravity is not None)


def _slides_along_parent(link: Link) -> bool:
    """Whether the first three columns are the axes of the joint's marker on the parent, and not link axes already."""
    axes = link.joint_rotation
    if len(link.columns) < 3 or axes == vec.identity(axes[0][0].graph):
        return False
    return all(
        linear == axes[c] and all(x.is_zero for x in angular) for c, (angular, linear) in enumerate(link.columns[:3])
    )


# -- inertia moved to parents ------------------------------------------------------------------------------------------

# What a joint lets a link do relative to its parent leaves some combinations of the ten inertial parameters without any
# effect on the difference between the two (M. Gautier and W. Khalil, Direct calculation of minimum set of inertial
# parameters of serial robots, IEEE Trans. Robotics and Automation 6 (1990), 368-373): carried by the parent they give
# the same kinetic energy and the same work of gravity. Links are left with seven parameters or fewer. Kept by its link,
# the rest need not look like a body: masses vanish and moments of inertia may be negative.


def regroup(graph: Graph, links: tuple[Link, ...]) -> list[SpatialInertia]:
    """Spatial inertia of every link after moving towards ground all that can be moved; what reaches ground is gone."""
    inertias = [link.spatial for link in links]
    for k in graph.marked(reversed(range(len(links)))):
        link = links[k]
        part = movable(graph, link, inertias[k])
        if part.is_zero:
            continue
        inertias[k] = _less(inertias[k], part)
        if link.parent != GROUND:
            carried = part.turned(link.turn) if link.columns else part.turned(link.joint_rotation).turned(link.turn)
            inertias[link.parent] = inertias[link.parent].plus(carried.shifted(link.position))
    return inertias


def movable(graph: Graph, link: Link, inertia: SpatialInertia) -> SpatialInertia:
    """The part of a link's inertia that acts alike on its parent.

    Weld: all.  No rotation: the inertia tensor, which feels angular velocity only.  Rotation about a fixed point: the
    mass; about the z axis only: also the first moment along z and yy of the tensor, as xx = yy = yy, zz = 0.
    """
    o = vec.zero(graph)
    nothing = no_inertia(graph)
    if not link.columns:
        return inertia
    turns = [angular for angular, _ in link.columns]
    if all(x.is_zero for turn in turns for x in turn):
        return SpatialInertia(graph.zero, o, inertia.inertia)
    if any(not x.is_zero for _, linear in link.columns for x in linear):
        return nothing
    if len(turns) == 1 and turns[0][0].is_zero and turns[0][1].is_zero:
        yy = inertia.inertia[1][1]
        tensor: Mat3 = ((yy, graph.zero, graph.zero), (graph.zero, yy, graph.zero), o)
        return SpatialInertia(inertia.mass, (graph.zero, graph.zero, inertia.moment[2]), tensor)
    return SpatialInertia(inertia.mass, o, (o, o, o))


def _less(a: SpatialInertia, b: SpatialInertia) -> SpatialInertia:
    tensor = symmetric(subtract_matrices(a.inertia, b.inertia))
    return SpatialInertia(a.mass - b.mass, vec.sub(a.moment, b.moment), tensor)
