"""Topology -> links, the bodies of the tree with their placement, inertia and twist recursion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..base.limits.numbers import PLANE
from ..elements.frames import GROUND, Frame, Marker
from ..expr import vectors as vec
from ..expr.core import Expr, Graph, atan2, substitute, symbols_of
from ..expr.differentiate import gradient
from ..expr.evaluate import evaluate
from ..expr.identity import DRAWS, random_point, rounded_rotation, rounded_vector, size_of, vanishes
from ..expr.records import Record
from ..expr.spatial import Twist, Wrench
from ..expr.tensors import add_matrices, rotate_symmetric, symmetric
from ..expr.vectors import Mat3, Vec3
from ..model.mechanism import Body, Mechanism
from .topology import Branch, Topology

# -- angle sums --------------------------------------------------------------------------------------------------------


Turns = tuple[Expr, list[tuple[int, float]]]  #: an angle, and the coordinates in it with their factors


def sum_of_turns(graph: Graph, rotation: Mat3, q: Sequence[Expr]) -> Turns | None:
    """The angle about z of a rotation that is about z at every q, else None.

    It is a constant plus coordinates with factors 1 and -1, equal to ``atan2(R_10, R_00)`` up to full turns.
    """
    angle = atan2(rotation[1][0], rotation[0][0])
    places = {x.id: j for j, x in enumerate(q)}
    symbols = (graph.symbol(name).id for name in symbols_of([angle]))
    turning = sorted(places[i] for i in symbols if i in places)
    slopes = gradient(angle, [q[j] for j in turning])
    random = np.random.default_rng(7)
    points = (random_point(slopes, random) for _ in range(DRAWS if slopes else 1))
    drawn = (np.round(evaluate(slopes, point)) if slopes else np.zeros(0) for point in points)
    steps = next((steps for steps in drawn if np.isfinite(steps).all()), None)  # a root may have no value at a point
    if steps is None:
        return None
    off = [rotation[2][2] - 1.0, *(x - float(step) for x, step in zip(slopes, steps, strict=True))]
    if not all(vanishes(off, PLANE, pieces=True)):
        return None
    terms = [(j, float(step)) for j, step in zip(turning, steps, strict=True) if step]
    start = substitute([angle], {q[j]: graph.zero for j in turning})[0]
    for j, factor in terms:
        start = start + factor * q[j]
    return start, terms


# -- link inertia ------------------------------------------------------------------------------------------------------

# Written so that few operations are left: a turn about a coordinate axis touches only what it changes.


class SpatialInertia(Record):
    """Mass, first moment m c and inertia about the link's origin, in link axes (Featherstone, RBDA, eq. 2.62)."""

    mass: Expr
    moment: Vec3
    inertia: Mat3

    def times(self, angular: Vec3, linear: Vec3) -> Wrench:
        """(moment about the origin, force) of a twist or spatial acceleration: Featherstone, RBDA, eq. 2.63."""
        turn = vec.add(vec.times(self.inertia, angular), vec.cross(self.moment, linear))
        push = vec.sub(vec.scale(self.mass, linear), vec.cross(self.moment, angular))
        return turn, push

    @property
    def is_zero(self) -> bool:
        """Whether all ten entries vanish identically."""
        return all(x.is_zero for x in (self.mass, *self.moment, *(x for row in self.inertia for x in row)))

    def plus(self, other: SpatialInertia) -> SpatialInertia:
        """Both in one link."""
        return SpatialInertia(
            self.mass + other.mass,
            vec.add(self.moment, other.moment),
            symmetric(add_matrices(self.inertia, other.inertia)),
        )

    def turned(self, rotation: Mat3) -> SpatialInertia:
        """In the axes that ``rotation`` takes its axes to."""
        return SpatialInertia(self.mass, vec.times(rotation, self.moment), rotate_symmetric(rotation, self.inertia))

    def shifted(self, p: Vec3) -> SpatialInertia:
        """About the point that sees its origin at p (Featherstone, RBDA, eq. 2.66)."""
        h, inertia = self.moment, self.inertia
        moved = vec.add(h, vec.scale(self.mass, p))
        both = vec.add(h, moved)
        x, y, z = (p[k] * both[k] for k in range(3))  # 2 (p . h) 1 + m p^2 1, and less p h^T + h p^T + m p p^T
        diagonal = (inertia[0][0] + (y + z), inertia[1][1] + (x + z), inertia[2][2] + (x + y))
        xy, xz, yz = (inertia[i][j] - (p[i] * moved[j] + h[i] * p[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
        rows = ((diagonal[0], xy, xz), (xy, diagonal[1], yz), (xz, yz, diagonal[2]))
        return SpatialInertia(self.mass, moved, rows)


def no_inertia(graph: Graph) -> SpatialInertia:
    """That of nothing."""
    o = vec.zero(graph)
    return SpatialInertia(graph.zero, o, (o, o, o))


def body_inertia(body: Body, frame: Frame) -> SpatialInertia:
    """The spatial inertia of a body in its link frame.

    First moment and inertia about the body's origin are taken as they are where the body has them, so that their
    symbols stay the parameters of the equations.
    """
    back = vec.transpose(frame.rotation)
    if body.moment is not None and body.inertia_origin is not None:
        about_body = SpatialInertia(body.mass, body.moment, symmetric(body.inertia_origin))
        return about_body.shifted(vec.neg(frame.position)).turned(back)
    inertia = rounded_matrix(rotate_symmetric(back, symmetric(body.inertia)), body.inertia)
    return SpatialInertia(body.mass, vec.zero(body.mass.graph), inertia).shifted(place_point(frame, body.com))


def place_point(frame: Frame, point: Vec3) -> Vec3:
    """A point of a body, in the frame: numbers that cancel are exactly 0."""
    moved = vec.transpose_times(frame.rotation, vec.sub(point, frame.position))
    return rounded_vector(moved, size_of(point, frame.position))


def rounded_matrix(turned: Mat3, before: Mat3) -> Mat3:
    """A matrix that was turned, its constant entries exactly 0 where they are rounding of those before."""
    size = max(size_of(row) for row in before)
    return (rounded_vector(turned[0], size), rounded_vector(turned[1], size), rounded_vector(turned[2], size))


# -- the tree ----------------------------------------------------------------------------------------------------------

# Each body is described in its *link frame*: the marker by which its tree joint holds it.  Twists are (angular, linear)
# in link axes at the link's origin (Featherstone, RBDA, ch. 2, with body coordinates).


class Link(Record):
    """One body of the tree.

    A vector in parent link axes goes to link axes by ``joint_rotation^T turn^T``; the link's origin is at ``position``
    in parent link axes.  ``columns`` is the motion subspace in link axes, for coordinates ``first`` onwards.
    """

    name: str
    body: int
    parent: int  #: index of the parent link, GROUND for none
    first: int
    turn: Mat3  #: rotation of the joint's marker on the parent, constant
    holder: Vec3  #: its place in parent link axes, constant
    slide: Vec3  #: how far the joint has moved from there, along the marker's axes
    joint_rotation: Mat3
    position: Vec3
    columns: tuple[Twist, ...]
    mass: Expr
    com: Vec3  #: centre of mass, link axes
    inertia: Mat3  #: about the centre of mass, link axes
    spatial: SpatialInertia  #: about the link's origin, link axes
    frame: Frame  #: the link frame in the body

    def down(self, x: Vec3) -> Vec3:
        """Parent link axes to link axes."""
        return vec.transpose_times(self.joint_rotation, vec.transpose_times(self.turn, x))

    def up(self, x: Vec3) -> Vec3:
        """Link axes to parent link axes."""
        return vec.times(self.turn, vec.times(self.joint_rotation, x))

    def up_inertia(self, inertia: SpatialInertia) -> SpatialInertia:
        """Inertia of the link, about the parent's origin in parent link axes."""
        return inertia.turned(self.joint_rotation).turned(self.turn).shifted(self.position)

    def down_twist(self, twist: Twist) -> Twist:
        """A twist of the parent, seen in this link's frame."""
        angular, linear = twist
        return self.down(angular), self.down(vec.add(linear, vec.cross(angular, self.position)))

    def lift(self, wrench: Wrench) -> Wrench:
        """A wrench on the link, about the parent's origin in parent link axes."""
        push = self.up(wrench[1])
        return vec.add(self.up(wrench[0]), vec.cross(self.position, push)), push


def place(frame: Frame, marker: Frame) -> Frame:
    """A marker of the body, in the link frame ``frame`` of the same body.

    However the body's own axes are turned and shifted, numbers that cancel are exactly 0, so that the equations of a
    mechanism do not depend on how its bodies are described.
    """
    turn = vec.transpose(frame.rotation)
    return Frame(rounded_rotation(vec.product(turn, marker.rotation)), place_point(frame, marker.position))


def build_links(
    mechanism: Mechanism,
    topology: Topology,
    symbols: Mapping[str, Expr],
    choose: Callable[[Branch, Mat3, Frame], Mat3 | None],
) -> tuple[Link, ...]:
    """Links in tree order, of the coordinates ``symbols`` by name; ``choose`` turns both markers of a joint about z."""
    graph = mechanism.graph
    ground = Frame.identity(graph)
    index = {GROUND: GROUND}
    frames = {GROUND: ground}
    links: list[Link] = []
    first = 0
    for branch in graph.marked(topology.branches):
        spec = mechanism.joints[branch.joint]
        q = [symbols[name] for name in spec.coordinates]
        rotation, position = spec.joint.pose(graph, q)
        columns = spec.joint.subspace(graph, q)
        outer, inner = spec.predecessor, spec.successor
        if branch.reversed:
            outer, inner = inner, outer
            columns = [_reverse(rotation, position, column) for column in columns]
            position = vec.neg(vec.transpose_times(rotation, position))
            rotation = vec.transpose(rotation)
        outer_frame, frame = outer.frame, inner.frame
        holder = place(frames[branch.parent], outer_frame)
        turn = choose(branch, holder.rotation, frame)
        if turn is not None:
            outer_frame, frame = outer_frame.turned(turn), frame.turned(turn)
            holder = place(frames[branch.parent], outer_frame)
        body = mechanism.bodies[branch.body]
        back = vec.transpose(frame.rotation)
        links.append(
            Link(
                name=body.name,
                body=branch.body,
                parent=index[branch.parent],
                first=first,
                turn=holder.rotation,
                holder=holder.position,
                slide=position,
                joint_rotation=rotation,
                position=vec.add(holder.position, vec.times(holder.rotation, position)),
                columns=tuple(columns),
                mass=body.mass,
                com=place_point(frame, body.com),
                inertia=rounded_matrix(vec.product(back, vec.product(body.inertia, frame.rotation)), body.inertia),
                spatial=body_inertia(body, frame),
                frame=frame,
            )
        )
        index[branch.body] = len(links) - 1
        frames[branch.body] = frame
        first += len(columns)
    return tuple(links)


def _reverse(rotation: Mat3, position: Vec3, column: Twist) -> Twist:
    """The twist of P relative to S, in P axes at P, from that of S relative to P, in S axes at S."""
    angular, linear = (vec.times(rotation, x) for x in column)
    return vec.neg(angular), vec.sub(vec.cross(angular, position), linear)


class JointRates(Record):
    """Motion of one link relative to its parent."""

    spin: Vec3  #: relative angular velocity sum s v, link axes
    spin_rate: Vec3  #: the sum s' v
    slide: Vec3  #: velocity of the link's origin seen from the parent, parent link axes
    slide_rate: Vec3  #: its change at v' = 0

    def product(self, link: Link, above: Vec3) -> Twist:
        """Acceleration of the link against its parent, which turns at ``above``, at v' = 0: Coriolis, centripetal."""
        # below is omega_p x r + 2 r', so that omega_p x below + r'' is what turning axes add
        below = vec.add(vec.cross(above, link.position), vec.scale(above[0].graph.constant(2.0), self.slide))
        linear = link.down(vec.add(vec.cross(above, below), self.slide_rate))
        return vec.add(self.spin_rate, vec.cross(link.down(above), self.spin)), linear


def link_twists(graph: Graph, links: tuple[Link, ...], v: tuple[Expr, ...]) -> list[Twist]:
    """Twists of all links: omega_i = R^T omega_p + sum s v (Featherstone, RBDA, eq. 4.9)."""
    twists: list[Twist] = []
    still = (vec.zero(graph), vec.zero(graph))
    for link in graph.marked(links):
        twist = link.down_twist(twists[link.parent] if link.parent != GROUND else still)
        for k, (angular, linear) in enumerate(link.columns):
            rate = v[link.first + k]
            twist = (vec.add(twist[0], vec.scale(rate, angular)), vec.add(twist[1], vec.scale(rate, linear)))
        twists.append(twist)
    return twists


def ancestors(links: Sequence[Link], k: int) -> list[int]:
    """Link k, its parent, ..., GROUND."""
    chain = [k]
    while chain[-1] != GROUND:
        chain.append(links[chain[-1]].parent)
    return chain


class Poses:
    """Placement of links and markers in ground axes or in an ancestor link, each formed once, when first used."""

    def __init__(self, mechanism: Mechanism, links: tuple[Link, ...]) -> None:
        self.graph, self.names = mechanism.graph, [body.name for body in mechanism.bodies]
        self.links = links
        self.link_of = {link.body: k for k, link in enumerate(links)} | {GROUND: GROUND}
        self._pass = self.graph.begin_pass()
        self._known: dict[tuple[int, int, tuple[Mat3, Vec3] | None], Frame] = {}
        self._turns: dict[tuple[int, ...], Turns | None] = {}

    def marker_in_link(self, marker: Marker) -> Frame:
        """Constant placement of a marker in its link frame (in ground for a ground marker)."""
        if marker.body == GROUND:
            return marker.frame
        return place(self.links[self.link_of[marker.body]].frame, marker.frame)

    def ancestors(self, link: int) -> list[int]:
        """The link, its parent, ..., GROUND."""
        return ancestors(self.links, link)

    def link(self, link: int, base: int = GROUND, within: Frame | None = None) -> Frame:
        """Placement of a link in link ``base``, one of its ancestors, or in a constant frame ``within`` that link."""
        if link == base:
            identity = Frame.identity(self.graph)
            return identity if within is None else place(within, identity)
        key = (link, base, None if within is None else (within.rotation, within.position))
        if key not in self._known:
            missing = [link]
            while (above := self.links[missing[-1]].parent) != base and (above, *key[1:]) not in self._known:
                missing.append(above)
            for k in reversed(missing):  # from base outwards, so that no chain recurses deeply
                self._known[k, base, key[2]] = self._step(k, base, within)
        return self._known[key]

    def _step(self, k: int, base: int, within: Frame | None) -> Frame:
        self.graph.mark(self._pass)
        link = self.links[k]
        if link.parent != base:
            parent = self.link(link.parent, base, within)
            rotation = vec.product(vec.product(parent.rotation, link.turn), link.joint_rotation)
            return Frame(rotation, vec.add(parent.position, vec.times(parent.rotation, link.position)))
        if within is None:
            return Frame(vec.product(link.turn, link.joint_rotation), link.position)
        holder = place(within, Frame(link.turn, link.holder))
        moved = vec.add(holder.position, vec.times(holder.rotation, link.slide))
        return Frame(vec.product(holder.rotation, link.joint_rotation), moved)

    def marker(self, marker: Marker, base: int = GROUND, within: Frame | None = None) -> Frame:
        """Placement of a marker in link ``base``, an ancestor of its link, or in a constant frame ``within`` that."""
        inner = self.marker_in_link(marker)
        link = self.link_of[marker.body]
        if link == base and within is not None:
            return place(within, inner)
        outer = self.link(link, base, within)
        return Frame(
            vec.product(outer.rotation, inner.rotation),
            vec.add(outer.position, vec.times(outer.rotation, inner.position)),
        )

    def relative(self, start: Marker, end: Marker) -> Frame:
        """Placement of marker ``end`` in the axes of marker ``start``."""
        outer, inner = self.pair(start, end)
        back = vec.transpose(outer.rotation)
        return Frame(vec.product(back, inner.rotation), vec.times(back, vec.sub(inner.position, outer.position)))

    def turns(self, rotation: Mat3, q: Sequence[Expr]) -> Turns | None:
        """What :func:`.tree.sum_of_turns` finds of a rotation, looked for once."""
        key = tuple(x.id for row in rotation for x in row)
        if key not in self._turns:
            self._turns[key] = sum_of_turns(self.graph, rotation, q)
        return self._turns[key]

    def pair(self, start: Marker, end: Marker) -> tuple[Frame, Frame]:
        """Placements of two markers in the frame of :meth:`between`."""
        base, within = self.between(start, end)
        return self.marker(start, base, within), self.marker(end, base, within)

    def between(self, start: Marker, end: Marker) -> tuple[int, Frame]:
        """The nearest link that carries both markers, and a frame in it: the joint with which one of the chains begins.

        So the frames of ground and of bodies, which a description may choose as it likes, drop out of what is relative.
        """
        base = self.common(start, end)
        within = self.marker_in_link(start)
        for marker in (end, start):
            chain = self.ancestors(self.link_of[marker.body])
            if chain[0] != base:
                link = self.links[chain[chain.index(base) - 1]]
                within = Frame(link.turn, link.holder)
                break
        along = all(x.value in (0.0, 1.0, -1.0) for row in within.rotation for x in row)
        if along:  # then the axes of the base are as simple, and labels of rows say what they mean
            within = Frame(vec.identity(self.graph), within.position)
        return base, within

    def common(self, a: Marker, b: Marker) -> int:
        """The nearest link that carries both markers."""
        first = self.ancestors(self.link_of[a.body])
        second = set(self.ancestors(self.link_of[b.body]))
        return next(k for k in first if k in second)
