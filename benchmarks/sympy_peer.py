"""The same models in SymPy, as its users would write them: reference frames, points and KanesMethod."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sm
from sympy.physics import mechanics as me


@dataclass(frozen=True)
class Kane:
    """Kane's equations ``mass_matrix * u' = forcing`` with what they depend on."""

    q: list[Any]
    u: list[Any]
    parameters: list[Any]
    mass_matrix: Any
    forcing: Any

    @property
    def entries(self) -> list[Any]:
        """Lower triangle of the mass matrix, then the forcing: what has to be evaluated."""
        n = len(self.u)
        return [self.mass_matrix[i, j] for i in range(n) for j in range(i + 1)] + list(self.forcing)

    def operations(self) -> int:
        """Operations of mass matrix and forcing after common subexpressions are taken out."""
        named, entries = sm.cse(self.entries, symbols=sm.numbered_symbols("z_"))
        return int(sum(sm.count_ops(e) for _, e in named) + sum(sm.count_ops(e) for e in entries))


class _System:
    """Collects bodies that turn about joints, from the ground outwards."""

    def __init__(self, n: int) -> None:
        self.q, self.u = list(me.dynamicsymbols(f"q1:{n + 1}")), list(me.dynamicsymbols(f"u1:{n + 1}"))
        self.ground, self.origin = me.ReferenceFrame("ground"), me.Point("origin")
        self.origin.set_vel(self.ground, 0)
        self.bodies: list[Any] = []
        self.loads: list[Any] = []

    def add(self, body: Any, weight: Any) -> None:
        """Take a body with a force at its centre of mass."""
        self.bodies.append(body)
        self.loads.append((body.point if isinstance(body, me.Particle) else body.masscenter, weight))

    def derive(self, parameters: list[Any]) -> Kane:
        """Form Kane's equations, with u = q'."""
        rates = [u - q.diff(me.dynamicsymbols._t) for q, u in zip(self.q, self.u, strict=True)]
        method = me.KanesMethod(self.ground, self.q, self.u, kd_eqs=rates)
        method.kanes_equations(self.bodies, self.loads)
        return Kane(self.q, self.u, parameters, method.mass_matrix, method.forcing)


def chain(n: int, absolute: bool = True) -> Kane:
    """The planar chain; ``absolute`` measures every angle from the vertical, else from the link before."""
    s = _System(n)
    g = sm.Symbol("g")
    parameters = [g]
    before, pin = s.ground, s.origin
    for k, (q, u) in enumerate(zip(s.q, s.u, strict=True), start=1):
        mass, length, distance, inertia = sm.symbols(f"m{k} l{k} d{k} I{k}")
        parameters += [mass, length, distance, inertia]
        reference = s.ground if absolute else before
        frame = reference.orientnew(f"frame{k}", "Axis", (q, s.ground.z))
        frame.set_ang_vel(reference, u * s.ground.z)
        center, end = pin.locatenew(f"center{k}", -distance * frame.y), pin.locatenew(f"end{k}", -length * frame.y)
        for point in (center, end):
            point.v2pt_theory(pin, s.ground, frame)
        body = me.RigidBody(f"link{k}", center, frame, mass, (me.inertia(frame, 0, 0, inertia), center))
        s.add(body, -mass * g * s.ground.y)
        before, pin = frame, end
    return s.derive(parameters)


def panda() -> Kane:
    """The Panda arm, all parameters numbers."""
    from .models import arm_joints

    joints = arm_joints("panda")
    s = _System(len(joints))
    frames, pins = [s.ground], [s.origin]
    for k, joint in enumerate(joints):
        before, pin = frames[joint["parent"] + 1], pins[joint["parent"] + 1]
        placed, frame = me.ReferenceFrame(f"placed{k}"), me.ReferenceFrame(f"frame{k}")
        placed.orient_explicit(before, sm.Matrix(joint["rotation"]).applyfunc(sm.nsimplify))
        frame.orient_axis(placed, s.q[k], placed.z)
        frame.set_ang_vel(before, s.u[k] * placed.z)
        hinge = pin.locatenew(f"hinge{k}", _along(before, joint["position"]))
        hinge.v2pt_theory(pin, s.ground, before)
        center = hinge.locatenew(f"center{k}", _along(frame, joint["com"]))
        center.v2pt_theory(hinge, s.ground, frame)
        (xx, xy, zx), (_, yy, yz), (_, _, zz) = joint["inertia_com"]
        inertia = me.inertia(frame, xx, yy, zz, xy, yz, zx)
        body = me.RigidBody(f"body{k}", center, frame, joint["mass"], (inertia, center))
        s.add(body, -joint["mass"] * 9.81 * s.ground.z)
        frames.append(frame)
        pins.append(hinge)
    return s.derive([])


def _along(frame: Any, components: list[float]) -> Any:
    return sum((c * axis for c, axis in zip(components, (frame.x, frame.y, frame.z), strict=True)), me.Vector(0))


def double_pendulum() -> Kane:
    """``examples/double_pendulum.yaml``: two point masses, the second angle measured from the first rod."""
    s = _System(2)
    m1, m2, l1, l2, g = parameters = list(sm.symbols("m1 m2 l1 l2 g"))
    before, pin = s.ground, s.origin
    for k, (mass, length) in enumerate(((m1, l1), (m2, l2))):
        frame = me.ReferenceFrame(f"rod{k}")
        frame.orient_axis(before, s.q[k], s.ground.z)
        frame.set_ang_vel(before, s.u[k] * s.ground.z)
        bob = pin.locatenew(f"bob{k}", -length * frame.y)
        bob.v2pt_theory(pin, s.ground, frame)
        s.add(me.Particle(f"mass{k}", bob, mass), -mass * g * s.ground.y)
        before, pin = frame, bob
    return s.derive(parameters)


def pendulum_rhs(values: dict[str, float]) -> Callable[[float, Any], list[float]]:
    """x' of the double pendulum as lambdify makes it at its fastest: solved symbolically, cse, plain ``math``."""
    kane = double_pendulum()
    a = kane.mass_matrix.LUsolve(kane.forcing)
    fixed = {p: values[p.name] for p in kane.parameters}
    flat = [sm.Symbol(str(x.func)) for x in (*kane.q, *kane.u)]
    named = dict(zip((*kane.q, *kane.u), flat, strict=True))
    right = [*flat[2:], *(entry.xreplace(named).xreplace(fixed) for entry in a)]
    function = sm.lambdify(flat, right, modules="math", cse=True)
    return lambda t, x: function(*x)
