"""Force elements, unilateral contact of two bodies: where surfaces meet, a normal law and friction."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from ..base.value_rules import NOT_NEGATIVE, POSITIVE
from ..elements.dimensions import LENGTH
from ..elements.element_type import ElementType, Entry, table
from ..elements.forces.force import Force, Load, MarkerLoad, Measured, View
from ..elements.forces.friction import FRICTION, UNIT, DryFriction, LuGre, Slip, has_bristles
from ..elements.forces.normal_laws import (
    CURVED_LAWS,
    NORMAL,
    HertzBodies,
    NormalLaw,
    PartlyDamped,
    UpToDepth,
    normal_key,
)
from ..elements.frames import Marker, velocity_at
from ..elements.glyphs import PLANE, Drawn, Glyph, Wheel
from ..elements.kinds import Fields, Pair, Radii, Scalar
from ..expr import vectors as vec
from ..expr.core import Expr, sqrt
from ..expr.vectors import Vec3

#: Normal (ground axes, from the first body to the second), penetration (m), arms of the contact point from the markers.
Touch = tuple[Vec3, Expr, Vec3, Vec3]


class Contact(Force):
    """Contact at one point: a force along the normal and friction against the sliding velocity.

    The force on the second body is F_n n - F_n f(v_t), with the law of friction f of the velocity v_t of the second
    body relative to the first, across n, at the contact point, the middle of the overlap; its opposite acts on the
    first body at the same point.
    """

    sentence = (
        "Contact at one point: a force along the normal from the penetration $d$ and its rate, and friction "
        "against the sliding."
    )
    acts_along = True
    first: Marker
    second: Marker
    normal_law: NormalLaw
    friction: DryFriction | None

    @property
    def laws(self) -> tuple[Any, ...]:
        return (self.normal_law,) if self.friction is None else (self.normal_law, self.friction)

    @abstractmethod
    def touch(self, view: View) -> Touch:
        """Where the surfaces meet."""

    def nearness(self, view: View) -> tuple[Vec3, Expr]:
        """The normal and the penetration from which it is told when surfaces that are apart can meet."""
        normal, depth, _, _ = self.touch(view)
        return normal, depth

    def share(self, view: View) -> Expr | None:
        """The part of the law that counts here, of a surface made of pieces; None means all."""
        return None

    def grip(self, view: View) -> Expr | None:
        """The part of damping and friction that counts here; None means all."""
        return None

    def deepest(self, view: View) -> Expr | None:
        """The penetration up to which the nearest place is unique, where a law ends; None where it goes on."""
        return None

    def law_here(self, view: View) -> NormalLaw:
        """The law of the normal force as it acts here."""
        grip, most = self.grip(view), self.deepest(view)
        law = self.normal_law if most is None else UpToDepth(self.normal_law, most)
        return law if grip is None else PartlyDamped(law, grip)

    def couple(self, view: View) -> Vec3 | None:
        """A couple on the second body that the energy has beside the force; its opposite acts on the first."""
        return None

    def aside(self, view: View) -> Vec3 | None:
        """A force on the second body that the energy has beside that along the normal; its opposite on the first."""
        return None

    def _shared(self, view: View, x: Expr) -> Expr:
        share = self.share(view)
        return x if share is None else share * x

    def loads(self, view: View) -> list[Load]:
        normal, depth, arms, sliding, rate = self._motion(view)
        push = self.law_here(view).force(depth, rate)
        drag = self._drag(view, self._slip(view, normal, depth, sliding, push))
        force, more = vec.add(vec.scale(self._shared(view, push), normal), drag), self.aside(view)
        return self._pair(arms, force if more is None else vec.add(force, more), self.couple(view))

    def potential(self, view: View) -> Expr | None:
        return self._shared(view, self.law_here(view).energy(self.touch(view)[1]))

    def remainder(self, view: View) -> list[Load]:
        normal, depth, arms, sliding, rate = self._motion(view)
        law = self.law_here(view)
        push = law.force(depth, rate)
        lost = self._shared(view, push) - self._shared(view, law.elastic(depth))
        drag = self._drag(view, self._slip(view, normal, depth, sliding, push))
        return self._pair(arms, vec.add(vec.scale(lost, normal), drag))

    def state_rates(self, view: View) -> tuple[Expr, ...]:
        normal, depth, _, sliding, rate = self._motion(view)
        of_normal, sums = self.normal_law.rates(depth, rate), self.sums_of_rates(view)
        if isinstance(self.friction, LuGre) and sums is not None:
            return (*self.friction.rates_of(sums), *of_normal)
        if self.friction is None:
            return of_normal
        push = self.law_here(view).force(depth, rate)
        return (*self.friction.rates_in_plane(self._slip(view, normal, depth, sliding, push)), *of_normal)

    def sums_of_rates(self, view: View) -> tuple[Expr, ...] | None:
        """What this place adds to sums from which the rates of its states follow; None of laws whose rates add up."""
        if not isinstance(self.friction, LuGre):
            return None
        normal, depth, _, sliding, rate = self._motion(view)
        slip = self._slip(view, normal, depth, sliding, self.law_here(view).force(depth, rate))
        return tuple(self._shared(view, x) for x in self.friction.sums(slip))

    def rates_apart(self) -> tuple[Expr, ...]:
        """Rates of its states where the surfaces are apart; those of friction come first."""
        friction = () if self.friction is None else self.friction.rates_apart()
        return (*friction, *self.normal_law.rates_apart())

    def measured(self, view: View) -> Measured:
        _, depth, _, _, rate = self._motion(view)
        return Measured(depth, rate, self._shared(view, self.law_here(view).force(depth, rate)))

    def _motion(self, view: View) -> tuple[Vec3, Expr, tuple[Vec3, Vec3], Vec3, Expr]:
        """Normal, penetration, arms, sliding velocity and the rate of penetration."""
        normal, depth, first, second = self.touch(view)
        v1, v2 = velocity_at(view, self.first, first), velocity_at(view, self.second, second)
        relative = vec.sub(v2, v1)
        parting = vec.dot(normal, relative)
        return normal, depth, (first, second), vec.sub(relative, vec.scale(parting, normal)), -parting

    def _slip(self, view: View, normal: Vec3, depth: Expr, sliding: Vec3, push: Expr) -> Slip:
        grip = self.grip(view)
        if grip is not None:  # that part of the whole law
            push = push - (1.0 - grip) * self.normal_law.elastic(depth)
        return Slip(sliding, normal, depth, push, view.rotation(self.first))

    def _drag(self, view: View, slip: Slip) -> Vec3:
        if self.friction is None:
            return vec.zero(slip.push.graph)
        x, y, z = (self._shared(view, part) for part in self.friction.drag(slip.push, slip))
        return x, y, z

    def _pair(self, arms: tuple[Vec3, Vec3], force: Vec3, couple: Vec3 | None = None) -> list[Load]:
        """The force on the second body at the contact point and a couple, their opposites on the first."""
        on_second, on_first = vec.cross(arms[1], force), vec.cross(force, arms[0])
        if couple is not None:
            on_second, on_first = vec.add(on_second, couple), vec.sub(on_first, couple)
        return [MarkerLoad(self.second, force, on_second), MarkerLoad(self.first, vec.neg(force), on_first)]


class SpherePlane(Contact):
    """A sphere about the second marker on the plane through the first, whose z axis points out of the solid.

    A radius of 0 makes it a point.
    """

    radius: Expr

    def glyphs(self) -> list[Glyph]:
        ground: list[Glyph] = [Drawn((self.first,), about=PLANE)]
        return ground if self.radius.is_zero else [*ground, Wheel(self.second, self.radius)]

    def touch(self, view: View) -> Touch:
        normal = vec.transpose(view.rotation(self.first))[2]
        reach = vec.sub(view.position(self.second), view.position(self.first))
        depth = self.radius - vec.dot(normal, reach)
        second = vec.scale(0.5 * depth - self.radius, normal)
        return normal, depth, vec.add(reach, second), second


class SphereSphere(Contact):
    """Two spheres about the markers; undefined where their centres coincide."""

    radii: tuple[Expr, Expr]

    def glyphs(self) -> list[Glyph]:
        return [Wheel(self.first, self.radii[0]), Wheel(self.second, self.radii[1])]

    def touch(self, view: View) -> Touch:
        reach = vec.sub(view.position(self.second), view.position(self.first))
        distance = sqrt(vec.dot(reach, reach))
        normal: Vec3 = (reach[0] / distance, reach[1] / distance, reach[2] / distance)
        depth = self.radii[0] + self.radii[1] - distance
        first = vec.scale(self.radii[0] - 0.5 * depth, normal)
        second = vec.scale(0.5 * depth - self.radii[1], normal)
        return normal, depth, first, second


def joint_radius(first: Expr, second: Expr) -> Expr:
    """R of 1 / R = 1 / R1 + 1 / R2."""
    return first * second / (first + second)


def _on_plane(e: Entry) -> SpherePlane | None:
    pair, law, friction = e.pair(), e["law"], e["friction"]
    radius = e["radius"] if "radius" in e.fields else e.graph.zero
    if pair is None or law is None:
        return None
    return SpherePlane(e.name, *pair, law.at(lambda: radius), friction, radius)


def _two_spheres(e: Entry) -> SphereSphere | None:
    pair, law, friction, radii = e.pair(), e["law"], e["friction"], e["radii"]
    if pair is None or radii is None or law is None:
        return None
    for k, radius in enumerate(radii):
        e.require(f"radii[{k}]", radius, NOT_NEGATIVE, "a radius is 0 or greater")
        if isinstance(law, HertzBodies):
            e.require(f"radii[{k}]", radius, POSITIVE, "the law of Hertz from moduli needs both radii")
    return SphereSphere(e.name, *pair, law.at(lambda: joint_radius(*radii)), friction, (radii[0], radii[1]))


_ENDS = "the plane (z points out of the solid) and the {0}"
_ROUND: Fields = {"law": normal_key(CURVED_LAWS), "friction": FRICTION}


def _states(axes: str) -> Callable[[Mapping[str, Any]], dict[str, str]]:
    """States of bristles along axes of the first marker."""
    return lambda values: {f"bristle_{x}": UNIT for x in axes} if has_bristles(values) else {}


TYPES = table(
    ElementType(
        "point_plane",
        "contact of a point (the second marker) with a plane (x-y of the first marker, z out of the solid).",
        {"between": Pair(_ENDS.format("point"), required=True), "law": NORMAL, "friction": FRICTION},
        _on_plane,
        states=_states("xy"),
    ),
    ElementType(
        "sphere_plane",
        "contact of a sphere (about the second marker) with a plane (x-y of the first marker, z out of the solid).",
        {
            "between": Pair(_ENDS.format("sphere's centre"), required=True),
            "radius": Scalar("radius of the sphere (m)", required=True, dimension=LENGTH, allowed=POSITIVE),
            **_ROUND,
        },
        _on_plane,
        states=_states("xy"),
    ),
    ElementType(
        "sphere_sphere",
        "contact of two spheres, each centred at a marker.",
        {
            "between": Pair("the centres", required=True),
            "radii": Radii("radii of the spheres (m)", required=True, dimension=LENGTH),
            **_ROUND,
        },
        _two_spheres,
        states=_states("xyz"),
    ),
)
