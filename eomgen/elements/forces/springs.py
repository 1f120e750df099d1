"""Force elements: given forces and torques, springs, dampers, laws of the model's own, bushings, gravity of a point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from ...base.value_rules import POSITIVE, Allowed
from ...expr import vectors as vec
from ...expr.core import Expr, sqrt, substitute
from ...expr.differentiate import gradient
from ...expr.vectors import Mat3, Vec3
from ..dimensions import DAMPING, ENERGY, FORCE, LENGTH, NONE, PUSH, RATE, REACH, SPIN, STIFFNESS, TIME, Dimension
from ..element_type import ElementType, Entry, Where, element, key, keys_of, table
from ..frames import Frame, Marker
from ..glyphs import (
    COIL,
    CYLINDER,
    DASHPOT,
    LAW_BOX,
    LAW_RING,
    ROUND_ARROW,
    RUBBER,
    SPIRAL,
    TURNING_DASHPOT,
    Drawn,
    Glyph,
    Pull,
)
from ..kinds import LAW, BodyName, Choice, MarkerReference, Matrix6, Scalar, Value, Vector
from ..scalars import dot
from .force import Force, Load, MarkerLoad, View, with_reaction
from .paths import ANGLE, ANYWHERE, BETWEEN, COORDINATE, LINE, ON_JOINT, Line, PathForce, read_coordinate


class Actuator(PathForce):
    """A given generalized force along the path: positive pushes markers apart or drives the coordinate (N or N m)."""

    sentence = "A given force or torque $F$ (`value`) along its path of length or angle $s$."
    formula = r"\delta W = F \delta s"
    value: Expr = key(
        Scalar(
            "force (N or N m); a positive value increases the coordinate, or pushes the markers apart",
            required=True,
            level=LAW,
            dimension=PUSH,
        )
    )

    def along(self, value: Expr, rate: Expr) -> Expr:
        return self.value

    def glyphs(self) -> list[Glyph]:
        seen = self.path.glyphs(CYLINDER, ROUND_ARROW)
        return [seen._replace(along=()) if seen.coordinate else seen]  # a slide's own symbol says that it moves


_AXES = Choice("axes of the vector: ground, or the marker's own", default="ground", choices=("ground", "body"))


class PointForce(Force):
    """A force at a marker's origin, given in ground axes or in the marker's own (``axes="body"``) (N)."""

    sentence = r"A given force $\mathbf{F}$ at the origin of a marker."
    formula = r"\delta W = \mathbf{F}^T \delta \mathbf{r}"
    marker: Marker = key(MarkerReference("marker at whose origin the force acts", required=True))
    value: Vec3 = key(Vector("force (N)", required=True, level=LAW, dimension=FORCE))
    axes: str = key(_AXES)

    turns = False  #: whether the value is a torque

    def loads(self, view: View) -> list[Load]:
        vector = vec.times(view.rotation(self.marker), self.value) if self.axes == "body" else self.value
        none = vec.zero(view.graph)
        return [MarkerLoad(self.marker, *((none, vector) if self.turns else (vector, none)))]

    def glyphs(self) -> list[Glyph]:
        return [Pull(self.marker, self.value, self.axes == "body", self.turns)]


class BodyTorque(PointForce):
    """A torque on a body, given in ground axes or in the marker's own (``axes="body"``) (N m)."""

    sentence = r"A given torque $\mathbf{M}$ on a body."
    formula = r"\delta W = \mathbf{M}^T \delta \mathbf{\varphi}"
    turns = True


def _torque(e: Entry) -> Force | None:
    if "joint" in e.values:
        e.refuse("axes", "a torque on a joint's coordinate has no axes")
        path, value = read_coordinate(e), e.read("value", kind=Scalar)
        return None if path is None else Actuator(e.name, path, value)
    marker = e["body"]
    vector, axes = e.read("value", kind=Vector), e["axes"]
    return None if marker is None else BodyTorque(e.name, marker, vector, axes)


