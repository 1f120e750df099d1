"""Stage describe, the builder's forces: one method for each type of force -> an entry of the forces section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import UsageError
from .description import items
from .handles import JointHandle, MarkerHandle
from .keywords import names_keywords
from .model_contacts import ContactMethods
from .model_force_parts import Value
from .model_laws import LawMethods


@names_keywords
class ForceMethods(LawMethods, ContactMethods):
    """Methods of Model that add force elements.

    Bodies, markers and joints are handles or names; where a joint is asked for, a coordinate (its SymPy symbol or its
    name) says which one of several is meant.
    """

    def force(self, name: str, marker: Any, value: Sequence[Value], axes: str | None = None) -> None:
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
            Axes of the value: ground's, or the marker's own.
        """
        if isinstance(marker, JointHandle):
            remedy = "along the coordinate of a joint take torque or actuator (N on a length, N m on an angle)"
            raise UsageError(f"force {name!r} acts at a marker, which {marker!r} is not; {remedy}")
        self._force("force", name, marker=self._marker(marker), value=value, axes=axes)

    def torque(self, name: str, on: Any, value: Value | Sequence[Value], axes: str | None = None) -> None:
        """Add a torque on a joint's coordinate (one value) or on a body (three values).

        Parameters
        ----------
        name : str
            Identifier.
        on : handle or str
            A joint or coordinate for one value, a body or marker for three.
        value : scalar or sequence of three
            Torque (N m); on a coordinate that is a length, a force (N).
        axes : {"ground", "body"}, optional
            Axes of three values: ground's, or the marker's own.
        """
        on_body = isinstance(on, MarkerHandle) or (not isinstance(on, JointHandle) and items(value) is not None)
        if on_body:
            self._force("torque", name, body=self._marker(on), value=value, axes=axes)
        else:
            self._force("torque", name, joint=self._joint(on), value=value, axes=axes)

    def spring(self, name: str, a: Any, b: Any, stiffness: Value, length: Value = 0, via: Sequence[Any] = ()) -> None:
        """Add a spring between two markers: stiffness (N/m), length without force (m), ``via`` as in ``element``."""
        self._force("spring", name, between=self._pair(a, b), stiffness=stiffness, length=length, via=self._via(via))

    def damper(self, name: str, a: Any, b: Any, damping: Value, via: Sequence[Any] = ()) -> None:
        """Add a damper between two markers: damping (N s/m), ``via`` as in :meth:`element`."""
        self._force("damper", name, between=self._pair(a, b), damping=damping, via=self._via(via))

    def torsional_spring(self, name: str, *between: Any, stiffness: Value, angle: Value = 0, joint: Any = None) -> None:
        """Add a spring on an angle.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handle or str
            One joint or coordinate, or two markers (angle of the second about the z axis of the first).
        stiffness : scalar
            Stiffness (N m/rad).
        angle : scalar, optional
            Angle without torque (rad).
        joint : handle or str, optional
            The joint, instead of ``between``.
        """
        self._force("torsional_spring", name, **self._where(between, joint), stiffness=stiffness, angle=angle)

    def torsional_damper(self, name: str, *between: Any, damping: Value, joint: Any = None) -> None:
        """Add a damper on an angle (N m s/rad): of a joint, or between two markers as in :meth:`torsional_spring`."""
        self._force("torsional_damper", name, **self._where(between, joint), damping=damping)

    def actuator(
        self, name: str, *between: Any, value: Value = None, joint: Any = None, via: Sequence[Any] = ()
    ) -> None:
        """Add a given force: on a joint's coordinate, or along the line between two markers.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handle or str
            One joint or coordinate, or two markers; the value may follow without its keyword.
        value : scalar
            Positive drives the coordinate up, or pushes the markers apart (N or N m).
        joint : handle or str, optional
            The joint, instead of ``between``.
        via : sequence, optional
            What the path between the markers runs over, as in :meth:`element`.
        """
        if value is None and between:
            *between_list, value = between
            between = tuple(between_list)
        self._force("actuator", name, **self._where(between, joint), value=value, via=self._via(via))
