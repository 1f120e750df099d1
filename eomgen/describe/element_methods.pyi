# Written by python -m eomgen.describe.stubs from the tables of types.

from collections.abc import Mapping, Sequence
from typing import Any

from ..elements.element_type import ElementType
from .described import Described
from .handles import JointHandle

Value = Any  # a number, a text or a SymPy expression

def tables() -> dict[str, dict[str, ElementType]]: ...

class ElementMethods(Described):
    def joint(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """Add a joint of any type."""
    def _method(self, name: str) -> Any: ...
    def revolute(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type revolute: turns about the common z axis; the origins coincide."""
    def continuous(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type continuous: a revolute joint without limits, as URDF calls it."""
    def prismatic(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type prismatic: slides along the common z axis without turning."""
    def screw(self, name: str, predecessor: Any, successor: Any, pitch: Value,
        axis: str | Sequence[float] | None = None, coordinate: Any = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, dry_friction: float | None = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type screw: turns about the common z axis and slides along it by ``pitch`` (m) a turn."""
    def cylindrical(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type cylindrical: slides along and turns about the common z axis."""
    def universal(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        axes: Sequence[Any] | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type universal: a cross that turns about x of P and y of S, which stay perpendicular."""
    def constant_velocity(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type constant_velocity: bends about any axis across the shaft and passes its turning on
        evenly."""
    def spherical(self, name: str, predecessor: Any, successor: Any, sequence: str | None = None,
        coordinates: Sequence[Any] | None = None, rotation: str | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type spherical: turns about a point."""
    def planar(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type planar: moves in the x-y plane of P and turns about z."""
    def translational(self, name: str, predecessor: Any, successor: Any, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type translational: slides along x, y and z of P without turning."""
    def curve_slider(self, name: str, predecessor: Any, successor: Any, curve: Sequence[Value], coordinate: Any = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type curve_slider: the origin of S slides along a curve of P, without turning: a bead on a
        wire."""
    def surface_slider(self, name: str, predecessor: Any, successor: Any, surface: Sequence[Value],
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type surface_slider: the origin of S slides on a surface of P, without turning: a particle in
        a bowl."""
    def point_on_curve(self, name: str, predecessor: Any, successor: Any, curve: Sequence[Value],
        sequence: str | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type point_on_curve: the origin of S slides along a curve of P; S turns freely, in Euler
        angles."""
    def point_on_surface(self, name: str, predecessor: Any, successor: Any, surface: Sequence[Value],
        sequence: str | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type point_on_surface: the origin of S slides on a surface of P; S turns freely, in Euler
        angles."""
    def free(self, name: str, predecessor: Any, successor: Any, sequence: str | None = None,
        coordinates: Sequence[Any] | None = None, rotation: str | None = None,
        limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None) -> JointHandle:
        """Add a joint of type free: six degrees of freedom: position of S in P axes, then its rotation. Removes
        none."""
    def weld(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Add a joint of type weld: no motion."""
    def distance(self, name: str, predecessor: Any, successor: Any, length: Value) -> JointHandle:
        """Add a joint of type distance: a massless rod with a ball at each end: the origins stay ``length`` apart."""
    def revolute_spherical(self, name: str, predecessor: Any, successor: Any, length: Value,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type revolute_spherical: a massless rod that turns about z of P, with a ball at S: across z,
        ``length`` long."""
    def inline(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type inline: the origin of S stays on the z axis of P."""
    def inplane(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type inplane: the origin of S stays in the x-y plane of P."""
    def parallel(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type parallel: the z axes stay parallel."""
    def perpendicular(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type perpendicular: the z axes stay perpendicular: turn one marker by ``rpy``, as ``axis``
        turns both."""
    def orientation(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Add a joint of type orientation: all axes stay parallel, the origins are free: S does not turn against P."""
    def force(self, name: str, marker: Any, value: Sequence[Value], axes: str | None = None) -> None:
        """Add a force at a marker's origin."""
    def torque(self, name: str, on: Any, value: Value | Sequence[Value], axes: str | None = None) -> None:
        """Add a torque on a joint's coordinate (one value) or on a body (three values)."""
    def actuator(self, name: str, *between: Any, joint: Any = None, value: Value = None,
        via: Sequence[Any] | None = None) -> None:
        """Add a given force: on a joint's coordinate, or along the line or a path between two markers."""
    def spring(self, name: str, a: Any, b: Any, stiffness: Value, length: Value = 0,
        via: Sequence[Any] | None = None) -> None:
        """Add a linear spring between two markers, or along a path over markers and cylinders."""
    def damper(self, name: str, a: Any, b: Any, damping: Value, via: Sequence[Any] | None = None) -> None:
        """Add a viscous damper between two markers, or along a path over markers and cylinders."""
    def torsional_spring(self, name: str, *between: Any, joint: Any = None, stiffness: Value = None,
        angle: Value = 0) -> None:
        """Add a linear spring on an angle: of a joint, or of the second marker about the z axis of the first."""
    def torsional_damper(self, name: str, *between: Any, joint: Any = None, damping: Value = None) -> None:
        """Add a viscous damper on an angle: of a joint, or of the second marker about the z axis of the first."""
    def joint_spring(self, name: str, joint: Any, stiffness: Value, rest: Value = 0) -> None:
        """Add a linear spring on any coordinate of a joint, an angle or a length."""
    def joint_damper(self, name: str, joint: Any, damping: Value) -> None:
        """Add a viscous damper on any coordinate of a joint, an angle or a length."""
    def element(self, name: str, *between: Any, joint: Any = None, law: Value = None, potential: Value = None,
        via: Sequence[Any] | None = None) -> None:
        """Add a force of any law along a joint's coordinate, the line between two markers, or a path."""
    def torsional_element(self, name: str, *between: Any, joint: Any = None, law: Value = None,
        potential: Value = None) -> None:
        """Add a torque of any law on an angle: of a joint, or of the second marker about the z axis of the first."""
    def bushing(self, name: str, a: Any, b: Any, stiffness: Sequence[Any],
        damping: Sequence[Any] | None = None) -> None:
        """Add a bushing: displacements of the second marker from the first, in its axes, times full matrices."""
    def point_gravity(self, name: str, center: Any, body: Any, mu: Value, extent: str | None = None) -> None:
        """Add the gravity of a point on a body, whose reaction acts at the point."""
    def friction(self, name: str, joint: Any, viscous: Value = None, coulomb: Value = None, static: Value = None,
        stribeck: Value = None, smoothing: Value = None) -> None:
        """Add friction of a joint's coordinate: viscous, Coulomb's with Stribeck's effect, or both."""
    def stop(self, name: str, joint: Any, stiffness: Value, lower: Value = None, upper: Value = None,
        exponent: Value = 1.5, dissipation: Value = None, restitution: Value = None, velocity: Value = None,
        formula: str | None = None) -> None:
        """Add stops of a joint's coordinate: below ``lower``, above ``upper`` or both."""
    def point_plane(self, name: str, a: Any, b: Any, stiffness: Value, exponent: Value = 1.5, dissipation: Value = None,
        restitution: Value = None, velocity: Value = None, formula: str | None = None, friction: Value = None,
        static_friction: Value = None, stribeck: Value = None, viscous_friction: Value = 0,
        smoothing: Value = None) -> None:
        """Add contact of a point, the second marker, with the plane of the first, z pointing out of the solid."""
    def sphere_plane(self, name: str, a: Any, b: Any, radius: Value, stiffness: Value, exponent: Value = 1.5,
        dissipation: Value = None, restitution: Value = None, velocity: Value = None, formula: str | None = None,
        friction: Value = None, static_friction: Value = None, stribeck: Value = None, viscous_friction: Value = 0,
        smoothing: Value = None) -> None:
        """Add contact of a sphere about the second marker with the plane of the first, z pointing out of the solid."""
    def sphere_sphere(self, name: str, a: Any, b: Any, radii: Sequence[Value], stiffness: Value, exponent: Value = 1.5,
        dissipation: Value = None, restitution: Value = None, velocity: Value = None, formula: str | None = None,
        friction: Value = None, static_friction: Value = None, stribeck: Value = None, viscous_friction: Value = 0,
        smoothing: Value = None) -> None:
        """Add contact of two spheres about two markers."""
    def muscle(self, name: str, a: Any, b: Any, activation: Value, force_max: Value, fiber_length: Value,
        slack_length: Value, velocity_max: Value = None, pennation: Value = 0, damping: Value = 0.1,
        via: Sequence[Any] | None = None) -> None:
        """Add a Hill-type muscle with a rigid tendon (De Groote and others, 2016) from its origin to its insertion."""
    def coupling(self, name: str, coordinates: Mapping[Any, Value] | None = None, offset: Value = 0,
        equation: Value = None) -> None:
        """Add a relation between coordinates: a linear one, or any equation."""
    def gear(self, name: str, a: Any, b: Any, radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None, cones: Sequence[Value] | None = None, internal: bool | None = None,
        phase: Value = 0) -> None:
        """Add two gears that mesh: r_a a + r_b b = r_a phase, with a minus where one is internal."""
    def rack(self, name: str, pinion: Any, rack: Any, radius: Value, offset: Value = 0) -> None:
        """Add a pinion that rolls on a rack: s = radius angle + offset (m)."""
    def belt(self, name: str, a: Any, b: Any, radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None, crossed: bool | None = None, phase: Value = 0) -> None:
        """Add a belt without slip on two pulleys: r_a a = r_b b, with a minus where it crosses."""
    def planetary(self, name: str, sun: Any = None, ring: Any = None, carrier: Any = None, planet: Any = None,
        radii: Mapping[str, Value] | None = None, teeth: Mapping[str, Value] | None = None, phase: Value = 0) -> None:
        """Add the meshing wheels of a planetary set (Willis)."""
    def cam(self, name: str, cam: Any, follower: Any, lift: Value, phase: Value = 0,
        periodic: bool | None = None) -> None:
        """Add a follower that moves by a law: its coordinate is the lift."""
    def cam_contact(self, name: str, cam: Any, follower: Any, shape: str, contour: Value = None, support: Value = None,
        radius: Value = None, coordinate: Any = None, periodic: bool | None = None) -> None:
        """Add a follower that stays in contact with the contour of a plane cam."""
    def rolling(self, name: str, wheel: Any, plane: Any = None, radius: Value = None, shape: str | None = None,
        tube: Value = 0, no_spin: bool | None = None) -> None:
        """Add a wheel or ball that rolls on a plane without slip."""
    def knife_edge(self, name: str, marker: Any, axis: str | Sequence[float] | None = None, on: Any = None) -> None:
        """Add a blade: a marker that does not move along an axis of its own."""
    def driver(self, name: str, coordinate: Any = None, value: Value = None, between: Sequence[Any] | None = None,
        angle: Sequence[Any] | None = None, marker: Any = None, axis: str | Sequence[float] | None = None,
        on: Any = None) -> None:
        """Add a motion prescribed over time: of a coordinate, a distance, an angle or the place of a marker."""
