"""Contact of ellipsoids and cuboids, with planes, spheres, rods and each other -> where they touch."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import reduce

from ..elements.forces.force import View, where
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.vectors import Mat3, Vec3
from .limits import ASIDE, BACK, COMMON, EQUAL, FOCAL, NEAREST, NOWHERE, PLAIN, POLISHED, TWICE, UNIQUE
from .point import Contact, Touch
from .rounds import along_axis, converged, direction, seen_from

# -- ellipsoids --------------------------------------------------------------------------------------------------------


#: Part of the plain step's determinant below which Newton's step is not taken: it is (1 - UNIQUE)^2 of spheres that are
#: as deep as they may be.
_TOO_BENT = 0.002


class EllipsoidPlane(Contact):
    """An ellipsoid about the second marker, half axes along its x, y, z, on the plane through the first.

    Its lowest point is -(a^2 n_x, b^2 n_y, c^2 n_z) / w, w = sqrt(a^2 n_x^2 + b^2 n_y^2 + c^2 n_z^2), of the plane's
    normal n in the ellipsoid's axes.
    """

    axes: tuple[Expr, Expr, Expr]

    def touch(self, view: View) -> Touch:
        R = view.rotation(self.second)
        normal = vec.transpose(view.rotation(self.first))[2]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        n = vec.transpose_times(R, normal)
        x, y, z = (a * a * k for a, k in zip(self.axes, n, strict=True))
        w = sqrt(vec.dot((x, y, z), n))
        depth = w - vec.dot(normal, reach)
        lowest = vec.times(R, (-x / w, -y / w, -z / w))
        second = vec.add(lowest, vec.scale(0.5 * depth, normal))
        return normal, depth, vec.add(reach, second), second


def quadratic_form(R: Mat3, axes: tuple[Expr, Expr, Expr]) -> Mat3:
    """R diag(a^2, b^2, c^2) R^T of an ellipsoid's half axes."""
    a, b, c = (x * x for x in axes)
    x, y, z = ((p * a, q * b, r * c) for p, q, r in R)
    return vec.product((x, y, z), vec.transpose(R))


def nearest(view: View, axes: Sequence[Expr], place: Sequence[Expr]) -> tuple[tuple[Expr, ...], Expr]:
    """The outward normal at the point of an ellipsoid or an ellipse nearest to a place, and how far that is outside.

    The nearest point to p is (a^2 p_x / (t + a^2), ...), where S(t), the sum of (a p_x / (t + a^2))^2, is 1 (Eberly,
    Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid, 2013); t times (p_x / (t + a^2), ...) leads
    from it to p.  Newton's method for 1 / sqrt(S) = 1, which is nearly linear (More and Sorensen, SIAM J. Sci. Stat.
    Comput. 4, 1983, 553-572), comes to t from the side on which S > 1, where the largest of the squares is 1, or
    t = 0 of a centre outside.  Where S is less than 1 there, as about the centre of the ellipsoid, two points on both
    sides of the least axis are nearest (Eberly, section 3); the one on the side of p counts, or the positive one.
    """
    graph = view.graph
    squares = [a * a for a in axes]
    scaled = [a * p for a, p in zip(axes, place, strict=True)]
    least = reduce(lambda a, b: graph.apply("min", a, b), squares)
    begin = -(1.0 - FOCAL) * least
    for s, q in zip(scaled, squares, strict=True):
        begin = graph.apply("max", begin, graph.apply("max", s, -s) - q)
    outside = graph.apply("lt", 1.0, _square([p / a for p, a in zip(place, axes, strict=True)]))
    begin = where(outside, graph.apply("max", begin, 0.0), begin)

    def parts_at(t: Expr) -> tuple[list[Expr], Expr]:
        parts = [s / (t + q) for s, q in zip(scaled, squares, strict=True)]
        return parts, _square(parts)

    t = begin
    for k in range(NEAREST):
        t = converged(view, t) if k == NEAREST - 1 else t
        parts, total = parts_at(t)
        slope = sum((s * s / (t + q) for s, q in zip(parts, squares, strict=True)), graph.zero)
        rising = graph.apply("lt", 0.0, slope)  # but at the centre
        t = graph.apply("max", begin, t + total * (sqrt(where(rising, total, 1.0)) - 1.0) / where(rising, slope, 1.0))
    parts, _ = parts_at(t)
    both = graph.apply("lt", parts_at(begin)[1], 1.0)
    chosen, free = list[Expr](), graph.one
    for part, q in zip(parts, squares, strict=True):
        mine = where(graph.apply("le", q, least), free, 0.0)  # the least axis, the first of equal ones
        free = free - mine
        rest = graph.apply("max", 0.0, 1.0 - sum((other * other for other in parts if other is not part), graph.zero))
        completed = sqrt(where(both, where(graph.apply("lt", 0.0, rest), rest, 1.0), 1.0))
        completed = where(graph.apply("lt", part, 0.0), -completed, completed)
        chosen.append(where(both, where(graph.apply("lt", 0.0, mine), completed, part), part))
    normal = [s / a for s, a in zip(chosen, axes, strict=True)]
    size = sqrt(_square(normal))
    return tuple(x / size for x in normal), t * size


