"""Force elements, a rigid wheel on soil: sinkage and slip -> pressure and shear along its arc, by Gauss's rule."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..elements.forces.force import Load, MarkerLoad, View, beyond_zero, where
from ..elements.frames import velocity_at
from ..expr import vectors as vec
from ..expr.core import Expr, cos, sin, sqrt
from ..expr.vectors import Vec3
from .limits import FOREMOST, SHORT_WAY
from .point import Contact, Touch
from .soil_laws import SoilPressure, SoilShear

NODES = 8  #: of Gauss's rule on each of the two parts of the arc


class _Rolling(NamedTuple):
    """A wheel on the ground: directions, the way from the ground's marker to its centre, sinkage, velocities."""

    normal: Vec3
    along: Vec3
    reach: Vec3
    depth: Expr
    rate: Expr
    forward: Expr
    sideways: Expr  #: of the lowest point
    rim: Expr  #: spin times radius, positive where it rolls along


class _Node(NamedTuple):
    """A point of the arc: angle from the lowest point, part of the arc (rad), pressure; ahead of that point or not."""

    angle: Expr
    part: Expr
    pressure: Expr
    ahead: bool


class SoilWheel(Contact):
    """A rigid wheel in soil, rolling steadily: pressure and shear on the arc of its rim that is in the ground.

    At the angle a from the lowest point, of a wheel of radius R and width b with the sinkage d = R (1 - cos a1),

        p = k z^n, z = R (cos a - cos a1)                                    ahead (Bekker)
        p = p(d) - k_u (d - z), not below 0                                  behind (unloading of Wong)
        tau = (c + p tan phi) (1 - exp(-j / K))                              (Janosi and Hanamoto)
        j = R [(a1 - a) - (V / (R Omega)) (sin a1 - sin a)]                  (Wong and Reece)

    after Wong, Theory of Ground Vehicles (4th edition, 2008), sections 2.4 and 2.5.  With ``peak`` c1, c2 the pressure
    is greatest at a_m = min(c1 + c2 |i|, 0.9) a1 and falls to 0 at the lowest point, where it is that of the angle
    a1 - (a1 - a_m) a / a_m (Wong and Reece, J. Terramechanics 4 (1967), 81-98).  tanh(V / reversal) tells which side is
    ahead, and j is that of the spin sqrt(Omega^2 + (reversal / R)^2): a wheel at rest has no shear.

    A wheel that sinks at the rate d' slides by -d' (cos a - cos a1) / Omega more.  Where shear would put more power
    into the motion than the compaction of the soil takes, V times the horizontal part of the pressure, as in bounces
    that are faster than the rolling, all shear is reduced to that power.
    """

    flat: Contact
    radius: Expr
    width: Expr
    lateral: Vec3

    def touch(self, view: View) -> Touch:
        return self.flat.touch(view)

    def share(self, view: View) -> Expr | None:
        return self.flat.share(view)

    def loads(self, view: View) -> list[Load]:
        motion = self._rolling(view)
        normal, along, sideways = motion.normal, motion.along, self.lateral
        inside = view.graph.apply("lt", 0.0, motion.depth)
        pressed, sheared = self._sums(motion._replace(depth=where(inside, motion.depth, self.radius)))
        part = self._passive(view, motion, pressed, sheared)
        sums = [x + part * y for x, y in zip((*pressed, *(view.graph.zero,) * 4), sheared, strict=True)]
        scale, most = self._shared(view, self.width * self.radius), self.flat.deepest(view)
        if most is not None:
            scale = where(view.graph.apply("lt", most, motion.depth), sqrt(most - motion.depth), scale)
        force_along, force_up, lateral_force, torque, tilt, yaw = (where(inside, scale * x, 0.0) for x in sums)
        force = vec.add(vec.add(vec.scale(force_along, along), vec.scale(force_up, normal)),
                        vec.scale(lateral_force, sideways))  # fmt: skip
        arms = vec.add(vec.scale(tilt, along), vec.scale(yaw, normal))
        moment = vec.scale(self.radius, vec.sub(vec.scale(torque, sideways), arms))
        back = vec.neg(vec.add(moment, vec.cross(motion.reach, force)))
        return [MarkerLoad(self.second, force, moment), MarkerLoad(self.first, vec.neg(force), back)]

    def remainder(self, view: View) -> list[Load]:
        return self.loads(view)

    def _rolling(self, view: View) -> _Rolling:
        normal, depth, first, second = self.touch(view)
        along = vec.cross(normal, self.lateral)
        reach = vec.sub(first, second)
        velocity = vec.sub(view.velocity(self.second), velocity_at(view, self.first, reach))
        spin = vec.sub(view.angular_velocity(self.second), view.angular_velocity(self.first))
        return _Rolling(
            *(normal, along, reach, depth, -vec.dot(normal, velocity), vec.dot(along, velocity)),
            vec.dot(self.lateral, velocity) - self.radius * vec.dot(along, spin),
            -self.radius * vec.dot(self.lateral, spin),
        )

    def _passive(self, view: View, motion: _Rolling, pressed: list[Expr], sheared: list[Expr]) -> Expr:
        """The part of the shear that takes no more work from the ground than the compaction of the soil puts in."""
        graph, side = view.graph, self.lateral
        spin = vec.sub(view.angular_velocity(self.second), view.angular_velocity(self.first))
        sideways = motion.sideways + self.radius * vec.dot(motion.along, spin)  # of the centre
        turns = (vec.dot(side, spin), -vec.dot(motion.along, spin), -vec.dot(motion.normal, spin))
        speeds = (motion.forward, -motion.rate, sideways, *(self.radius * one for one in turns))
        gain = graph.zero
        for force, speed in zip(sheared, speeds, strict=True):
            gain = gain + force * speed
        lost = graph.apply("max", 0.0, -pressed[0] * motion.forward)
        over = graph.apply("lt", lost, gain)
        return where(over, lost / where(over, gain, 1.0), 1.0)

    def _sums(self, motion: _Rolling) -> tuple[list[Expr], list[Expr]]:
        """Of all nodes, by width and radius: of pressure the forces along and up; of shear those along, up and across.

        Moments of shear by the radius about the lateral axis, and against the axes along and up, follow.
        """
        graph, shear, law = motion.depth.graph, self.friction, self.normal_law
        assert isinstance(shear, SoilShear)
        assert isinstance(law, SoilPressure)
        way = graph.apply("tanh", motion.forward / law.reversal)
        slow = law.reversal / self.radius
        spin = sqrt(motion.rim * motion.rim / (self.radius * self.radius) + slow * slow)
        entry = _angle(motion.depth, self.radius)
        gain = graph.apply("max", 0.0, 1.0 + law.dissipation * motion.rate)
        pressed, result = [graph.zero] * 2, [graph.zero] * 6
        for node in self._nodes(law, motion, entry):
            c, s = cos(node.angle), sin(node.angle)
            angle, sine = (node.angle, s) if node.ahead else (-node.angle, -s)
            passed = entry - angle
            sunk = way * motion.rate * (c - cos(entry))
            slid = (motion.forward * (sin(entry) - sine) - sunk - motion.rim * passed) / spin
            aside = motion.sideways * passed / spin
            pressure = gain * node.pressure
            loaded = graph.apply("lt", 0.0, pressure)
            strength = where(loaded, shear.cohesion + pressure * shear.slope, 0.0)
            drag = -node.part * strength * _built_up(slid * slid + aside * aside, shear.modulus)
            push, front = node.part * pressure, way * sine
            pressed = [pressed[0] - front * push, pressed[1] + c * push]
            added = (
                c * drag * slid,
                front * drag * slid,
                drag * aside,
                drag * slid,
                c * drag * aside,
                front * drag * aside,
            )
            result = [x + y for x, y in zip(result, added, strict=True)]
        return pressed, result

    def _nodes(self, law: SoilPressure, motion: _Rolling, entry: Expr) -> list[_Node]:
        """Points of the arc; where pressure begins as a power of the depth they lie at squares of Gauss's."""
        depth, radius = motion.depth, self.radius
        stiffness, top = law.modulus_of(self.width), law.greatest(depth, self.width)

        def bekker(angle: Expr) -> Expr:
            z = 2.0 * radius * sin(0.5 * (entry + angle)) * sin(0.5 * (entry - angle))
            return stiffness * (z + depth.graph.apply("max", 0.0, depth - radius)) ** law.exponent

        if law.peak is not None:
            place = law.peak[0] + law.peak[1] * _slip(motion, law.reversal)
            most = depth.graph.apply("min", FOREMOST, place) * entry
            rest, result = entry - most, list[_Node]()
            for u, weight in _gauss():
                seen = bekker(entry - rest * u * u)
                result.append(_Node(entry - rest * u * u, 2.0 * u * weight * rest, seen, True))
                result.append(_Node(most * u * u, 2.0 * u * weight * most, seen, True))
            return result
        slope = law.unloading_slope(depth, top)
        left = _angle(depth.graph.apply("min", depth, top / slope), radius)
        result = []
        for u, weight in _gauss():
            ahead, behind = entry * (1.0 - u * u), left * u
            result.append(_Node(ahead, 2.0 * u * weight * entry, bekker(ahead), True))
            half = sin(0.5 * behind)
            rest = depth.graph.apply("max", 0.0, top - slope * (2.0 * radius * half * half))
            result.append(_Node(behind, weight * left, rest, False))
        return result


