"""Force elements, soil that remembers by place: a strip of cells, each a column that wheels and plates press and shear.

The states of a cell are shared by all that pass over it, so that a second wheel finds the rut of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from operator import truediv
from typing import NamedTuple

from ..elements.forces.force import Load, View, beyond_zero, where
from ..elements.frames import velocity_at
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.vectors import Vec3
from .limits import BESIDE, BLADE, FOLLOWED, GRIP, SIDES, UNSHEARED, WEDGE
from .point import Contact, Touch
from .shapes import WHOLE_PLATE
from .soil_laws import SoilPressure, SoilShear

STATES = ("shear", "grip", "sinkage")  #: of a cell, in the order in which laws hold them
COUNTS = 2  #: numbers of a cell beside its states: how far it is pressed, the sum of the squares of what deepens it


class _Column(NamedTuple):
    """Where an underside crosses the axis of a cell, in the axes x and y of the cell."""

    inside: Expr  #: whether it does
    depth: Expr
    normal: tuple[Expr, Expr]  #: out of what presses
    steep: Expr  #: change of the depth as what presses moves along it: 1 / c
    arm: tuple[Expr, Expr]  #: from the marker of what presses to where the force acts
    away: tuple[Expr, Expr]  #: direction in which the gap grows
    gap: Expr  #: distance from the cell's place, negative inside


class _Pressing(NamedTuple):
    """How a column is pressed.

    Directions, arms, depth and its rate, sliding, force along the normal, f, T and g of :class:`SoilCell`.
    """

    outward: Vec3
    along: Vec3
    arms: tuple[Vec3, Vec3]
    depth: Expr
    rate: Expr
    sliding: Expr
    push: Expr
    met: Expr
    most: Expr
    quick: Expr


class SoilCell(Contact):
    r"""A wheel or a plate on one cell of soil: a column of the length a along the ground, as wide as what presses it.

    At the depth z at which the underside crosses the axis of the cell, where its slope is c = cos of the angle between
    its normal and the column,

        F_n = p(z, z_m) a b / c along the normal of the underside        (Bekker; Wong below z_m)
        z_m' = max(0, z') h + max(0, z - z_m) / t                        the greatest sinkage at this place
        h = max(0, min(2, 1 + (z - z_m) / s)) min(1, z / s),  s = max(a / 200, z' t)
        d' = f (v - |v| d / K),  f = min(1, p / p(a / 200))               shear displacement (Janosi and Hanamoto)
        T = (f c_0 + p tan phi) (e + (1 - e) |d| / K) a b / c,  e = 0.025
        F_t = -max(-T, min(T, sqrt(T S_0) u / l)),  u' = g (sqrt(T / S_0) v - |v| u / l),  l = 0.03 K
        g = f / max(1, |v| t / l), which also multiplies F_t where it drives the underside

    of the velocity v of the underside along itself.  Where z grows at z_m, h is 1 and leads z_m to z over the length s;
    the second part of z_m' is there where something begins deeper than z_m.  F_n is dual to z, F_n = -p a b dz/dx, so
    that its power is -p a b z'.  p is that of an elastic store which falls where z_m grows, and S_0 u^2 / (2 l) is the
    most that u can give back, whatever the load does: no cycle of load, sinkage and sliding gains energy, with any
    number of wheels.  S_0 is the strength of a cell as wide as it is long at the sinkage K.  All rates are continuous,
    and none is quicker than 1 / t or |v| / K.
    """

    kind: str
    sizes: tuple[Expr, ...]
    size: Expr  #: a
    height: Vec3 | None

    # -- geometry -----------------------------------------------------------------------------------------------------
    def _place(self, view: View) -> tuple[Vec3, Expr, Expr, Vec3, Vec3]:
        """From the cell to the marker of what presses: the way, its parts, and the axes x and y of the cell."""
        axes = vec.transpose(view.rotation(self.first))
        reach = vec.sub(view.position(self.second), view.position(self.first))
        return reach, vec.dot(axes[0], reach), vec.dot(axes[1], reach), axes[0], axes[1]

    def _column(self, view: View) -> _Column:
        _, x, y, ahead, up = self._place(view)
        if self.kind != WHOLE_PLATE:
            return _under_wheel(self.sizes[0], x, y)
        axis = vec.transpose(view.rotation(self.second))[0]
        return _under_plate(self.sizes[0], self.size, x, y, (vec.dot(axis, ahead), vec.dot(axis, up)))

    def touch(self, view: View) -> Touch:
        reach, _, _, ahead, up = self._place(view)
        column = self._column(view)
        depth = where(column.inside, column.depth, -self.sizes[0])
        arm = vec.add(vec.scale(column.arm[0], ahead), vec.scale(column.arm[1], up))
        first = vec.add(reach, arm)
        return up, depth, first if self.height is None else vec.add(first, self.height), arm

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        _, _, _, ahead, up = self._place(view)
        column = self._column(view)
        return vec.add(vec.scale(column.away[0], ahead), vec.scale(column.away[1], up)), -column.gap

    # -- forces -------------------------------------------------------------------------------------------------------
    def _pressing(self, view: View) -> _Pressing:
        _, _, _, ahead, up = self._place(view)
        column = self._column(view)
        nx, ny = column.normal
        outward = vec.add(vec.scale(nx, ahead), vec.scale(ny, up))
        along = vec.sub(vec.scale(nx, up), vec.scale(ny, ahead))
        _, depth, first, second = self.touch(view)
        v1, v2 = velocity_at(view, self.first, first), velocity_at(view, self.second, second)
        velocity = vec.sub(v2, v1)
        rate, sliding = vec.dot(outward, velocity) * column.steep, vec.dot(along, velocity)
        law, shear = self._laws()
        area = self.sizes[1] * self.size
        push = law.on_pad(area, self.sizes[1]).force(depth, rate) * column.steep
        graph = view.graph
        pressed = graph.apply("lt", 0.0, push)
        begun = law.modulus_of(self.sizes[1]) * (FOLLOWED * self.size) ** law.exponent
        met = where(pressed, graph.apply("min", 1.0, push / (column.steep * area * begun)), 0.0)
        strength = where(pressed, met * shear.cohesion * area * column.steep + push * shear.slope, 0.0)
        quick = met / graph.apply("max", 1.0, graph.apply("abs", sliding) * law.settling / (GRIP * shear.modulus))
        most = strength * self._part()
        return _Pressing(outward, along, (first, second), depth, rate, sliding, push, met, most, quick)

    def _laws(self) -> tuple[SoilPressure, SoilShear]:
        assert isinstance(self.normal_law, SoilPressure)
        assert isinstance(self.friction, SoilShear)
        return self.normal_law, self.friction

    def _reference(self) -> Expr:
        """S_0."""
        law, shear = self._laws()
        stress = shear.cohesion + law.modulus_of(self.size) * shear.modulus**law.exponent * shear.slope
        strength = stress * self.size * self.size
        return where(strength.graph.apply("lt", 0.0, strength), strength, 1.0)  # without strength any number will do

    def _part(self) -> Expr:
        """T / S."""
        _, shear = self._laws()
        return UNSHEARED + (1.0 - UNSHEARED) * shear.shears[0].graph.apply("abs", shear.shears[0]) / shear.modulus

    def loads(self, view: View) -> list[Load]:
        result = self._pressing(view)
        graph = view.graph
        _, shear = self._laws()
        most = result.most
        root = beyond_zero(most * self._reference(), sqrt)
        grip = root * shear.shears[1] / (GRIP * shear.modulus)
        drag = graph.apply("max", -most, graph.apply("min", most, grip))
        drag = drag * where(graph.apply("lt", drag * result.sliding, 0.0), result.quick, 1.0)
        force = vec.neg(vec.add(vec.scale(result.push, result.outward), vec.scale(drag, result.along)))
        return self._pair(result.arms, force)

    def remainder(self, view: View) -> list[Load]:
        return self.loads(view)

    def potential(self, view: View) -> Expr | None:
        return view.graph.zero

    def sums(self, view: View) -> list[Expr]:
        """What this adds to the sums of :func:`bed_rates`."""
        result, graph = self._pressing(view), view.graph
        law, shear = self._laws()
        assert law.deepest is not None
        speed = graph.apply("abs", result.sliding)
        build = result.sliding - speed * shear.shears[0] / shear.modulus
        root = beyond_zero(result.most / self._reference(), sqrt)
        rate = root * result.sliding - speed * shear.shears[1] / (GRIP * shear.modulus)
        deeper = self._deeper(result.depth, result.rate)
        return [result.met * build, result.quick * rate, deeper, result.met, deeper * deeper]

    def _deeper(self, depth: Expr, rate: Expr) -> Expr:
        """z_m' by what presses the cell."""
        law, _ = self._laws()
        assert law.deepest is not None
        apply = depth.graph.apply
        sinking, z = apply("max", 0.0, rate), apply("max", 0.0, depth)
        near, over = apply("max", FOLLOWED * self.size, sinking * law.settling), z - law.deepest
        part = apply("max", 0.0, apply("min", 2.0, 1.0 + over / near)) * apply("min", 1.0, z / near)
        return sinking * part + apply("max", 0.0, over) / law.settling


def _under_wheel(radius: Expr, x: Expr, y: Expr) -> _Column:
    """Of a wheel, whose centre is at x, y.

    Cells beside a wheel come to it at a distance of BESIDE R.  Its rim is above the ground there until the axle is at
    0.3 R = e_0 R; the deeper a wheel, the less of its further way counts towards the ends of its diameter: with c = cos
    of the rim's angle, s its part from BESIDE to the lowest point, and e = y / R,

        z / R = c - e - (1 - s) T(e),  T'(e) = -min(1, (e_0 - e) / (e_0 - e_1)) below e_0, 0 above

    is not above 0 at BESIDE, R - y at the lowest point, and has continuous slopes.
    """
    graph = radius.graph
    apply, least, begin, end = graph.apply, (1.0 - BESIDE * BESIDE) ** 0.5, *SIDES
    far = BESIDE * radius
    inside = apply("lt", x * x, far * far)
    root = sqrt(where(inside, radius * radius - x * x, radius * radius))
    c, e = root / radius, y / radius
    part = apply("max", 0.0, apply("min", 1.0, (begin - e) / (begin - end)))
    lost = 0.5 * (begin - end) * part * part + apply("max", 0.0, end - e)
    rest = (1.0 - c) / (1.0 - least)  # 1 - s
    depth = radius * (c - e - rest * lost)
    slope_x = where(inside, -x / root, 0.0) * (1.0 + lost / (1.0 - least))
    slope_y = rest * part - 1.0
    steep = sqrt(slope_x * slope_x + slope_y * slope_y)
    normal = slope_x / steep, slope_y / steep
    above = apply("max", 0.0, y)
    distance = beyond_zero(x * x + above * above, sqrt)
    apart = apply("lt", 0.0, distance)
    length = where(apart, distance, 1.0)
    away = where(apart, x / length, 0.0), where(apart, above / length, 1.0)
    gap = where(apply("and", inside, apply("lt", 0.0, depth)), -depth, distance - radius)
    return _Column(inside, depth, normal, steep, (radius * normal[0], radius * normal[1]), away, gap)


def _under_plate(length: Expr, size: Expr, x: Expr, y: Expr, axis: tuple[Expr, Expr]) -> _Column:
    """Of a plate, whose middle is at x, y and whose axis has two parts: every point of it presses by a rounded wedge.

    Where its axis is (e_x, e_y), at -x from its middle, the lowest of these wedges counts, that of the point s:

        z = -(y + s e_y + f(w)),  w = -x - s e_x,  f(w) = m^2 r (sqrt(1 + (w / (m r))^2) - 1),  r = WEDGE a, m = BLADE

    f is strictly convex, so that s, where f'(w) e_x = e_y or else an end, is unique and continuous in all places and at
    all angles, and with it the slopes of z: (f', -1) of the place, and these at the arm s (e_x, e_y) of the angle.
    """
    graph, rounded = length.graph, WEDGE * size
    apply, half = graph.apply, 0.5 * length
    turned = apply("lt", axis[0], 0.0)
    ex, ey = (where(turned, -part, part) for part in axis)
    reach = BLADE * ex
    flat = apply("lt", apply("abs", ey), reach)  # where f' comes to its slope
    aside = rounded * BLADE * ey / sqrt(where(flat, (reach - ey) * (reach + ey), 1.0))
    lower = where(apply("lt", 0.0, ey), -half, half)
    place = apply("max", -half, apply("min", half, (-x - aside) / where(flat, ex, 1.0)))
    place = where(flat, place, lower)
    w = -x - place * ex
    part = w / (BLADE * rounded)
    root = sqrt(1.0 + part * part)
    slope = BLADE * part / root
    level = y + place * ey + BLADE * BLADE * rounded * part * part / (1.0 + root)
    steep = sqrt(1.0 + slope * slope)
    normal = slope / steep, -1.0 / steep
    return _Column(graph.one, -level, normal, steep, (place * ex, place * ey), (-normal[0], -normal[1]), level / steep)


def bed_rates(states: Sequence[Expr], sums: Sequence[Expr], recovery: Expr) -> list[Expr]:
    """Rates of the states of all cells, from the sums over what presses them.

    Shear is forgotten where nothing presses; the greatest sinkage stays.  What deepens a cell counts by how quickly it
    does: sum of squares by sum, which is the rate of one that deepens it alone.
    """
    result: list[Expr] = []
    each, slots = len(STATES), len(STATES) + COUNTS
    for k in states[0].graph.marked(range(len(states) // each)):
        *rates, deeper, pressed, squares = sums[k * slots : (k + 1) * slots]
        free = pressed.graph.apply("max", 0.0, 1.0 - pressed) / recovery
        shears = states[k * each : k * each + each - 1]
        result += [rate - free * state for rate, state in zip(rates, shears, strict=True)]
        result.append(beyond_zero(deeper, partial(truediv, squares)))
    return result