def _square(x: Sequence[Expr]) -> Expr:
    return reduce(lambda a, b: a + b, (one * one for one in x))


def unique_depth(axes: Sequence[Expr], width: Expr) -> Expr:
    """How deep in an ellipsoid every point has one nearest place, below that of a normal with the half width h.

    The line along the normal n from there, (a^2 n_x / h, ...), is at a^2 / h in the plane across the least axis a,
    where two places are as near.  A ball of this radius lies in the ellipsoid, so that in the sum of two convex bodies
    that of the sum of both does, and the place is the nearest of all.
    """
    least = reduce(lambda a, b: a.graph.apply("min", a, b), axes)
    return UNIQUE * least * least / width


def unless_spheres(axes: Sequence[Sequence[Expr]], depth: Expr) -> Expr:
    """A depth; without end where the axes of each ellipsoid are equal, as lines between centres are normals then."""
    graph = depth.graph
    equal = [graph.apply("and", graph.apply("eq", x, y), graph.apply("eq", y, z)) for x, y, z in axes]
    return where(reduce(lambda a, b: graph.apply("and", a, b), equal), NOWHERE, depth)


class EllipsoidRound(Contact):
    """A sphere about the second marker on an ellipsoid about the first, half axes along its x, y, z."""

    axes: tuple[Expr, Expr, Expr]
    radius: Expr

    def touch(self, view: View) -> Touch:
        reach, R, place = seen_from(self, view)
        return self._touching(reach, R, *nearest(view, self.axes, place))

    def _touching(self, reach: Vec3, R: Mat3, normal: tuple[Expr, ...], gap: Expr) -> Touch:
        """A sphere at which ``reach`` ends."""
        x, y, z = normal
        out = vec.times(R, (x, y, z))
        depth = self.radius - gap
        second = vec.scale(0.5 * depth - self.radius, out)
        return out, depth, vec.add(reach, second), second


def silhouette_normal(view: View, r: tuple[Expr, Expr], form: tuple[Expr, Expr, Expr]) -> tuple[Expr, Expr, Expr]:
    """The unit vector n in a plane for which n r - sqrt(n B n) is greatest, and that root; B is xx, xy, yy.

    It is the normal of the ellipse of B at the point that is nearest to r, in the axes of B; Newton's steps for the
    greatest n r - sqrt(n B n) behind it have derivatives where the axes have none, of a circle.
    """
    graph, (bxx, bxy, byy) = view.graph, form
    mean, half = 0.5 * (bxx + byy), 0.5 * (bxx - byy)
    square = half * half + bxy * bxy
    bent = graph.apply("lt", 0.0, square)
    spread = where(bent, sqrt(where(bent, square, 1.0)), 0.0)
    double = where(bent, half / where(bent, spread, 1.0), 1.0)  # cosine of twice the angle of the longer axis
    c, s = (sqrt(graph.apply("max", 0.0, 0.5 + way * 0.5 * double)) for way in (1.0, -1.0))
    s = where(graph.apply("lt", bxy, 0.0), -s, s)
    axes = sqrt(mean + spread), sqrt((bxx * byy - bxy * bxy) / (mean + spread))
    (along, aside), _ = nearest(view, axes, (c * r[0] + s * r[1], c * r[1] - s * r[0]))
    nx, ny = c * along - s * aside, s * along + c * aside
    for k in range(POLISHED):
        if k == POLISHED - 1:
            nx, ny = converged(view, nx), converged(view, ny)
        bx, by = bxx * nx + bxy * ny, bxy * nx + byy * ny
        h = sqrt(nx * bx + ny * by)
        gx, gy = r[0] - bx / h, r[1] - by / h
        cross = nx * by - ny * bx
        bend = (ny * ny * bxx - 2.0 * nx * ny * bxy + nx * nx * byy) / h - cross * cross / (h * h * h)
        whole = bend + nx * gx + ny * gy
        step = (nx * gy - ny * gx) / where(graph.apply("lt", _TOO_BENT * bend, whole), whole, bend)
        nx, ny = nx - step * ny, ny + step * nx
        size = sqrt(nx * nx + ny * ny)
        nx, ny = nx / size, ny / size
    return nx, ny, sqrt(nx * (bxx * nx + bxy * ny) + ny * (bxy * nx + byy * ny))