TYPES = table(
    element(
        PointForce,
        "force",
        "a force on a body, at the origin of a marker.",
        remedies={
            "marker": "for a force along a joint's coordinate use torque or actuator (N on a length, N m on an angle)"
        },
    ),
    ElementType(
        "torque",
        "a torque on a joint's coordinate (one value) or on a body (three values).",
        {
            "joint": ON_JOINT,
            "body": MarkerReference("a body"),
            "value": Value(
                "torque (N m): one value on a joint (a force in N if its coordinate is a length), three on a body",
                required=True,
                level=LAW,
                dimension=PUSH,
            ),
            "axes": _AXES,
        },
        _torque,
        one_of=("joint", "body"),
    ),
    element(
        Actuator,
        "actuator",
        "an actuator with a given force: on a joint's coordinate, or along the line or a path between two markers.",
        ANYWHERE,
    ),
)


# -- springs and dampers -----------------------------------------------------------------------------------------------


class Spring(PathForce):
    """Linear spring: generalized force -k (s - s0) along the path (k in N/m or N m/rad).

    The law is conservative while k and s0 depend on parameters only, which the description checks.
    """

    sentence = (
        "A linear spring: its force along its path of length or angle $s$ is proportional to the stretch "
        "from $s_0$ (`rest`), with the stiffness $k$."
    )
    formula = r"F = -k (s - s_0), \quad V = \frac{1}{2} k (s - s_0)^2"
    uses_value = True
    stiffness: Expr = key(Scalar("stiffness (N/m or N m/rad)", required=True, dimension=STIFFNESS))
    rest: Expr = key(Scalar("value of the coordinate (rad or m) at which the force is 0", default=0, dimension=REACH))

    def loads(self, view: View) -> list[Load]:
        if isinstance(self.path, Line) and self.rest.is_zero:
            # linear in the distance, so that the markers may meet
            return self.path.pair(view, vec.scale(-self.stiffness, self.path.reach(view)))
        return super().loads(view)

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.stiffness * (value - self.rest)

    def glyphs(self) -> list[Glyph]:
        return [self.path.glyphs(COIL, SPIRAL)]

    def potential(self, view: View) -> Expr | None:
        if not self.path.is_exact(view):
            return None  # the loads are the definition
        if isinstance(self.path, Line) and self.rest.is_zero:
            reach = self.path.reach(view)
            return 0.5 * self.stiffness * vec.dot(reach, reach)
        value, _ = self.path.measure(view)
        stretch = value - self.rest
        return 0.5 * self.stiffness * (stretch * stretch)


class Damper(PathForce):
    """Viscous damper: generalized force -c s' along the path (c in N s/m or N m s/rad)."""

    sentence = (
        "A viscous damper: its force along its path is proportional to the rate of the length or angle $s$, "
        "with the factor $c$ (`damping`)."
    )
    formula = r"F = -c \dot{s}"
    damping: Expr = key(Scalar("damping (N s/m or N m s/rad)", required=True, level=LAW, dimension=DAMPING))

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.damping * rate

    def glyphs(self) -> list[Glyph]:
        return [self.path.glyphs(DASHPOT, TURNING_DASHPOT)]


_TURNING_STIFFNESS = keys_of(Spring)["stiffness"].replace(dimension=ENERGY)
_TURNING_DAMPING = keys_of(Damper)["damping"].replace(dimension=ENERGY.times(TIME))
_LENGTH = Scalar("free length (m), at which the force is 0", default=0, dimension=LENGTH)
_ANGLE = Scalar("angle (rad) at which the torque is 0", default=0, dimension=NONE)

TYPES |= table(
    element(
        Spring,
        "spring",
        "a linear spring between two markers, or along a path over markers and cylinders.",
        LINE,
        {"stiffness": keys_of(Spring)["stiffness"], "length": _LENGTH},
    ),
    element(
        Damper, "damper", "a viscous damper between two markers, or along a path over markers and cylinders.", LINE
    ),
    element(
        Spring,
        "torsional_spring",
        "a linear torsional spring on an angle: of a joint, or of the second marker about the z axis of the first.",
        ANGLE,
        {"stiffness": _TURNING_STIFFNESS, "angle": _ANGLE},
    ),
    element(
        Damper,
        "torsional_damper",
        "a viscous torsional damper on an angle: of a joint, or of the second marker about the z axis of the first.",
        ANGLE,
        {"damping": _TURNING_DAMPING},
    ),
    element(Spring, "joint_spring", "a linear spring on one coordinate of a joint, an angle or a length.", COORDINATE),
    element(Damper, "joint_damper", "a viscous damper on one coordinate of a joint, an angle or a length.", COORDINATE),
)


