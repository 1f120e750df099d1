"""Force elements, gravity of a point mass on a body: Newton's law, and MacCullagh's for a body of some extent."""

from __future__ import annotations

from ...base.records import dataclass
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt
from ...expr.vectors import Mat3, Vec3
from ..dimensions import Dimension
from ..element_type import ElementType, Entry, table
from ..frames import Frame, Marker
from ..kinds import BodyName, Choice, MarkerReference, Scalar
from .force import Force, Load, MarkerLoad, View


@dataclass(frozen=True)
class PointGravity(Force):
    """Attraction of a body to a point at the marker ``center``, of gravitational parameter mu = G M (m^3/s^2).

    With r the distance from the centre to the centre of mass, along the unit vector u, m and I the body's mass and
    inertia about its centre of mass:

        V = -mu m / r,    F = -mu m / r^2 u

    and with ``inertia``, MacCullagh's formula, the next term of the expansion (Hughes (1986), Spacecraft Attitude
    Dynamics, section 8.1):

        V   -= mu / (2 r^3) [tr I - 3 u . I u]
        F   -= 3 mu / (2 r^4) [(tr I - 5 u . I u) u + 2 I u],   torque 3 mu / r^3 u x I u

    The opposite wrench acts on the body of the centre; two bodies attract each other if mu = G times the mass there.
    """

    sentence = r"A body is attracted by a point at the distance $r$, with the parameter $\mu$ (`mu`)."
    formula = r"V = -\mu \frac{m}{r}"
    center: Marker
    body: Marker  #: at the centre of mass, in the body's axes
    mu: Expr
    mass: Expr
    inertia: Mat3 | None = None

    def _reach(self, view: View) -> tuple[Vec3, Expr, Vec3]:
        d = vec.sub(view.position(self.body), view.position(self.center))
        r = sqrt(vec.dot(d, d))
        return d, r, (d[0] / r, d[1] / r, d[2] / r)

    def _second(self, view: View, u: Vec3) -> tuple[Vec3, Expr, Expr]:
        """I u in ground axes, u . I u, tr I."""
        assert self.inertia is not None
        axes = view.rotation(self.body)
        bent = vec.times(axes, vec.times(self.inertia, vec.transpose_times(axes, u)))
        return bent, vec.dot(u, bent), self.inertia[0][0] + self.inertia[1][1] + self.inertia[2][2]

    def loads(self, view: View) -> list[Load]:
        d, r, u = self._reach(view)
        force = vec.scale(-self.mu * self.mass / (r * r), u)
        torque = back = vec.zero(view.graph)
        if self.inertia is not None:
            bent, along, trace = self._second(view, u)
            extra = vec.add(vec.scale(trace - 5.0 * along, u), vec.scale(view.graph.lift(2.0), bent))
            force = vec.sub(force, vec.scale(1.5 * self.mu / r**4, extra))
            torque = vec.scale(3.0 * self.mu / r**3, vec.cross(u, bent))
            back = vec.neg(vec.add(torque, vec.cross(d, force)))  # the pair has no resultant moment
        return [MarkerLoad(self.body, force, torque), MarkerLoad(self.center, vec.neg(force), back)]

    def potential(self, view: View) -> Expr | None:
        _, r, u = self._reach(view)
        energy = -self.mu * self.mass / r
        if self.inertia is not None:
            _, along, trace = self._second(view, u)
            energy = energy - 0.5 * self.mu / r**3 * (trace - 3.0 * along)
        return energy


def _point_gravity(e: Entry) -> PointGravity | None:
    center = e["center"]
    mu, extent, found = e.positive("mu"), e["extent"], e["body"]
    if found is None:
        return None
    index, body = found
    if center is not None and center.body == index:
        e.fault("center", f"lies on {body.name!r} itself", "give a marker of ground or of another body", "EG-REFERENCE")
    marker = Marker(index, Frame(vec.identity(e.graph), body.com), f"{body.name} at its centre of mass")
    inertia = body.inertia if extent == "maccullagh" else None
    return None if center is None else PointGravity(e.name, center, marker, mu, body.mass, inertia)


TYPES = table(
    ElementType(
        "point_gravity",
        "the gravity that a point exerts on a body; the reaction acts at the point.",
        {
            "center": MarkerReference("marker at the attracting point", required=True),
            "body": BodyName("the body that is attracted at its centre of mass", required=True),
            "mu": Scalar(
                "gravitational parameter G M of the centre (m^3/s^2)", required=True, dimension=Dimension(3, 0, -2)
            ),
            "extent": Choice(
                "point takes the body as a point mass; maccullagh adds its inertia to second order: the "
                "gravity-gradient torque and its force",
                default="point",
                choices=("point", "maccullagh"),
            ),
        },
        _point_gravity,
    )
)