class EllipsoidRod(EllipsoidRound):
    """A rod along x of the second marker, of a radius, on an ellipsoid about the first.

    It touches as the sphere about that point of its axis which is nearest to the ellipsoid: the signed distance of a
    convex body is convex, so that the nearest point of the whole line, held between the ends, is the nearest.  That of
    the line is found across it, where the ellipsoid is an ellipse, by the normal n that makes n r - sqrt(n B n)
    greatest, r from the centre to the line, B = R diag(a^2, b^2, c^2) R^T.  Of a line deep in a slim ellipsoid that may
    be another, so that the point in the least of all ellipsoids of this form counts where it is nearer.
    """

    half: Expr

    def deepest(self, view: View) -> Expr:
        normal = vec.transpose_times(view.rotation(self.first), self.touch(view)[0])
        width = sqrt(_square([a * x for a, x in zip(self.axes, normal, strict=True)]))
        return unless_spheres([self.axes], self.radius + unique_depth(self.axes, width))

    def touch(self, view: View) -> Touch:
        graph = view.graph
        reach, R, place = seen_from(self, view)
        along, *lateral = (vec.transpose_times(R, axis) for axis in vec.transpose(view.rotation(self.second)))
        squares = [a * a for a in self.axes]

        def form(a: Vec3, b: Vec3) -> Expr:
            return sum((q * x * y for q, x, y in zip(squares, a, b, strict=True)), graph.zero)

        r = vec.dot(lateral[0], place), vec.dot(lateral[1], place)
        bxx, bxy, byy = form(lateral[0], lateral[0]), form(lateral[0], lateral[1]), form(lateral[1], lateral[1])
        nx, ny, h = silhouette_normal(view, r, (bxx, bxy, byy))
        n = vec.add(vec.scale(nx, lateral[0]), vec.scale(ny, lateral[1]))
        scaled = [x / q for x, q in zip(along, squares, strict=True)]
        in_least = -sum((x * p for x, p in zip(scaled, place, strict=True)), graph.zero)
        in_least = in_least / sum((x * y for x, y in zip(scaled, along, strict=True)), graph.zero)
        both: list[list[Expr]] = []
        for x in (form(along, n) / h - vec.dot(along, place), in_least):
            s = graph.apply("max", -self.half, graph.apply("min", self.half, x))
            outward, gap = nearest(view, self.axes, vec.add(place, vec.scale(s, along)))
            both.append([gap, s, *outward])
        nearer = graph.apply("lt", both[1][0], both[0][0] - EQUAL * self.radius)
        gap, s, *normal = (where(nearer, b, a) for a, b in zip(*both, strict=True))
        arm = vec.times(R, vec.scale(s, along))
        out, depth, first, second = self._touching(vec.add(reach, arm), R, tuple(normal), gap)
        return out, depth, first, vec.add(arm, second)


def _solved(rows: Mat3, right: Vec3) -> tuple[Vec3, Expr]:
    """The solution of three equations times the determinant, and that."""
    a, b, c = rows
    first = vec.cross(b, c)
    result = vec.add(vec.scale(right[0], first), vec.scale(right[1], vec.cross(c, a)))
    return vec.add(result, vec.scale(right[2], vec.cross(a, b))), vec.dot(a, first)