# -- any law: an expression of a path's value and rate -----------------------------------------------------------------


class GeneralElement(PathForce):
    """A generalized force law(value, rate) - dV/dvalue along the path (N or N m).

    Positive pushes the ends apart or drives the coordinate.  ``value`` and ``rate`` are the symbols that stand in the
    law for the path's.  Only the potential V(value) counts as energy; the law is taken as it is, conservative or not.
    """

    sentence = "A law of the model gives the force along the path from its length or angle $s$ and the rate."
    formula = r"F = f(s,\dot{s})"
    uses_value = True
    value: Expr
    rate: Expr
    law: Expr
    energy: Expr

    def _at(self, value: Expr, rate: Expr, expression: Expr) -> Expr:
        return substitute([expression], {self.value: value, self.rate: rate})[0]

    def along(self, value: Expr, rate: Expr) -> Expr:
        return self._at(value, rate, self.law - gradient(self.energy, [self.value])[0])

    def glyphs(self) -> list[Glyph]:
        seen = self.path.glyphs(LAW_BOX, LAW_RING)
        return [seen._replace(along=()) if seen.coordinate else seen]  # a slide's own symbol says that it moves

    def potential(self, view: View) -> Expr | None:
        if self.energy.is_zero or not self.path.is_exact(view):
            return None
        return self._at(*self.path.measure(view), self.energy)

    def remainder(self, view: View) -> list[Load]:
        return [] if self.law.is_zero else self.path.loads(view, self._at(*self.path.measure(view), self.law))


def _element(name: str, doc: str, where: Where, of: str, unit: str, push: Dimension, rate: Dimension) -> ElementType:
    """A type whose law knows ``length`` or ``angle``, and ``rate``: of what, in what unit, and the dimensions."""

    def read(e: Entry) -> GeneralElement | None:
        path = where.read(e)
        if "law" not in e.values and "potential" not in e.values:
            e.fault("", "has no force law", "give law, potential or both", "EG-MISSING")
        on = e["joint"] if "joint" in e.values and path is not None else None
        word = "angle" if where is ANGLE or (on is not None and on.kind == "angle") else "length"
        s, s_dot = (e.graph.symbol(f"{one}[{e.name}]") for one in (word, "rate"))
        law = e.law("law", {word: s, "rate": s_dot}) if "law" in e.values else e.graph.zero
        energy = e.law("potential", {word: s}) if "potential" in e.values else e.graph.zero
        return None if path is None else GeneralElement(e.name, path, s, s_dot, law, energy)

    local = {"length": LENGTH, "angle": NONE, "rate": rate}
    names = {name: Scalar("", dimension=dimension) for name, dimension in local.items()}
    keys = {
        "law": Scalar(
            f"{unit}: a positive value increases the coordinate or pushes the markers apart; an expression of {of}, "
            "``rate``, t, parameters, inputs, coordinates, velocities, the motion of markers and outputs",
            level=LAW,
            dimension=push,
            local=names,
        ),
        "potential": Scalar(
            f"potential energy (J), an expression of {of} and parameters; the force is minus its derivative",
            dimension=ENERGY,
            local=names,
        ),
    }
    return ElementType(name, doc, {**where.keys, **keys, **where.behind}, read, one_of=where.one_of)


TYPES |= table(
    _element(
        "element",
        "a force with a law of your own: along a joint's coordinate, the line between two markers, or a path.",
        ANYWHERE,
        *("``length`` (``angle``, where the coordinate is one)", "force (N, or N m)", PUSH, RATE),
    ),
    _element(
        "torsional_element",
        "a torque with a law of your own on an angle: of a joint, or of the second marker about z of the first.",
        ANGLE,
        *("``angle``", "torque (N m)", ENERGY, SPIN),
    ),
)


# -- bushings: six relative displacements of two markers times full matrices of stiffness and damping ------------------


