"""Stage describe, the builder's constraints: one method for each type -> an entry of the constraints section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .described import Described
from .keywords import names_keywords
from .references import joint_reference, marker_reference

Value = Any  # a number, a text or a SymPy expression
Two = Sequence[Any]


@names_keywords
class ConstraintMethods(Described):
    """Methods of Model that add constraints.

    Where a joint is asked for, a handle, its name, or a coordinate (symbol or name) will do.  Sizes are pairs in the
    order of the joints.  Angles of a pair are measured from the part that carries both axes.
    """

    def coupling(
        self, name: str, coordinates: Mapping[Any, Value] | None = None, offset: Value = None, equation: Value = None
    ) -> None:
        """Couple coordinates: a linear relation, or any equation.

        Parameters
        ----------
        name : str
            Identifier.
        coordinates : mapping, optional
            Coordinate -> factor: the sum of factor times coordinate is ``offset``.
        offset : scalar, optional
            Expression of parameters (0).
        equation : scalar, optional
            Instead: an expression of t, parameters, coordinates and places of markers that is held at 0; with
            velocities, in which it must be linear, the constraint is nonholonomic.
        """
        factors = None
        if coordinates is not None:
            factors = {self._joint_of(key): value for key, value in coordinates.items()}
        self._constrain("coupling", name, coordinates=factors, offset=offset, equation=equation)

    def gear(
        self,
        name: str,
        a: Any,
        b: Any,
        radii: Two | None = None,
        teeth: Two | None = None,
        cones: Two | None = None,
        internal: bool | None = None,
        phase: Value = None,
    ) -> None:
        """Let two gears mesh: r_a a + r_b b = r_a phase, with a minus if ``internal``.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Joints or coordinates.
        radii, teeth, cones : sequence of two
            One of them: base or pitch circle radii (m), numbers of teeth, or pitch cone angles of a bevel pair (rad)
            whose z axes both point away from where they meet, or both to it.
        internal : bool, optional
            Whether both turn the same way.
        phase : scalar, optional
            The first angle where the second is 0 (rad).
        """
        keys = {"radii": radii, "teeth": teeth, "cones": cones, "internal": internal, "phase": phase}
        self._constrain("gear", name, joints=[self._joint_of(a), self._joint_of(b)], **keys)

    def planetary(
        self,
        name: str,
        sun: Any = None,
        ring: Any = None,
        carrier: Any = None,
        planet: Any = None,
        radii: Mapping[str, Value] | None = None,
        teeth: Mapping[str, Value] | None = None,
        phase: Value = None,
    ) -> None:
        """Let the wheels of a planetary set mesh (Willis).

        Parameters
        ----------
        name : str
            Identifier.
        sun, ring, carrier : handle or str, optional
            Joints that turn them relative to the frame; one left out is fixed to it.
        planet : handle or str, optional
            Joint of a planet, on the carrier or on the frame, if planets are bodies of the model.
        radii, teeth : mapping
            ``sun``, ``planet``, ``ring`` -> radius (m) or number of teeth, of the wheels that are there.
        phase : scalar, optional
            What the equation of the sun gives in the reference position (rad).
        """
        parts = {"sun": sun, "ring": ring, "carrier": carrier, "planet": planet}
        given = {key: self._joint_of(value) for key, value in parts.items() if value is not None}
        self._constrain("planetary", name, **given, radii=radii, teeth=teeth, phase=phase)

    def rack(self, name: str, pinion: Any, rack: Any, radius: Value, offset: Value = None) -> None:
        """Let a pinion roll on a rack: s = radius angle + offset (m)."""
        keys = {"pinion": self._joint_of(pinion), "rack": self._joint_of(rack)}
        self._constrain("rack", name, **keys, radius=radius, offset=offset)

    def belt(
        self,
        name: str,
        a: Any,
        b: Any,
        radii: Two | None = None,
        teeth: Two | None = None,
        crossed: bool | None = None,
        phase: Value = None,
    ) -> None:
        """Lay a belt without slip on two pulleys: r_a a = r_b b, with a minus if ``crossed``; see :meth:`gear`."""
        keys = {"radii": radii, "teeth": teeth, "crossed": crossed, "phase": phase}
        self._constrain("belt", name, joints=[self._joint_of(a), self._joint_of(b)], **keys)

    def cam(
        self, name: str, cam: Any, follower: Any, lift: Value, phase: Value = None, periodic: bool | None = None
    ) -> None:
        """Let a follower move by a law: its coordinate is ``lift``, an expression of ``theta`` = cam's angle - phase.

        Parameters
        ----------
        name : str
            Identifier.
        cam, follower : handle or str
            Joints or coordinates.
        lift : str or SymPy expression
            In parameters and ``theta``, which runs from 0 to a full turn.
        phase : scalar, optional
            The cam's angle where theta is 0 (rad).
        periodic : bool, optional
            Whether the law repeats every turn (it does); then value and slope at 2 pi must be those at 0.
        """
        keys = {"cam": self._joint_of(cam), "follower": self._joint_of(follower)}
        self._constrain("cam", name, **keys, lift=lift, phase=phase, periodic=periodic)

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
        periodic: bool | None = None,
    ) -> None:
        """Hold a follower in contact with the contour of a plane cam.

        Parameters
        ----------
        name : str
            Identifier.
        cam : handle or str
            Marker whose z axis is the cam's; polar angles start at its x axis.
        follower : handle or str
            Marker at the tip, at the centre of the roller, or in the face with z away from the cam.
        shape : {"knife_edge", "roller", "flat_face"}
            What touches the cam.
        contour : str or SymPy expression
            r(theta), radius of the contour over its polar angle (m).
        support : str or SymPy expression
            For a flat face, instead: h(theta), distance of the tangent whose outward normal points to theta (m).
        radius : scalar
            Radius of the roller (m).
        coordinate : str, optional
            Name of the polar angle of the contact point, ``<name>_contact`` unless given.
        periodic : bool, optional
            Whether the profile repeats every turn (it does); then value and slope at 2 pi must be those at 0.
        """
        self._constrain(
            "cam_contact",
            name,
            cam=self._marker_of(cam),
            follower=self._marker_of(follower),
            shape=shape,
            contour=contour,
            support=support,
            radius=radius,
            coordinate=coordinate,
            periodic=periodic,
        )

    def rolling(
        self,
        name: str,
        wheel: Any,
        plane: Any = None,
        radius: Value = None,
        shape: str | None = None,
        tube: Value = None,
        no_spin: bool | None = None,
    ) -> None:
        """Let a wheel or ball roll on a plane without slip.

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
            A disc unless given.
        tube : scalar, optional
            Radius of the rounded edge of a disc (m); 0 for a sharp one.
        no_spin : bool, optional
            Whether a sphere cannot turn about the normal.
        """
        on = None if plane is None else self._marker_of(plane)
        keys = {"radius": radius, "shape": shape, "tube": tube, "no_spin": no_spin}
        self._constrain("rolling", name, wheel=self._marker_of(wheel), plane=on, **keys)

    def knife_edge(self, name: str, marker: Any, axis: str | Sequence[float] | None = None, on: Any = None) -> None:
        """Keep a marker from moving along an axis of its own (y), relative to the body of ``on`` (ground)."""
        under = None if on is None else self._marker_of(on)
        self._constrain("knife_edge", name, marker=self._marker_of(marker), axis=axis, on=under)

    def driver(
        self,
        name: str,
        coordinate: Any = None,
        value: Value = None,
        between: Sequence[Any] | None = None,
        angle: Sequence[Any] | None = None,
        marker: Any = None,
        axis: str | Sequence[float] | None = None,
        on: Any = None,
    ) -> None:
        """Prescribe a motion over time: of a coordinate, a distance, an angle or the place of a marker.

        Parameters
        ----------
        name : str
            Identifier.
        coordinate : handle or str, optional
            A joint of one degree, or a coordinate.
        value : scalar
            Expression of t, parameters and functions (rad or m); its second derivative should be continuous.
        between : (marker, marker), optional
            Instead of a coordinate: the distance of two markers, which must not meet.
        angle : (marker, marker), optional
            Instead: the turn of the second about the z axis of the first; the two z axes stay in line.
        marker : handle or str, optional
            Instead: the place of a marker along ``axis``.
        axis : str or three floats, optional
            In the axes of ``on`` (x).
        on : handle or str, optional
            Marker from whose origin the place counts (ground).
        """
        pairs = {"between": between, "angle": angle}
        given = {key: [self._marker_of(end) for end in pair] for key, pair in pairs.items() if pair is not None}
        single = {"coordinate": None if coordinate is None else self._joint_of(coordinate)}
        single |= {key: None if end is None else self._marker_of(end) for key, end in (("marker", marker), ("on", on))}
        self._constrain("driver", name, **single, **given, axis=axis, value=value)

    # -- parts ----------------------------------------------------------------------------------------------------
    def _constrain(self, type_name: str, name: str, **keys: Any) -> None:
        given = {key: value for key, value in keys.items() if value is not None}
        self._description.add("constraints", name, {"type": type_name, **given})

    def _joint_of(self, value: Any) -> Any:
        return joint_reference(self, value)

    def _marker_of(self, value: Any) -> Any:
        return marker_reference(self, value)