def _weighed(weight: Expr, a: Mat3, other: Expr, b: Mat3) -> Mat3:
    x, y, z = (vec.add(vec.scale(weight, p), vec.scale(other, q)) for p, q in zip(a, b, strict=True))
    return x, y, z


def _outer(weight: Expr, a: Vec3) -> Mat3:
    x, y, z = (vec.scale(weight * k, a) for k in a)
    return x, y, z


class EllipsoidEllipsoid(Contact):
    """Two ellipsoids about the markers, half axes along their x, y, z: contact along their common normal n.

    The gap n r - sqrt(n B1 n) - sqrt(n B2 n), with r from centre to centre and B = R diag(a^2, b^2, c^2) R^T, is
    greatest there among all n of length 1, be it positive or, for bodies that overlap, negative.  So it changes with
    positions as if n did not, and the force has a potential.  Newton's method on the sphere of all n begins at the
    normal where both bodies, scaled by one factor, would just touch (Perram and Wertheim, J. Comput. Phys. 58, 1985,
    409-416): n = (l B1 + (1 - l) B2)^-1 r with the l that makes l^2 n B1 n equal (1 - l)^2 n B2 n.
    """

    axes: tuple[tuple[Expr, Expr, Expr], tuple[Expr, Expr, Expr]]

    def deepest(self, view: View) -> Expr:
        """Nothing where the steps did not come to a common normal, of slim ellipsoids that are deep in each other."""
        n, (h1, h2), (near, other, reach) = self._met(view)
        size, way = h1 + h2, vec.sub(reach, vec.add(vec.scale(1.0 / h1, near), vec.scale(1.0 / h2, other)))
        aside = vec.sub(way, vec.scale(vec.dot(n, way), n))
        common = view.graph.apply("le", vec.dot(aside, aside), ASIDE * size * size)
        most = unique_depth(self.axes[0], h1) + unique_depth(self.axes[1], h2)
        return unless_spheres(self.axes, where(common, most, 0.0))

    def touch(self, view: View) -> Touch:
        n, (h1, h2), (near, _, reach) = self._met(view)
        depth = h1 + h2 - vec.dot(n, reach)
        first = vec.sub(vec.scale(1.0 / h1, near), vec.scale(0.5 * depth, n))
        return n, depth, first, vec.sub(first, reach)

    def _met(self, view: View) -> tuple[Vec3, tuple[Expr, Expr], tuple[Vec3, Vec3, Vec3]]:
        """The normal n, half widths along it, B1 n, B2 n and the way between centres."""
        graph = view.graph
        markers = zip((self.first, self.second), self.axes, strict=True)
        forms = [quadratic_form(view.rotation(marker), axes) for marker, axes in markers]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        apart = graph.apply("lt", 0.0, vec.dot(reach, reach))
        x, y, z = (where(apart, a, b) for a, b in zip(reach, along_axis(view, self.first, 0), strict=True))
        n = self._begin(forms, (x, y, z))
        before, most = n, -NOWHERE * graph.one
        for _ in range(COMMON - PLAIN):
            n, before, most = self._rising_step(forms, reach, n, before, most)
        for _ in range(PLAIN - 1):
            n = self._step(forms, reach, n)[0]
        x, y, z = n
        n = self._step(forms, reach, (converged(view, x), converged(view, y), converged(view, z)))[0]
        near, other = (vec.times(B, n) for B in forms)
        return n, (sqrt(vec.dot(n, near)), sqrt(vec.dot(n, other))), (near, other, reach)

    @staticmethod
    def _begin(forms: list[Mat3], reach: Vec3) -> Vec3:
        part = reach[0].graph.constant(0.5)
        for k in range(TWICE + 1):
            n, det = _solved(_weighed(part, forms[0], 1.0 - part, forms[1]), reach)
            if k < TWICE:
                a, b = (sqrt(vec.dot(n, vec.times(B, n))) for B in forms)
                part = b / (a + b)
        x, y, z = (k / det for k in n)
        size = sqrt(x * x + y * y + z * z)
        return x / size, y / size, z / size

    def _rising_step(
        self, forms: list[Mat3], reach: Vec3, n: Vec3, before: Vec3, most: Expr
    ) -> tuple[Vec3, Vec3, Expr]:
        """A step, or back on the last one where it was so long that the gap got less than the most before it."""
        step, gap = self._step(forms, reach, n)
        falls = gap.graph.apply("lt", gap, most)
        back = direction(vec.add(before, vec.scale(BACK * gap.graph.one, vec.sub(n, before))), n)[0]
        x, y, z = (where(falls, a, b) for a, b in zip(back, step, strict=True))
        p, q, r = (where(falls, a, b) for a, b in zip(before, n, strict=True))
        return (x, y, z), (p, q, r), where(falls, most, gap)

    @staticmethod
    def _step(forms: list[Mat3], reach: Vec3, n: Vec3) -> tuple[Vec3, Expr]:
        """Newton's step towards the normal of the greatest gap, and the gap along n."""
        graph = reach[0].graph
        bend = _outer(graph.one, n)
        gap = reach
        for B in forms:
            first = vec.times(B, n)
            h = sqrt(vec.dot(n, first))
            gap = vec.sub(gap, vec.scale(1.0 / h, first))
            bend = _weighed(
                graph.one, bend, graph.one, _weighed(1.0 / h, B, -1.0 / (h * h * h), _outer(graph.one, first))
            )
        rise = vec.dot(n, gap)
        aside = vec.sub(gap, vec.scale(rise, n))
        more = _weighed(rise, vec.identity(graph), -rise, _outer(graph.one, n))
        whole = _weighed(graph.one, bend, graph.one, more)
        (way, det), (plain, det0) = _solved(whole, aside), _solved(bend, aside)
        trace = whole[0][0] + whole[1][1] + whole[2][2] - 1.0
        good = graph.apply("and", graph.apply("lt", _TOO_BENT * det0, det), graph.apply("lt", 0.0, trace))
        x, y, z = (a + where(good, p, q) / where(good, det, det0) for a, p, q in zip(n, way, plain, strict=True))
        return direction((x, y, z), n)[0], rise


