"""Force elements, bushing: six relative displacements of two markers times full matrices of stiffness and damping."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from ...base.records import dataclass
from ...base.value_rules import Allowed
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt
from ...expr.vectors import Vec3
from ..dimensions import ENERGY, TIME
from ..element_type import Entry, Where, element, key, table
from ..frames import Marker
from ..kinds import LAW, Matrix6
from ..looks import RUBBER, Drawn, Seen
from ..scalars import dot
from .force import Force, Load, MarkerLoad, View
from .paths import BETWEEN

Row6 = tuple[Expr, Expr, Expr, Expr, Expr, Expr]
Mat6 = tuple[Row6, Row6, Row6, Row6, Row6, Row6]


@dataclass(frozen=True)
class Bushing(Force):
    """Forces -K y - C y' of the displacements y = [d; theta] of marker ``second`` from marker ``first``.

    d (m) is the vector between their origins in the axes of the first; theta (rad) = 2 sin(phi / 2) n for the relative
    rotation by phi about n: twice the vector part of its Euler parameters, the same in the axes of either marker, equal
    to the small-rotation vector to second order, defined for phi < pi.  The force acts at the second marker's origin,
    its opposite at the same point on the first body.  K is symmetric; V = y^T K y / 2.
    """

    sentence = (
        r"A bushing: forces and torques proportional to the six displacements $\mathbf{y}$ and their "
        "rates."
    )
    formula = r"\mathbf{Q} = -\mathbf{K} \mathbf{y} - \mathbf{D} \dot{\mathbf{y}}"
    first: Marker
    second: Marker
    stiffness: Mat6 = key(
        Matrix6(
            "six values for the diagonal, three of forces and three of torques, or a symmetric 6 x 6 matrix (N/m, N, "
            "N m/rad)",
            required=True, dimension=ENERGY,
        )
    )  # fmt: skip
    damping: Mat6 = key(
        Matrix6(
            "the same form, for the velocity of the displacement (N s/m, N s, N m s/rad)",
            default=(0,) * 6, level=LAW, dimension=ENERGY.times(TIME),
        )
    )  # fmt: skip

    def drawn(self) -> list[Seen]:
        return [Drawn((self.first, self.second), along=RUBBER)]

    def loads(self, view: View) -> list[Load]:
        y, rate = self._displacements(view), self._rates(view)
        return self._pair(
            view, [-(a + b) for a, b in zip(_times(self.stiffness, y), _times(self.damping, rate), strict=True)]
        )

    def potential(self, view: View) -> Expr | None:
        y = self._displacements(view)
        total = view.graph.zero
        for a, b in zip(y, _times(self.stiffness, y), strict=True):
            total = total + a * b
        return 0.5 * total

    def remainder(self, view: View) -> list[Load]:
        if all(entry.is_zero for row in self.damping for entry in row):
            return []
        return self._pair(view, [-x for x in _times(self.damping, self._rates(view))])

    def _reach(self, view: View) -> Vec3:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        return vec.transpose_times(view.rotation(self.first), reach)

    def _turn(self, view: View) -> tuple[Expr, Vec3]:
        """Scalar and vector part of the Euler parameters of the relative rotation, the scalar part positive.

        R gives Q = 4 e e^T.  Its first column z = 4 e0 e alone would do, but keeps eps / e0^2 only, and e0 = 0 for
        phi = pi; e = Q z / (2 sqrt(z^T Q z)) keeps all digits, as errors of z across e do not count.
        """
        R = vec.product(vec.transpose(view.rotation(self.first)), view.rotation(self.second))
        x, y, z = R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]
        xy, yz, zx = R[0][1] + R[1][0], R[1][2] + R[2][1], R[2][0] + R[0][2]
        a, b, c = R[0][0], R[1][1], R[2][2]
        Q = (
            (1.0 + a + b + c, x, y, z),
            (x, 1.0 + a - b - c, xy, zx),
            (y, xy, 1.0 - a + b - c, yz),
            (z, zx, yz, 1.0 - a - b + c),
        )
        along = [dot(row, Q[0]) for row in Q]
        size = 2.0 * sqrt(dot(along, Q[0]))
        return along[0] / size, (along[1] / size, along[2] / size, along[3] / size)

    def _displacements(self, view: View) -> list[Expr]:
        _, e = self._turn(view)
        return [*self._reach(view), *(2.0 * x for x in e)]

    def _rates(self, view: View) -> list[Expr]:
        """d' = R^T (v_2 - v_1) - w_1 x d and theta' = e0 w + w x e, w the relative angular velocity, in first axes."""
        axes = view.rotation(self.first)
        w1 = view.angular_velocity(self.first)
        w = vec.transpose_times(axes, vec.sub(view.angular_velocity(self.second), w1))
        drift = vec.cross(w1, vec.sub(view.position(self.second), view.position(self.first)))
        relative = vec.sub(vec.sub(view.velocity(self.second), view.velocity(self.first)), drift)
        e0, e = self._turn(view)
        return [*vec.transpose_times(axes, relative), *vec.add(vec.scale(e0, w), vec.cross(w, e))]

    def _pair(self, view: View, along: Sequence[Expr]) -> list[Load]:
        """Wrenches whose power is that of the six forces on the six rates: torque e0 m + e x m of the moments m."""
        force: Vec3 = (along[0], along[1], along[2])
        moments: Vec3 = (along[3], along[4], along[5])
        e0, e = self._turn(view)
        axes = view.rotation(self.first)
        push = vec.times(axes, force)
        turn = vec.times(axes, vec.add(vec.scale(e0, moments), vec.cross(e, moments)))
        reach = vec.sub(view.position(self.second), view.position(self.first))
        back = vec.neg(vec.add(turn, vec.cross(reach, push)))
        return [MarkerLoad(self.second, push, turn), MarkerLoad(self.first, vec.neg(push), back)]


def _times(m: Mat6, y: Sequence[Expr]) -> list[Expr]:
    return [dot(row, y) for row in m]


def _check_symmetry(e: Entry) -> None:
    stiffness: Mat6 | None = e["stiffness"]
    if stiffness is None:
        return
    for i, j in combinations(range(6), 2):
        difference, place = stiffness[j][i] - stiffness[i][j], f"stiffness[{j}][{i}]"
        if difference.value is None:
            rule = "this is its difference from [j][i]; both must be equal"
            e.require(place, difference, Allowed(0.0, 0.0), rule)
        elif not difference.is_zero:
            e.fault(place, "the matrix is not symmetric", "[i][j] and [j][i] must be equal", "EG-RANGE")


TYPES = table(
    element(
        Bushing,
        "bushing",
        "a bushing: force and torque are matrices times the displacement of the second marker in axes of the first.",
        Where({"between": BETWEEN.replace(required=True)}, Entry.pair),
        check=_check_symmetry,
    )
)