Row6 = tuple[Expr, Expr, Expr, Expr, Expr, Expr]
Mat6 = tuple[Row6, Row6, Row6, Row6, Row6, Row6]


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

    def glyphs(self) -> list[Glyph]:
        return [Drawn((self.first, self.second), along=RUBBER)]

    def loads(self, view: View) -> list[Load]:
        y, rate = self._displacements(view), self._rates(view)
        return self._pair(
            view, [-(a + b) for a, b in zip(_times(self.stiffness, y), _times(self.damping, rate), strict=True)]
        )

    def potential(self, view: View) -> Expr | None:
        y = self._displacements(view)
        return 0.5 * dot(y, _times(self.stiffness, y))  # type: ignore[no-any-return]

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
        return with_reaction(view, self.second, self.first, push, turn)


def _times(m: Mat6, y: Sequence[Expr]) -> list[Expr]:
    return [dot(row, y) for row in m]


def _check_symmetry(e: Entry, values: dict[str, Any]) -> None:
    stiffness: Mat6 | None = values["stiffness"]
    if stiffness is None:
        return
    for i, j in combinations(range(6), 2):
        difference, place = stiffness[j][i] - stiffness[i][j], f"stiffness[{j}][{i}]"
        if difference.value is None:
            rule = "this is its difference from [j][i]; both must be equal"
            e.require(place, difference, Allowed(0.0, 0.0), rule)
        elif not difference.is_zero:
            e.fault(place, "the matrix is not symmetric", "[i][j] and [j][i] must be equal", "EG-RANGE")


TYPES |= table(
    element(
        Bushing,
        "bushing",
        "a bushing: force and torque are matrices times the displacement of the second marker in axes of the first.",
        Where({"between": BETWEEN.replace(required=True)}, Entry.pair),
        check=_check_symmetry,
    )
)


# -- gravity of a point mass: Newton's law, and MacCullagh's for a body of some extent ---------------------------------


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

    def _second(self, view: View, u: Vec3) -> tuple[Vec3, Expr, Expr]:
        """I u in ground axes, u . I u, tr I."""
        assert self.inertia is not None
        axes = view.rotation(self.body)
        bent = vec.times(axes, vec.times(self.inertia, vec.transpose_times(axes, u)))
        return bent, vec.dot(u, bent), self.inertia[0][0] + self.inertia[1][1] + self.inertia[2][2]

    def loads(self, view: View) -> list[Load]:
        u, r = Line(self.center, self.body).geometry(view)
        force, o = vec.scale(-self.mu * self.mass / (r * r), u), vec.zero(view.graph)
        if self.inertia is None:
            return [MarkerLoad(self.body, force, o), MarkerLoad(self.center, vec.neg(force), o)]
        bent, along, trace = self._second(view, u)
        extra = vec.add(vec.scale(trace - 5.0 * along, u), vec.scale(view.graph.lift(2.0), bent))
        force = vec.sub(force, vec.scale(1.5 * self.mu / r**4, extra))
        torque = vec.scale(3.0 * self.mu / r**3, vec.cross(u, bent))
        return with_reaction(view, self.body, self.center, force, torque)

    def potential(self, view: View) -> Expr | None:
        u, r = Line(self.center, self.body).geometry(view)
        energy = -self.mu * self.mass / r
        if self.inertia is not None:
            _, along, trace = self._second(view, u)
            energy = energy - 0.5 * self.mu / r**3 * (trace - 3.0 * along)
        return energy


def _point_gravity(e: Entry) -> PointGravity | None:
    center = e["center"]
    mu, extent, result = e["mu"], e["extent"], e["body"]
    if result is None:
        return None
    index, body = result
    if center is not None and center.body == index:
        e.fault("center", f"lies on {body.name!r} itself", "give a marker of ground or of another body", "EG-REFERENCE")
    marker = Marker(index, Frame(vec.identity(e.graph), body.com), f"{body.name} at its centre of mass")
    inertia = body.inertia if extent == "maccullagh" else None
    return None if center is None else PointGravity(e.name, center, marker, mu, body.mass, inertia)


TYPES |= table(
    ElementType(
        "point_gravity",
        "the gravity that a point exerts on a body; the reaction acts at the point.",
        {
            "center": MarkerReference("marker at the attracting point", required=True),
            "body": BodyName("the body that is attracted at its centre of mass", required=True),
            "mu": Scalar(
                "gravitational parameter G M of the centre (m^3/s^2)",
                required=True,
                dimension=Dimension(3, 0, -2),
                allowed=POSITIVE,
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
