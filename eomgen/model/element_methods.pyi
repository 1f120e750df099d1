# Written by python tools/stubs.py from the tables of types.

from collections.abc import Mapping, Sequence
from typing import Any

from ..elements.element_type import ElementType
from .handles import BodyHandle, ConstraintHandle, Described, ForceHandle, JointHandle

Value = Any  # a number, a text or a SymPy expression

def tables() -> dict[str, dict[str, ElementType]]: ...
def methods() -> dict[str, list[ElementType]]: ...

class ElementMethods(Described):
    def joint(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """Add a joint of any type."""
    def _method(self, name: str) -> Any: ...
    def parameter(self, name: str, value: Value = None, unit: str | None = None, doc: str | None = None,
        latex: str | None = None) -> Any:
        """Add a parameter: a constant that can change between runs."""
    def input(self, name: str, value: Value = 0.0, unit: str | None = None, doc: str | None = None,
        signal: Value = None, latex: str | None = None) -> Any:
        """Add an input, a quantity that is given over time."""
    def output(self, name: str, expression: Value, unit: str | None = None, doc: str | None = None,
        latex: str | None = None) -> None:
        """Add an output: a named result of the model."""
    def state(self, name: str, rate: Value = None, initial: Value = 0.0, unit: str | None = None,
        doc: str | None = None, latex: str | None = None) -> Any:
        """Add a first-order state s with s' = rate: an activation, a pressure, what a filter or controller holds."""
    def event(self, name: str, expression: Value, terminal: bool | int | None = None, direction: int = 0,
        reset: Mapping[Any, Value] | None = None, restitution: Value = None, doc: str | None = None,
        friction: Value = None, slip: Any = None) -> None:
        """Add an event: runs find the time where an expression becomes zero, and can stop or reset the state there."""
    def body(self, name: str, mass: Value = None, com: Sequence[Value] | None = None, inertia: Any = None,
        principal: Sequence[Value] | None = None, first_moment: Sequence[Value] | None = None, about: Any = None,
        axes: Sequence[Value] | None = None, solids: Sequence[Mapping[str, Any]] | None = None,
        points: Sequence[Mapping[str, Any]] | None = None, check_inertia: bool | str | None = None,
        markers: Mapping[str, Any] | None = None, display: Sequence[Mapping[str, Any]] | None = None) -> BodyHandle:
        """Add a rigid body."""
    def revolute(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: Value = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type revolute: S turns about the common z axis; the origins coincide."""
    def continuous(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: Value = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type continuous: A revolute joint without limits, as URDF calls it."""
    def prismatic(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinate: Any = None, coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        dry_friction: Value = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type prismatic: S slides along the common z axis without turning."""
    def screw(self, name: str, predecessor: Any, successor: Any, pitch: Value,
        axis: str | Sequence[float] | None = None, coordinate: Any = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, dry_friction: Value = None, armature: Value = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type screw: S turns about the common z axis and slides along it by ``pitch`` (m) per turn."""
    def cylindrical(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type cylindrical: S slides along the common z axis and turns about it."""
    def universal(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        axes: Sequence[Any] | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type universal: A cross turns about the axis {x} of P and the axis {y} of S, which stay
        perpendicular."""
    def constant_velocity(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type constant_velocity: The shaft bends in any direction, and S turns exactly as fast as P."""
    def spherical(self, name: str, predecessor: Any, successor: Any, sequence: str | None = None,
        coordinates: Sequence[Any] | None = None, rotation: str | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type spherical: S turns freely about the common origin."""
    def planar(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] | None = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type planar: S moves in the x-y plane of P and turns about z."""
    def translational(self, name: str, predecessor: Any, successor: Any, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type translational: S slides along x, y and z of P without turning."""
    def curve_slider(self, name: str, predecessor: Any, successor: Any, curve: Sequence[Value], coordinate: Any = None,
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None, dry_friction: Value = None,
        armature: Value = None, latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None,
        opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type curve_slider: The origin of S slides along a curve of P, without turning: a bead on a
        wire."""
    def surface_slider(self, name: str, predecessor: Any, successor: Any, surface: Sequence[Value],
        coordinates: Sequence[Any] | None = None, limits: Mapping[str, float] | None = None,
        latex: str | Sequence[str] | Mapping[str, str] | None = None, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type surface_slider: The origin of S slides on a surface of P, without turning: a particle in
        a bowl."""
    def point_on_curve(self, name: str, predecessor: Any, successor: Any, curve: Sequence[Value],
        sequence: str | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type point_on_curve: The origin of S slides along a curve of P; S turns freely, in Euler
        angles."""
    def point_on_surface(self, name: str, predecessor: Any, successor: Any, surface: Sequence[Value],
        sequence: str | None = None, coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type point_on_surface: The origin of S slides on a surface of P; S turns freely, in Euler
        angles."""
    def free(self, name: str, predecessor: Any, successor: Any, sequence: str | None = None,
        coordinates: Sequence[Any] | None = None, rotation: str | None = None,
        limits: Mapping[str, float] | None = None, latex: str | Sequence[str] | Mapping[str, str] | None = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type free: S moves freely: three coordinates of its position in P axes, then its rotation."""
    def weld(self, name: str, predecessor: Any, successor: Any, closes: Value = None, opens: Value = None,
        closed: bool | None = None, releases: Any = None, stabilisation: Value = 10) -> JointHandle:
        """Add a joint of type weld: S is fixed to P."""
    def distance(self, name: str, predecessor: Any, successor: Any, length: Value) -> JointHandle:
        """Add a joint of type distance: A massless rod with a ball joint at each end: the origins stay ``length``
        apart."""
    def revolute_spherical(self, name: str, predecessor: Any, successor: Any, length: Value,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type revolute_spherical: A massless rod of ``length`` turns about z of P, across it, with a
        ball joint at S."""
    def inline(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type inline: The origin of S stays on the axis {z} of P."""
    def inplane(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type inplane: The origin of S stays in the plane of P across the axis {z}."""
    def parallel(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type parallel: The z axes stay parallel."""
    def perpendicular(self, name: str, predecessor: Any, successor: Any,
        axis: str | Sequence[float] | None = None) -> JointHandle:
        """Add a joint of type perpendicular: The z axes stay perpendicular: turn one marker by ``rpy``, as ``axis``
        turns both."""
    def orientation(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Add a joint of type orientation: S does not turn against P: all axes stay parallel, and the origins move
        freely."""
    def force(self, name: str, marker: Any, value: Sequence[Value], axes: str | None = None) -> ForceHandle:
        """Add a force on a body, at the origin of a marker."""
    def torque(self, name: str, on: Any, value: Value | Sequence[Value], axes: str | None = None) -> ForceHandle:
        """Add a torque on a joint's coordinate (one value) or on a body (three values)."""
    def actuator(self, name: str, *between: Any, joint: Any = None, value: Value = None,
        via: Sequence[Any] | None = None) -> ForceHandle:
        """Add an actuator with a given force: on a joint's coordinate, or along the line or a path between two
        markers."""
    def spring(self, name: str, a: Any, b: Any, stiffness: Value, length: Value = 0,
        via: Sequence[Any] | None = None) -> ForceHandle:
        """Add a linear spring between two markers, or along a path over markers and cylinders."""
    def damper(self, name: str, a: Any, b: Any, damping: Value, via: Sequence[Any] | None = None) -> ForceHandle:
        """Add a viscous damper between two markers, or along a path over markers and cylinders."""
    def torsional_spring(self, name: str, *between: Any, joint: Any = None, stiffness: Value = None,
        angle: Value = 0) -> ForceHandle:
        """Add a linear torsional spring on an angle: of a joint, or of the second marker about the z axis of the
        first."""
    def torsional_damper(self, name: str, *between: Any, joint: Any = None, damping: Value = None) -> ForceHandle:
        """Add a viscous torsional damper on an angle: of a joint, or of the second marker about the z axis of the
        first."""
    def joint_spring(self, name: str, joint: Any, stiffness: Value, rest: Value = 0) -> ForceHandle:
        """Add a linear spring on one coordinate of a joint, an angle or a length."""
    def joint_damper(self, name: str, joint: Any, damping: Value) -> ForceHandle:
        """Add a viscous damper on one coordinate of a joint, an angle or a length."""
    def element(self, name: str, *between: Any, joint: Any = None, law: Value = None, potential: Value = None,
        via: Sequence[Any] | None = None) -> ForceHandle:
        """Add a force with a law of your own: along a joint's coordinate, the line between two markers, or a path."""
    def torsional_element(self, name: str, *between: Any, joint: Any = None, law: Value = None,
        potential: Value = None) -> ForceHandle:
        """Add a torque with a law of your own on an angle: of a joint, or of the second marker about z of the first."""
    def bushing(self, name: str, a: Any, b: Any, stiffness: Sequence[Any],
        damping: Sequence[Any] | None = None) -> ForceHandle:
        """Add a bushing: force and torque are matrices times the displacement of the second marker in axes of the
        first."""
    def point_gravity(self, name: str, center: Any, body: Any, mu: Value, extent: str | None = None) -> ForceHandle:
        """Add the gravity that a point exerts on a body; the reaction acts at the point."""
    def friction(self, name: str, joint: Any, viscous: Value = None, coulomb: Value = None, static: Value = None,
        coefficient: Value = None, static_coefficient: Value = None, radius: Value = None, thrust_radius: Value = None,
        stribeck: Value = None, smoothing: Value = None, friction_law: str | None = None, transition: Value = None,
        bristle_stiffness: Value = None, bristle_damping: Value = None) -> ForceHandle:
        """Add friction on a joint's coordinate: viscous, Coulomb (with the Stribeck effect if wanted), by the reaction
        that the joint carries, or several of them."""
    def stop(self, name: str, joint: Any, stiffness: Value, lower: Value = None, upper: Value = None,
        exponent: Value = 1.5, dissipation: Value = None, restitution: Value = None, velocity: Value = None,
        formula: str | None = None, normal_law: str | None = None, damping: Value = None) -> ForceHandle:
        """Add elastic stops of a joint's coordinate: below ``lower``, above ``upper`` or both."""
    def point_plane(self, name: str, a: Any, b: Any, stiffness: Value, exponent: Value = 1.5, dissipation: Value = None,
        restitution: Value = None, velocity: Value = None, formula: str | None = None, friction: Value = None,
        static_friction: Value = None, stribeck: Value = None, viscous_friction: Value = 0, smoothing: Value = None,
        normal_law: str | None = None, damping: Value = None, friction_law: str | None = None, transition: Value = None,
        bristle_stiffness: Value = None, bristle_damping: Value = None) -> ForceHandle:
        """Add contact of a point (the second marker) with a plane (x-y of the first marker, z out of the solid)."""
    def sphere_plane(self, name: str, a: Any, b: Any, radius: Value, stiffness: Value = None, exponent: Value = 1.5,
        dissipation: Value = None, restitution: Value = None, velocity: Value = None, formula: str | None = None,
        friction: Value = None, static_friction: Value = None, stribeck: Value = None, viscous_friction: Value = 0,
        smoothing: Value = None, normal_law: str | None = None, damping: Value = None, friction_law: str | None = None,
        transition: Value = None, bristle_stiffness: Value = None, bristle_damping: Value = None,
        moduli: Sequence[Value] | None = None, poisson: Sequence[Value] | None = None) -> ForceHandle:
        """Add contact of a sphere (about the second marker) with a plane (x-y of the first marker, z out of the
        solid)."""
    def sphere_sphere(self, name: str, a: Any, b: Any, radii: Sequence[Value], stiffness: Value = None,
        exponent: Value = 1.5, dissipation: Value = None, restitution: Value = None, velocity: Value = None,
        formula: str | None = None, friction: Value = None, static_friction: Value = None, stribeck: Value = None,
        viscous_friction: Value = 0, smoothing: Value = None, normal_law: str | None = None, damping: Value = None,
        friction_law: str | None = None, transition: Value = None, bristle_stiffness: Value = None,
        bristle_damping: Value = None, moduli: Sequence[Value] | None = None,
        poisson: Sequence[Value] | None = None) -> ForceHandle:
        """Add contact of two spheres, each centred at a marker."""
    def contacts(self, name: str, first: Sequence[Mapping[str, Any]] | Mapping[str, Any],
        second: Sequence[Mapping[str, Any]] | Mapping[str, Any] | None = None, law: Mapping[str, Any] | None = None,
        stiffness: Value = None, exponent: Value = 1.5, dissipation: Value = None, restitution: Value = None,
        velocity: Value = None, formula: str | None = None, friction: Value = None, static_friction: Value = None,
        stribeck: Value = None, viscous_friction: Value = 0, smoothing: Value = None, normal_law: str | None = None,
        damping: Value = None, friction_law: str | None = None, transition: Value = None,
        bristle_stiffness: Value = None, bristle_damping: Value = None, moduli: Sequence[Value] | None = None,
        poisson: Sequence[Value] | None = None, soil: str | None = None, cohesive_modulus: Value = None,
        frictional_modulus: Value = None, sinkage_exponent: Value = None, cohesion: Value = None,
        friction_angle: Value = None, shear_modulus: Value = None, contact_width: Value = None, rebound: Value = None,
        unloading_stiffness: Value = None, unloading_rise: Value = None, peak_angle: Sequence[Value] | None = None,
        reversal: Value = 0.01, settling: Value = 0.001, recovery: Value = None,
        lateral: bool | None = None) -> ForceHandle:
        """Add contact of every shape of a group with every shape of another, by one law."""
    def muscle(self, name: str, a: Any, b: Any, activation: Value = None, force_max: Value = None,
        fiber_length: Value = None, slack_length: Value = None, velocity_max: Value = None, pennation: Value = 0,
        damping: Value = 0.1, via: Sequence[Any] | None = None, excitation: Value = None,
        activation_time: Value = 0.015, deactivation_time: Value = 0.06) -> ForceHandle:
        """Add a Hill-type muscle with a rigid tendon (De Groote and others, 2016) from its origin to its insertion."""
    def creep(self, name: str, track: Any, wheel: Any, radius: Value, longitudinal: Value, lateral: Value,
        lateral_spin: Value = 0, spin: Value = 0, speed: Value = None, creep_law: str | None = None,
        normal: Value = None, friction: Value = None) -> ForceHandle:
        """Add creep forces of a rolling wheel on its track (Kalker; Vermeulen and Johnson; Polach)."""
    def tyre(self, name: str, road: Any, wheel: Any, radius: Value, stiffness: Value, relaxation: Sequence[Value],
        damping: Value = 0, settling: Value = 0, reversal: Value = 0.1, axis: str | Sequence[float] | None = None,
        rolling_radius: Value = None, law: str | None = None, slip_stiffness: Value = None, friction: Value = None,
        half_length: Value = None, shifts: bool | None = None) -> ForceHandle:
        """Add a tyre on a plane road: the first marker is the road (z out of it), the second the centre of the
        wheel."""
    def coupling(self, name: str, coordinates: Mapping[Any, Value] | None = None, offset: Value = 0,
        equation: Value = None, closes: Value = None, opens: Value = None, closed: bool | None = None,
        releases: Any = None, stabilisation: Value = 10) -> ConstraintHandle:
        """Add a relation between coordinates: a linear one, or any equation."""
    def gear(self, name: str, a: Any, b: Any, radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None, cones: Sequence[Value] | None = None, internal: bool | None = None,
        phase: Value = 0, closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add two gears that mesh: r_a a + r_b b = r_a phase, or r_a a - r_b b = r_a phase if one is internal."""
    def rack(self, name: str, pinion: Any, rack: Any, radius: Value, offset: Value = 0, closes: Value = None,
        opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a pinion that rolls on a rack: s = radius angle + offset (m)."""
    def belt(self, name: str, a: Any, b: Any, radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None, crossed: bool | None = None, phase: Value = 0, closes: Value = None,
        opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a belt without slip on two pulleys: r_a (a - phase) = r_b b, or -r_b b if the belt crosses."""
    def planetary(self, name: str, sun: Any = None, ring: Any = None, carrier: Any = None, planet: Any = None,
        radii: Mapping[str, Value] | None = None, teeth: Mapping[str, Value] | None = None, phase: Value = 0,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a planetary gear set: its meshing wheels follow Willis' equation."""
    def cam(self, name: str, cam: Any, follower: Any, lift: Value, phase: Value = 0,
        periodic: bool | None = None) -> ConstraintHandle:
        """Add a cam with a given lift: the follower's coordinate is a function of the cam's angle."""
    def cam_contact(self, name: str, cam: Any, follower: Any, shape: str, contour: Value = None, support: Value = None,
        radius: Value = None, coordinate: Any = None, latex: str | None = None,
        periodic: bool | None = None) -> ConstraintHandle:
        """Add a follower that stays in contact with the contour of a plane cam."""
    def rolling(self, name: str, wheel: Any, plane: Any = None, radius: Value = None, shape: str | None = None,
        tube: Value = 0, no_spin: bool | None = None, semi_axes: Sequence[Value] | None = None, support: Value = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a wheel, ball or smooth convex body that rolls on a plane without slip."""
    def knife_edge(self, name: str, marker: Any, axis: str | Sequence[float] | None = None, on: Any = None,
        closes: Value = None, opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a blade: a marker that cannot move sideways, along one of its own axes."""
    def driver(self, name: str, coordinate: Any = None, value: Value = None, between: Sequence[Any] | None = None,
        angle: Sequence[Any] | None = None, marker: Any = None, axis: str | Sequence[float] | None = None,
        on: Any = None) -> ConstraintHandle:
        """Add a motion prescribed over time: of a coordinate, a distance, an angle or the place of a marker."""
    def hold(self, name: str, a: Any, b: Any, axes: str | None = None, turning: str | None = None, closes: Value = None,
        opens: Value = None, closed: bool | None = None, releases: Any = None,
        stabilisation: Value = 10) -> ConstraintHandle:
        """Add a marker held where it is on another body while it is closed: a foot on the ground, a grasp, a clutch."""
    def lock(self, name: str, joint: Any, closes: Value = None, opens: Value = None, closed: bool | None = None,
        releases: Any = None, stabilisation: Value = 10) -> ConstraintHandle:
        """Add a joint whose coordinates stay where they are while it is closed: a clutch, a brake, the latch of a
        door."""
