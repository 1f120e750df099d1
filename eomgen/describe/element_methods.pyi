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
        """Add a joint of any type.

        Parameters
        ----------
        type : str
            A type of joint, e.g. ``"revolute"``.
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers.
        **keys
            Whatever the method of the type takes.

        Returns
        -------
        JointHandle
        """

    def _method(self, name: str) -> Any: ...
    def revolute(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinate: Any = None,
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None,
        armature: Value = None,
    ) -> JointHandle:
        """Add a joint of type revolute.

        Turns about the common z axis; the origins coincide. Allows 1, removes 5.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinate : str, symbol or handle, optional
            Name of the coordinate (the joint's name unless given).
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        dry_friction : float, optional
            Coulomb friction (N m or N); data only.
        armature : scalar, optional
            Inertia of the drive as the coordinate feels it (kg m^2 or kg).
        """
    def continuous(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinate: Any = None,
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None,
        armature: Value = None,
    ) -> JointHandle:
        """Add a joint of type continuous.

        A revolute joint without limits, as URDF calls it. Allows 1, removes 5.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinate : str, symbol or handle, optional
            Name of the coordinate (the joint's name unless given).
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        dry_friction : float, optional
            Coulomb friction (N m or N); data only.
        armature : scalar, optional
            Inertia of the drive as the coordinate feels it (kg m^2 or kg).
        """
    def prismatic(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinate: Any = None,
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None,
        armature: Value = None,
    ) -> JointHandle:
        """Add a joint of type prismatic.

        Slides along the common z axis without turning. Allows 1, removes 5.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinate : str, symbol or handle, optional
            Name of the coordinate (the joint's name unless given).
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        dry_friction : float, optional
            Coulomb friction (N m or N); data only.
        armature : scalar, optional
            Inertia of the drive as the coordinate feels it (kg m^2 or kg).
        """
    def screw(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        pitch: Value,
        axis: str | Sequence[float] = 'z',
        coordinate: Any = None,
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None,
        armature: Value = None,
    ) -> JointHandle:
        """Add a joint of type screw.

        Turns about the common z axis and slides along it by ``pitch`` (m) a turn. Allows 1, removes 5.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        pitch : scalar
            Advance in one turn (m), negative for a left-handed thread.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinate : str, symbol or handle, optional
            Name of the coordinate (the joint's name unless given).
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        dry_friction : float, optional
            Coulomb friction (N m or N); data only.
        armature : scalar, optional
            Inertia of the drive as the coordinate feels it (kg m^2 or kg).
        """
    def cylindrical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type cylindrical.

        Slides along and turns about the common z axis. Allows 2, removes 4.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def universal(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type universal.

        A cross that turns about x of P and y of S, which stay perpendicular. Allows 2, removes 4.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def constant_velocity(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type constant_velocity.

        Bends about any axis across the shaft and passes its turning on evenly. Allows 2, removes 4.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def spherical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str = 'xyz',
        rotation: str = 'euler_angles',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type spherical.

        Turns about a point. Allows 3, removes 3.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        sequence : {"xyx", "xyz", "xzx", "xzy", "yxy", "yxz", "yzx", "yzy", "zxy", "zxz", "zyx", "zyz"}, optional
            Axes of the intrinsic Euler angles.
        rotation : {"euler_angles", "euler_parameters"}, optional
            How a rotation is described: three Euler angles, or four Euler parameters, which are never singular.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def planar(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type planar.

        Moves in the x-y plane of P and turns about z. Allows 3, removes 3.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def curve_slider(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        curve: Sequence[Value],
        coordinate: Any = None,
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
        dry_friction: float | None = None,
        armature: Value = None,
    ) -> JointHandle:
        """Add a joint of type curve_slider.

        The origin of S slides along a curve of P, without turning: a bead on a wire. Allows 1, removes 5.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        curve : sequence of three
            Point of the curve in the predecessor's axes (m), by the joint's s.
        coordinate : str, symbol or handle, optional
            Name of the coordinate (the joint's name unless given).
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        dry_friction : float, optional
            Coulomb friction (N m or N); data only.
        armature : scalar, optional
            Inertia of the drive as the coordinate feels it (kg m^2 or kg).
        """
    def surface_slider(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        surface: Sequence[Value],
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type surface_slider.

        The origin of S slides on a surface of P, without turning: a particle in a bowl. Allows 2, removes 4.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        surface : sequence of three
            Point of the surface in the predecessor's axes (m), by the joint's u, v.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def point_on_curve(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        curve: Sequence[Value],
        sequence: str = 'xyz',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type point_on_curve.

        The origin of S slides along a curve of P; S turns freely, in Euler angles. Allows 4, removes 2.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        curve : sequence of three
            Point of the curve in the predecessor's axes (m), by the joint's s.
        sequence : {"xyx", "xyz", "xzx", "xzy", "yxy", "yxz", "yzx", "yzy", "zxy", "zxz", "zyx", "zyz"}, optional
            Axes of the intrinsic Euler angles.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def point_on_surface(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        surface: Sequence[Value],
        sequence: str = 'xyz',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type point_on_surface.

        The origin of S slides on a surface of P; S turns freely, in Euler angles. Allows 5, removes 1.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        surface : sequence of three
            Point of the surface in the predecessor's axes (m), by the joint's u, v.
        sequence : {"xyx", "xyz", "xzx", "xzy", "yxy", "yxz", "yzx", "yzy", "zxy", "zxz", "zyx", "zyz"}, optional
            Axes of the intrinsic Euler angles.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def free(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str = 'xyz',
        rotation: str = 'euler_angles',
        coordinates: Sequence[Any] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> JointHandle:
        """Add a joint of type free.

        Six degrees of freedom: position of S in P axes, then its rotation. Removes none.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        sequence : {"xyx", "xyz", "xzx", "xzy", "yxy", "yxz", "yzx", "yzy", "zxy", "zxz", "zyx", "zyz"}, optional
            Axes of the intrinsic Euler angles.
        rotation : {"euler_angles", "euler_parameters"}, optional
            How a rotation is described: three Euler angles, or four Euler parameters, which are never singular.
        coordinates : sequence of str, optional
            Names of the coordinates, in order.
        limits : mapping, optional
            Limits of the coordinate; data only.
        """
    def weld(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Add a joint of type weld.

        No motion. Allows 0, removes 6.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        """
    def distance(self, name: str, predecessor: Any, successor: Any, length: Value) -> JointHandle:
        """Add a joint of type distance.

        A massless rod with a ball at each end: the origins stay ``length`` apart. Allows 5, removes 1.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        length : scalar
            Length of the rod (m).
        """
    def revolute_spherical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        length: Value,
        axis: str | Sequence[float] = 'z',
    ) -> JointHandle:
        """Add a joint of type revolute_spherical.

        A massless rod that turns about z of P, with a ball at S: across z, ``length`` long. Allows 4, removes 2.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        length : scalar
            Length of the rod (m).
        axis : str or three floats, optional
            Axis of the joint in the markers.
        """
    def inline(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] = 'z') -> JointHandle:
        """Add a joint of type inline.

        The origin of S stays on the z axis of P. Allows 4, removes 2.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        """
    def inplane(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] = 'z') -> JointHandle:
        """Add a joint of type inplane.

        The origin of S stays in the x-y plane of P. Allows 5, removes 1.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        """
    def parallel(self, name: str, predecessor: Any, successor: Any, axis: str | Sequence[float] = 'z') -> JointHandle:
        """Add a joint of type parallel.

        The z axes stay parallel. Allows 4, removes 2.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        """
    def perpendicular(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: str | Sequence[float] = 'z',
    ) -> JointHandle:
        """Add a joint of type perpendicular.

        The z axes stay perpendicular: turn one marker by ``rpy``, as ``axis`` turns both. Allows 5, removes 1.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        axis : str or three floats, optional
            Axis of the joint in the markers.
        """
    def orientation(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Add a joint of type orientation.

        All axes stay parallel, the origins are free: S does not turn against P. Allows 3, removes 3.

        Parameters
        ----------
        name : str
            Identifier.
        predecessor, successor : handle or str
            Bodies or markers; coordinates are the motion of the second relative to the first.
        """
    def force(self, name: str, marker: Any, value: Sequence[Value], axes: str = 'ground') -> None:
        """Add a force at a marker's origin.

        Parameters
        ----------
        name : str
            Identifier.
        marker : handle or str
            Where it acts.
        value : sequence of three
            Force (N).
        axes : {"ground", "body"}, optional
            Axes of the vector: ground, or the marker's own.
        """
    def torque(self, name: str, on: Any, value: Value | Sequence[Value], axes: str = 'ground') -> None:
        """Add a torque on a joint's coordinate (one value) or on a body (three values).

        Parameters
        ----------
        name : str
            Identifier.
        on : handle or str
            A joint or coordinate for one value, a body or marker for three.
        value : scalar or sequence of three
            Torque (N m): one on a joint (N where its coordinate is a length), three on a body.
        axes : {"ground", "body"}, optional
            Axes of the vector: ground, or the marker's own.
        """
    def actuator(
        self,
        name: str,
        *between: Any,
        joint: Any = None,
        value: Value = None,
        via: Sequence[Any] | None = None,
    ) -> None:
        """Add a given force: on a joint's coordinate, or along the line or a path between two markers.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handles or str
            One joint or coordinate, or two markers.
        joint : handle or str
            The joint, instead of ``between``.
        value : scalar
            Positive drives the coordinate up, or pushes the markers apart (N or N m).
        via : sequence, optional
            Markers that the path slides through and cylinders that it runs over, in order.
        """
    def spring(
        self,
        name: str,
        a: Any,
        b: Any,
        stiffness: Value,
        length: Value = 0,
        via: Sequence[Any] | None = None,
    ) -> None:
        """Add a linear spring between two markers, or along a path over markers and cylinders.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two markers.
        stiffness : scalar
            Stiffness (N/m or N m/rad).
        length : scalar, optional
            Length without force (m).
        via : sequence, optional
            Markers that the path slides through and cylinders that it runs over, in order.
        """
    def damper(self, name: str, a: Any, b: Any, damping: Value, via: Sequence[Any] | None = None) -> None:
        """Add a viscous damper between two markers, or along a path over markers and cylinders.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two markers.
        damping : scalar
            Damping (N s/m or N m s/rad).
        via : sequence, optional
            Markers that the path slides through and cylinders that it runs over, in order.
        """
    def torsional_spring(
        self,
        name: str,
        *between: Any,
        joint: Any = None,
        stiffness: Value = None,
        angle: Value = 0,
    ) -> None:
        """Add a linear spring on an angle: of a joint, or of the second marker about the z axis of the first.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handles or str
            One joint or coordinate, or two markers.
        joint : handle or str
            The joint, instead of ``between``.
        stiffness : scalar
            Stiffness (N/m or N m/rad).
        angle : scalar, optional
            Angle without torque (rad).
        """
    def torsional_damper(self, name: str, *between: Any, joint: Any = None, damping: Value = None) -> None:
        """Add a viscous damper on an angle: of a joint, or of the second marker about the z axis of the first.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handles or str
            One joint or coordinate, or two markers.
        joint : handle or str
            The joint, instead of ``between``.
        damping : scalar
            Damping (N s/m or N m s/rad).
        """
    def element(
        self,
        name: str,
        *between: Any,
        joint: Any = None,
        law: Value = 0,
        potential: Value = 0,
        via: Sequence[Any] | None = None,
    ) -> None:
        """Add a force of any law along a joint's coordinate, the line between two markers, or a path.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handles or str
            One joint or coordinate, or two markers.
        joint : handle or str
            The joint, instead of ``between``.
        law : scalar, optional
            Force (N; of angle, N m, where the coordinate is one) that drives the coordinate up or pushes the
            markers apart, of length, rate and all that forces know.
        potential : scalar, optional
            Potential energy V of length (J); the force -dV/dlength comes with it.
        via : sequence, optional
            Markers that the path slides through and cylinders that it runs over, in order.
        """
    def torsional_element(
        self,
        name: str,
        *between: Any,
        joint: Any = None,
        law: Value = 0,
        potential: Value = 0,
    ) -> None:
        """Add a torque of any law on an angle: of a joint, or of the second marker about the z axis of the first.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handles or str
            One joint or coordinate, or two markers.
        joint : handle or str
            The joint, instead of ``between``.
        law : scalar, optional
            Torque (N m) that drives the coordinate up or pushes the markers apart, of angle, rate and all that
            forces know.
        potential : scalar, optional
            Potential energy V of angle (J); the force -dV/dangle comes with it.
        """
    def bushing(
        self,
        name: str,
        a: Any,
        b: Any,
        stiffness: Sequence[Any],
        damping: Sequence[Any] | None = None,
    ) -> None:
        """Add a bushing: displacements of the second marker from the first, in its axes, times full matrices.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two markers.
        stiffness : sequence
            Six values for the diagonal, three of forces and three of torques, or a symmetric 6 x 6 matrix (N/m, N,
            N m/rad).
        damping : sequence, optional
            The same per velocity.
        """
    def point_gravity(self, name: str, center: Any, body: Any, mu: Value, extent: str = 'point') -> None:
        """Add the gravity of a point on a body, whose reaction acts at the point.

        Parameters
        ----------
        name : str
            Identifier.
        center : handle or str
            What attracts.
        body : str, symbol or handle
            The body that is attracted, at its centre of mass.
        mu : scalar
            Gravitational parameter G M of the centre (m^3/s^2).
        extent : {"point", "maccullagh"}, optional
            The body as a point, or with its inertia to second order: gravity-gradient torque and its force.
        """
    def friction(
        self,
        name: str,
        joint: Any,
        viscous: Value = 0,
        coulomb: Value = None,
        static: Value = None,
        stribeck: Value = None,
        smoothing: Value = None,
    ) -> None:
        """Add friction of a joint's coordinate: viscous, Coulomb's with Stribeck's effect, or both.

        Parameters
        ----------
        name : str
            Identifier.
        joint : handle or str
            A joint of one degree, or a coordinate.
        viscous : scalar, optional
            Viscous coefficient (N m s/rad or N s/m).
        coulomb : scalar, optional
            Coulomb friction (N m or N).
        static : scalar, optional
            Friction at the onset of sliding; needs stribeck.
        stribeck : scalar, optional
            Velocity over which static friction falls to Coulomb's (rad/s or m/s).
        smoothing : scalar, optional
            Velocity below which Coulomb friction is smoothed (rad/s or m/s).
        """
    def stop(
        self,
        name: str,
        joint: Any,
        stiffness: Value,
        lower: Value = None,
        upper: Value = None,
        exponent: Value = 1.5,
        dissipation: Value = None,
        restitution: Value = None,
        velocity: Value = None,
        formula: str = 'hunt_crossley',
    ) -> None:
        """Add stops of a joint's coordinate: below ``lower``, above ``upper`` or both.

        Parameters
        ----------
        name : str
            Identifier.
        joint : handle or str
            A joint of one degree, or a coordinate.
        stiffness : scalar
            Stiffness k in the force k d**n max(0, 1 + dissipation d_dot) of the penetration d (N/m**n).
        lower : scalar, optional
            Lower limit (rad or m).
        upper : scalar, optional
            Upper limit (rad or m).
        exponent : scalar, optional
            Exponent n.
        dissipation : scalar, optional
            Dissipation (s/m); or give restitution and velocity.
        restitution : scalar, optional
            Coefficient of restitution, from which the dissipation follows.
        velocity : scalar, optional
            Velocity of impact (m/s) to which the restitution belongs.
        formula : {"hunt_crossley", "lankarani", "flores"}, optional
            How it follows.
        """
    def point_plane(
        self,
        name: str,
        a: Any,
        b: Any,
        stiffness: Value,
        exponent: Value = 1.5,
        dissipation: Value = None,
        restitution: Value = None,
        velocity: Value = None,
        formula: str = 'hunt_crossley',
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of a point, the second marker, with the plane of the first, z pointing out of the solid.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            The plane (z points out of the solid) and the point.
        stiffness : scalar
            Stiffness k in the force k d**n max(0, 1 + dissipation d_dot) of the penetration d (N/m**n).
        exponent : scalar, optional
            Exponent n.
        dissipation : scalar, optional
            Dissipation (s/m); or give restitution and velocity.
        restitution : scalar, optional
            Coefficient of restitution, from which the dissipation follows.
        velocity : scalar, optional
            Velocity of impact (m/s) to which the restitution belongs.
        formula : {"hunt_crossley", "lankarani", "flores"}, optional
            How it follows.
        friction : scalar, optional
            Coefficient of sliding friction.
        static_friction : scalar, optional
            Coefficient at the onset of sliding; needs stribeck.
        stribeck : scalar, optional
            Sliding velocity (m/s) over which static friction falls to sliding friction.
        viscous_friction : scalar, optional
            Friction per normal force and velocity (s/m).
        smoothing : scalar, optional
            Sliding velocity (m/s) below which friction is smoothed.
        """
    def sphere_plane(
        self,
        name: str,
        a: Any,
        b: Any,
        radius: Value,
        stiffness: Value,
        exponent: Value = 1.5,
        dissipation: Value = None,
        restitution: Value = None,
        velocity: Value = None,
        formula: str = 'hunt_crossley',
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of a sphere about the second marker with the plane of the first, z pointing out of the solid.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            The plane (z points out of the solid) and the sphere's centre.
        radius : scalar
            Radius of the sphere (m).
        stiffness : scalar
            Stiffness k in the force k d**n max(0, 1 + dissipation d_dot) of the penetration d (N/m**n).
        exponent : scalar, optional
            Exponent n.
        dissipation : scalar, optional
            Dissipation (s/m); or give restitution and velocity.
        restitution : scalar, optional
            Coefficient of restitution, from which the dissipation follows.
        velocity : scalar, optional
            Velocity of impact (m/s) to which the restitution belongs.
        formula : {"hunt_crossley", "lankarani", "flores"}, optional
            How it follows.
        friction : scalar, optional
            Coefficient of sliding friction.
        static_friction : scalar, optional
            Coefficient at the onset of sliding; needs stribeck.
        stribeck : scalar, optional
            Sliding velocity (m/s) over which static friction falls to sliding friction.
        viscous_friction : scalar, optional
            Friction per normal force and velocity (s/m).
        smoothing : scalar, optional
            Sliding velocity (m/s) below which friction is smoothed.
        """
    def sphere_sphere(
        self,
        name: str,
        a: Any,
        b: Any,
        radii: Sequence[Value],
        stiffness: Value,
        exponent: Value = 1.5,
        dissipation: Value = None,
        restitution: Value = None,
        velocity: Value = None,
        formula: str = 'hunt_crossley',
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of two spheres about two markers.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            The centres.
        radii : sequence of two
            Radii of the spheres (m).
        stiffness : scalar
            Stiffness k in the force k d**n max(0, 1 + dissipation d_dot) of the penetration d (N/m**n).
        exponent : scalar, optional
            Exponent n.
        dissipation : scalar, optional
            Dissipation (s/m); or give restitution and velocity.
        restitution : scalar, optional
            Coefficient of restitution, from which the dissipation follows.
        velocity : scalar, optional
            Velocity of impact (m/s) to which the restitution belongs.
        formula : {"hunt_crossley", "lankarani", "flores"}, optional
            How it follows.
        friction : scalar, optional
            Coefficient of sliding friction.
        static_friction : scalar, optional
            Coefficient at the onset of sliding; needs stribeck.
        stribeck : scalar, optional
            Sliding velocity (m/s) over which static friction falls to sliding friction.
        viscous_friction : scalar, optional
            Friction per normal force and velocity (s/m).
        smoothing : scalar, optional
            Sliding velocity (m/s) below which friction is smoothed.
        """
    def muscle(
        self,
        name: str,
        a: Any,
        b: Any,
        activation: Value,
        force_max: Value,
        fiber_length: Value,
        slack_length: Value,
        velocity_max: Value = None,
        pennation: Value = 0,
        damping: Value = 0.1,
        via: Sequence[Any] | None = None,
    ) -> None:
        """Add a Hill-type muscle with a rigid tendon (De Groote and others, 2016) from its origin to its insertion.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two markers.
        activation : scalar
            Activation, 0 to 1.
        force_max : scalar
            Largest active force (N).
        fiber_length : scalar
            Optimal length of the fibres (m).
        slack_length : scalar
            Length of the tendon (m).
        velocity_max : scalar, optional
            Fastest shortening of fibres (m/s), 10 lengths a second by default.
        pennation : scalar, optional
            Angle of the fibres to the tendon at their optimal length (rad).
        damping : scalar, optional
            Force at velocity_max over force_max.
        via : sequence, optional
            Markers that the path slides through and cylinders that it runs over, in order.
        """
    def coupling(
        self,
        name: str,
        coordinates: Mapping[Any, Value] | None = None,
        offset: Value = 0,
        equation: Value = None,
    ) -> None:
        """Add a relation between coordinates: a linear one, or any equation.

        Parameters
        ----------
        name : str
            Identifier.
        coordinates : mapping
            Coordinate -> factor: the sum of factor times coordinate is the offset.
        offset : scalar, optional
            Offset of the sum, an expression of parameters.
        equation : scalar
            Instead, what is held at 0: of t, parameters, coordinates, places of markers; with velocities, in which
            it must be linear, the constraint is nonholonomic.
        """
    def gear(
        self,
        name: str,
        a: Any,
        b: Any,
        radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None,
        cones: Sequence[Value] | None = None,
        internal: bool = False,
        phase: Value = 0,
    ) -> None:
        """Add two gears that mesh: r_a a + r_b b = r_a phase, with a minus where one is internal.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two joints of one degree, or coordinates, whose axes one part carries.
        radii : sequence of two
            Base or pitch circle radii (m), in the order of the joints.
        teeth : sequence of two
            Numbers of teeth.
        cones : sequence of two
            Pitch cone angles of a bevel pair (rad), both z axes pointing away from where they meet, or to it.
        internal : bool, optional
            Whether both turn the same way.
        phase : scalar, optional
            First angle where the second is 0 (rad).
        """
    def rack(self, name: str, pinion: Any, rack: Any, radius: Value, offset: Value = 0) -> None:
        """Add a pinion that rolls on a rack: s = radius angle + offset (m).

        Parameters
        ----------
        name : str
            Identifier.
        pinion : handle or str
            Joint of the pinion.
        rack : handle or str
            Joint of the rack.
        radius : scalar
            Radius (m); negative if the rack moves the other way.
        offset : scalar, optional
            Travel where the pinion's angle is 0 (m).
        """
    def belt(
        self,
        name: str,
        a: Any,
        b: Any,
        radii: Sequence[Value] | None = None,
        teeth: Sequence[Value] | None = None,
        crossed: bool = False,
        phase: Value = 0,
    ) -> None:
        """Add a belt without slip on two pulleys: r_a a = r_b b, with a minus where it crosses.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Two joints of one degree, or coordinates, whose axes one part carries.
        radii : sequence of two
            Base or pitch circle radii (m), in the order of the joints.
        teeth : sequence of two
            Numbers of teeth.
        crossed : bool, optional
            Whether the belt crosses, so that the pulleys turn opposite ways.
        phase : scalar, optional
            First angle where the second is 0 (rad).
        """
    def planetary(
        self,
        name: str,
        sun: Any = None,
        ring: Any = None,
        carrier: Any = None,
        planet: Any = None,
        radii: Mapping[str, Value] | None = None,
        teeth: Mapping[str, Value] | None = None,
        phase: Value = 0,
    ) -> None:
        """Add the meshing wheels of a planetary set (Willis).

        Parameters
        ----------
        name : str
            Identifier.
        sun : handle or str, optional
            Joint that turns the sun relative to the frame; fixed if left out.
        ring : handle or str, optional
            Joint that turns the ring relative to the frame; fixed if left out.
        carrier : handle or str, optional
            Joint that turns the carrier relative to the frame; fixed if left out.
        planet : handle or str, optional
            Joint of a planet, on the carrier or on the frame, if planets are bodies.
        radii : mapping
            Radii of sun, planet, ring that are there (m).
        teeth : mapping
            Numbers of teeth of sun, planet, ring that are there.
        phase : scalar, optional
            What the equation of the sun gives in the reference position (rad).
        """
    def cam(self, name: str, cam: Any, follower: Any, lift: Value, phase: Value = 0, periodic: bool = True) -> None:
        """Add a follower that moves by a law: its coordinate is the lift.

        Parameters
        ----------
        name : str
            Identifier.
        cam : handle or str
            Joint of the cam.
        follower : handle or str
            Joint of the follower.
        lift : scalar
            The follower's coordinate over theta = the cam's angle less the phase, from 0 to a full turn.
        phase : scalar, optional
            The cam's angle where theta is 0 (rad).
        periodic : bool, optional
            Whether the profile repeats every turn; then value and slope at 2 pi must be those at 0.
        """
    def cam_contact(
        self,
        name: str,
        cam: Any,
        follower: Any,
        shape: str,
        contour: Value = None,
        support: Value = None,
        radius: Value = None,
        coordinate: Any = None,
        periodic: bool = True,
    ) -> None:
        """Add a follower that stays in contact with the contour of a plane cam.

        Parameters
        ----------
        name : str
            Identifier.
        cam : handle or str
            The cam's axis (z) and where polar angles start (x).
        follower : handle or str
            Tip, centre of the roller, or face with z away from the cam.
        shape : {"knife_edge", "roller", "flat_face"}
            Shape of the follower.
        contour : scalar
            R(theta), radius of the contour over its polar angle (m).
        support : scalar
            Of a flat face: h(theta), distance of the tangent with its normal at theta (m).
        radius : scalar, optional
            Radius of the roller (m).
        coordinate : str, symbol or handle, optional
            Name of the polar angle of the contact point (<name>_contact).
        periodic : bool, optional
            Whether the profile repeats every turn; then value and slope at 2 pi must be those at 0.
        """
    def rolling(
        self,
        name: str,
        wheel: Any,
        plane: Any = 'ground',
        radius: Value = None,
        shape: str = 'disc',
        tube: Value = 0,
        no_spin: bool = False,
    ) -> None:
        """Add a wheel or ball that rolls on a plane without slip.

        Parameters
        ----------
        name : str
            Identifier.
        wheel : handle or str
            Marker at the centre; z is the axle of a disc.
        plane : handle or str, optional
            Marker in the plane; z is its normal, on the side of the wheel (ground).
        radius : scalar
            Radius (m).
        shape : {"disc", "sphere"}, optional
            Shape of the wheel.
        tube : scalar, optional
            Radius of the rounded edge of a disc, 0 for a sharp one (m).
        no_spin : bool, optional
            Whether a sphere cannot turn about the normal.
        """
    def knife_edge(self, name: str, marker: Any, axis: str | Sequence[float] = 'y', on: Any = 'ground') -> None:
        """Add a blade: a marker that does not move along an axis of its own.

        Parameters
        ----------
        name : str
            Identifier.
        marker : handle or str
            Where the blade touches.
        axis : str or three floats, optional
            Direction without motion, in the marker's axes.
        on : handle or str, optional
            The body on which it moves (ground).
        """
    def driver(
        self,
        name: str,
        coordinate: Any = None,
        value: Value = None,
        between: Sequence[Any] | None = None,
        angle: Sequence[Any] | None = None,
        marker: Any = None,
        axis: str | Sequence[float] = 'x',
        on: Any = 'ground',
    ) -> None:
        """Add a motion prescribed over time: of a coordinate, a distance, an angle or the place of a marker.

        Parameters
        ----------
        name : str
            Identifier.
        coordinate : handle or str
            A joint of one degree, or a coordinate, that is driven.
        value : scalar
            Motion over time (rad or m), of t, parameters, inputs, functions; its second derivative should be
            continuous.
        between : handles or str
            Two markers whose distance is driven; they must not meet.
        angle : handles or str
            Two markers with z axes that stay in line; the turn of the second about z of the first is driven.
        marker : handle or str
            A marker of which one coordinate is driven.
        axis : str or three floats, optional
            Along which the marker's place counts, in the axes of on.
        on : handle or str, optional
            From where the marker's place counts (ground).
        """