def _gauss() -> list[tuple[float, float]]:
    """Points and weights between 0 and 1."""
    points, weights = np.polynomial.legendre.leggauss(NODES)
    return [(0.5 + 0.5 * float(x), 0.5 * float(w)) for x, w in zip(points, weights, strict=True)]


def _angle(depth: Expr, radius: Expr) -> Expr:
    """The angle at which a rim comes to a depth below which its lowest point is; at most a right one."""
    half = depth.graph.apply("min", 0.5, depth / (2.0 * radius))
    return 2.0 * depth.graph.apply("asin", sqrt(half))


def _slip(motion: _Rolling, reversal: Expr) -> Expr:
    """|R Omega - V| by the greater of both, from 0 to 1."""
    graph, rim, forward = reversal.graph, motion.rim, motion.forward
    greater = graph.apply("max", rim * rim, forward * forward)
    apart = graph.apply("abs", rim - forward) / sqrt(greater + reversal * reversal)
    return graph.apply("min", 1.0, apart)


def _built_up(square: Expr, modulus: Expr) -> Expr:
    """(1 - exp(-j / K)) / j of the square of a displacement j, which is 1 / K - j / (2 K^2) + ... where it is short."""
    x = beyond_zero(square / (modulus * modulus), sqrt)
    short = square.graph.apply("lt", x, SHORT_WAY)
    far = where(short, 1.0, x)
    series = 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0)))
    return where(short, series, (1.0 - square.graph.apply("exp", -far)) / far) / modulus
