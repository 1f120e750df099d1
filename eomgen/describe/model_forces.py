"""Stage describe, the builder's forces: one method for each type of force -> an entry of the forces section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from ..errors import UsageError
from .description import Description, items
from .handles import JointHandle, MarkerHandle
from .keywords import names_keywords
from .references import joint_reference, marker_reference

if TYPE_CHECKING:
    from .model import Model

Value = Any  # a number, a text or a SymPy expression


@names_keywords
class ForceMethods:
    """Methods of Model that add force elements.

    Bodies, markers and joints are handles or names; where a joint is asked for, a coordinate (its SymPy symbol or its
    name) says which one of several is meant.
    """

    _description: Description

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

    def spring(self, name: str, a: Any, b: Any, stiffness: Value, length: Value = 0) -> None:
        """Add a spring between two markers: stiffness (N/m), length without force (m)."""
        self._force("spring", name, between=self._pair(a, b), stiffness=stiffness, length=length)

    def damper(self, name: str, a: Any, b: Any, damping: Value) -> None:
        """Add a damper between two markers: damping (N s/m)."""
        self._force("damper", name, between=self._pair(a, b), damping=damping)

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

    def friction(self, name: str, joint: Any, viscous: Value) -> None:
        """Add viscous friction to a joint's coordinate (N m s/rad or N s/m)."""
        self._force("friction", name, joint=self._joint(joint), viscous=viscous)

    def actuator(self, name: str, *between: Any, value: Value = None, joint: Any = None) -> None:
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
        """
        if value is None and between:
            *between_list, value = between
            between = tuple(between_list)
        self._force("actuator", name, **self._where(between, joint), value=value)

    # -- parts ----------------------------------------------------------------------------------------------------
    def _force(self, type_name: str, name: str, **keys: Any) -> None:
        given = {key: value for key, value in keys.items() if value is not None}
        self._description.add("forces", name, {"type": type_name, **given})

    def _marker(self, value: Any) -> Any:
        return marker_reference(cast("Model", self), value)

    def _joint(self, value: Any) -> Any:
        return joint_reference(cast("Model", self), value)

    def _pair(self, a: Any, b: Any) -> list[Any]:
        return [self._marker(a), self._marker(b)]

    def _where(self, between: tuple[Any, ...], joint: Any) -> dict[str, Any]:
        if joint is not None and not between:
            return {"joint": self._joint(joint)}
        if joint is None and len(between) == 1:
            return {"joint": self._joint(between[0])}
        if joint is None and len(between) == 2:
            return {"between": self._pair(*between)}
        raise UsageError("give one joint or two markers, and then the values")
