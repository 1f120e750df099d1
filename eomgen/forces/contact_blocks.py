"""Force elements, contact of ellipsoids and cuboids -> where they touch."""

from __future__ import annotations

import itertools

from ..graph import vectors as vec
from ..graph.core import Expr, sqrt
from ..graph.vectors import Mat3, Vec3
from ..records import dataclass
from .branches import where
from .contact import Contact, Touch
from .contact_ellipsoids import nearest, normal_across, quadratic_form
from .contact_rounds import seen_from
from .force import View


@dataclass(frozen=True)
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

    def touch(self, view: View) -> Touch:
        graph = view.graph
        reach, R, place = seen_from(self, view)
        turn = vec.product(vec.transpose(R), view.rotation(self.second))
        form = quadratic_form(turn, self.axes)
        signs = self._eighth(place, turn)
        x, y, z = (s * h for s, h in zip(signs, self.halves, strict=True))
        d = vec.sub(place, (x, y, z))
        best, gap = None, graph.zero
        for n in self._normals(view, turn, form, signs, d):
            own = vec.dot(n, d) - sqrt(vec.dot(n, vec.times(form, n)))
            if best is None:
                best, gap = n, own
                continue
            better = graph.apply("lt", gap, own)
            for s, k in zip(signs, n, strict=True):
                better = graph.apply("and", better, graph.apply("le", 0.0, s * k))
            gap = where(better, own, gap)
            a, b, c = (where(better, p, q) for p, q in zip(n, best, strict=True))
            best = (a, b, c)
        assert best is not None
        toward = vec.times(form, best)
        size = sqrt(vec.dot(best, toward))
        depth = size - vec.dot(best, d)
        second = vec.times(R, vec.sub(vec.scale(0.5 * depth, best), vec.scale(1.0 / size, toward)))
        return vec.times(R, best), depth, vec.add(reach, second), second

    def _normals(self, view: View, turn: Mat3, form: Mat3, signs: Vec3, d: Vec3) -> list[Vec3]:
        """Directions in which a gap may be greatest: along faces, from edges, from the corner."""
        zero = view.graph.zero
        found: list[Vec3] = [(signs[0], zero, zero), (zero, signs[1], zero), (zero, zero, signs[2])]
        for i, j in itertools.combinations(range(3), 2):
            nx, ny, _ = normal_across(view, (-d[i], -d[j]), (form[i][i], form[i][j], form[j][j]))
            n = [zero, zero, zero]
            n[i], n[j] = -nx, -ny
            found.append((n[0], n[1], n[2]))
        normal, _ = nearest(view, self.axes, vec.neg(vec.transpose_times(turn, d)))
        found.append(vec.neg(vec.times(turn, normal)))
        return found

    def _eighth(self, place: Vec3, turn: Mat3) -> Vec3:
        """1 or -1 along each axis: where the point of the cuboid is that is least by the ellipsoid's form.

        It is the least of those of all faces and edges, and of the inside.
        """
        graph = place[0].graph
        a, b, c = (1.0 / k for k in self.axes)
        form = quadratic_form(turn, (a, b, c))

        def held(k: int, x: Expr) -> Expr:
            return graph.apply("max", -self.halves[k], graph.apply("min", self.halves[k], x))

        least = [held(k, place[k]) for k in range(3)]
        amount = self._amount(form, place, least)
        for points in self._points(form, place):
            points = [held(k, x) for k, x in enumerate(points)]
            own = self._amount(form, place, points)
            smaller = graph.apply("lt", own, amount)
            amount = where(smaller, own, amount)
            least = [where(smaller, x, y) for x, y in zip(points, least, strict=True)]
        x, y, z = (where(graph.apply("lt", k, 0.0), -1.0, 1.0) for k in least)
        return x, y, z

    @staticmethod
    def _amount(form: Mat3, place: Vec3, x: list[Expr]) -> Expr:
        away = vec.sub((x[0], x[1], x[2]), place)
        return vec.dot(away, vec.times(form, away))

    def _points(self, form: Mat3, place: Vec3) -> list[list[Expr]]:
        """The least points of the planes of faces and of the lines of edges."""
        found: list[list[Expr]] = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            det = form[i][i] * form[j][j] - form[i][j] * form[i][j]
            slope_i = (form[i][j] * form[j][k] - form[j][j] * form[i][k]) / det
            slope_j = (form[i][j] * form[i][k] - form[i][i] * form[j][k]) / det
            for side in (-1.0, 1.0):
                x = list(place)
                x[k] = side * self.halves[k]
                x[i], x[j] = place[i] + slope_i * (x[k] - place[k]), place[j] + slope_j * (x[k] - place[k])
                found.append(x)
            for one, other in itertools.product((-1.0, 1.0), repeat=2):  # along the edge k
                x = list(place)
                x[i], x[j] = one * self.halves[i], other * self.halves[j]
                x[k] = place[k] - (form[k][i] * (x[i] - place[i]) + form[k][j] * (x[j] - place[j])) / form[k][k]
                found.append(x)
        return found