# -- cuboids -----------------------------------------------------------------------------------------------------------


class BlockEllipsoid(Contact):
    """An ellipsoid about the second marker on a cuboid about the first, half lengths and half axes along x, y, z.

    The gap n r - w(n) - u(n), with the supports w of the cuboid and u of the ellipsoid and r from centre to centre, is
    greatest along the normal of the contact, be it positive or, for bodies that overlap, negative, as between
    ellipsoids.  Among directions n whose components have the signs of a corner c it is n (r - c) - u(n): greatest for
    the point of the ellipsoid that is nearest to the corner, for that nearest to an edge (one component of n is 0), or
    along the normal of a face.  Of those whose n has these signs the one with the greatest gap counts, so that it
    changes continuously from a face to an edge to a corner.

    The corner is that of the eighth of the cuboid in which its nearest point lies, measured by the ellipsoid's form:
    where that changes the components of n that change their sign are 0.
    """

    halves: Vec3
    axes: tuple[Expr, Expr, Expr]

    def deepest(self, view: View) -> Expr:
        graph, (n, width, _) = view.graph, self._met(view)
        facing = reduce(lambda a, b: graph.apply("max", a, b), (graph.apply("abs", x) for x in n))
        face = graph.apply("le", 1.0, facing)  # its normal is the same at all depths
        return unless_spheres([self.axes], where(face, NOWHERE, unique_depth(self.axes, width)))

    def touch(self, view: View) -> Touch:
        reach, R, _ = seen_from(self, view)
        best, size, (toward, d) = self._met(view)
        depth = size - vec.dot(best, d)
        second = vec.times(R, vec.sub(vec.scale(0.5 * depth, best), vec.scale(1.0 / size, toward)))
        return vec.times(R, best), depth, vec.add(reach, second), second

    def _met(self, view: View) -> tuple[Vec3, Expr, tuple[Vec3, Vec3]]:
        """The normal n, the ellipsoid's half width along it, B n and the way from the corner, in the cuboid's axes."""
        graph = view.graph
        _, R, place = seen_from(self, view)
        turn = vec.product(vec.transpose(R), view.rotation(self.second))
        form = quadratic_form(turn, self.axes)
        signs = self._eighth(place, turn)
        x, y, z = (s * h for s, h in zip(signs, self.halves, strict=True))
        d = vec.sub(place, (x, y, z))
        best, gap = None, graph.zero
        for n in self._normals(view, turn, form, signs, d):
            distance = vec.dot(n, d) - sqrt(vec.dot(n, vec.times(form, n)))
            if best is None:
                best, gap = n, distance
                continue
            better = graph.apply("lt", gap, distance)
            for s, k in zip(signs, n, strict=True):
                better = graph.apply("and", better, graph.apply("le", 0.0, s * k))
            gap = where(better, distance, gap)
            a, b, c = (where(better, p, q) for p, q in zip(n, best, strict=True))
            best = (a, b, c)
        assert best is not None
        toward = vec.times(form, best)
        return best, sqrt(vec.dot(best, toward)), (toward, d)

    def _normals(self, view: View, turn: Mat3, form: Mat3, signs: Vec3, d: Vec3) -> list[Vec3]:
        """Directions in which a gap may be greatest: along faces, from edges, from the corner."""
        zero = view.graph.zero
        result: list[Vec3] = [(signs[0], zero, zero), (zero, signs[1], zero), (zero, zero, signs[2])]
        for i, j in itertools.combinations(range(3), 2):
            nx, ny, _ = silhouette_normal(view, (-d[i], -d[j]), (form[i][i], form[i][j], form[j][j]))
            n = [zero, zero, zero]
            n[i], n[j] = -nx, -ny
            result.append((n[0], n[1], n[2]))
        (x, y, z), _ = nearest(view, self.axes, vec.neg(vec.transpose_times(turn, d)))
        result.append(vec.neg(vec.times(turn, (x, y, z))))
        return result

    def _eighth(self, place: Vec3, turn: Mat3) -> Vec3:
        """1 or -1 along each axis: where the point of the cuboid is that is least by the ellipsoid's form.

        It is the least of those of all faces and edges, and of the inside.
        """
        graph = place[0].graph
        a, b, c = (1.0 / k for k in self.axes)
        form = quadratic_form(turn, (a, b, c))

        def clamped(k: int, x: Expr) -> Expr:
            return graph.apply("max", -self.halves[k], graph.apply("min", self.halves[k], x))

        least = [clamped(k, place[k]) for k in range(3)]
        amount = self._amount(form, place, least)
        for points in self._points(form, place):
            points = [clamped(k, x) for k, x in enumerate(points)]
            whole = self._amount(form, place, points)
            smaller = graph.apply("lt", whole, amount)
            amount = where(smaller, whole, amount)
            least = [where(smaller, x, y) for x, y in zip(points, least, strict=True)]
        x, y, z = (where(graph.apply("lt", k, 0.0), -1.0, 1.0) for k in least)
        return x, y, z

    @staticmethod
    def _amount(form: Mat3, place: Vec3, x: list[Expr]) -> Expr:
        away = vec.sub((x[0], x[1], x[2]), place)
        return vec.dot(away, vec.times(form, away))

    def _points(self, form: Mat3, place: Vec3) -> list[list[Expr]]:
        """The least points of the planes of faces and of the lines of edges."""
        result: list[list[Expr]] = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            det = form[i][i] * form[j][j] - form[i][j] * form[i][j]
            slope_i = (form[i][j] * form[j][k] - form[j][j] * form[i][k]) / det
            slope_j = (form[i][j] * form[i][k] - form[i][i] * form[j][k]) / det
            for side in (-1.0, 1.0):
                x = list(place)
                x[k] = side * self.halves[k]
                x[i], x[j] = place[i] + slope_i * (x[k] - place[k]), place[j] + slope_j * (x[k] - place[k])
                result.append(x)
            for one, other in itertools.product((-1.0, 1.0), repeat=2):  # along the edge k
                x = list(place)
                x[i], x[j] = one * self.halves[i], other * self.halves[j]
                x[k] = place[k] - (form[k][i] * (x[i] - place[i]) + form[k][j] * (x[j] - place[j])) / form[k][k]
                result.append(x)
        return result
