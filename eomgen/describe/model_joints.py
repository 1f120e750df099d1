"""Stage describe, the builder's joints: one method for each type of joint -> an entry of the joints section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

from ..joints import JOINTS
from .description import Description
from .handles import JointHandle
from .keywords import names_keywords
from .references import marker_reference

if TYPE_CHECKING:
    from .model import Model

Axis = str | Sequence[float]


@names_keywords
class JointMethods:
    """Methods of Model that add joints.

    ``predecessor`` and ``successor`` are bodies or markers, as handles or names.  A coordinate is the motion of the
    successor relative to the predecessor, along or about the axis, which is given in the axes of the markers.
    """

    _description: Description

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
            Whatever the type knows: axis, coordinate, coordinates, sequence; limits, dry_friction, armature.

        Returns
        -------
        JointHandle
        """
        model = cast("Model", self)
        between = [marker_reference(model, predecessor), marker_reference(model, successor)]
        given = {key: value for key, value in keys.items() if value is not None}
        entry = self._description.add("joints", name, {"type": type, "between": between, **given})
        return JointHandle(model, entry)

    def revolute(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinate: Any = None,
        limits: Any = None,
        dry_friction: Any = None,
        armature: Any = None,
    ) -> JointHandle:
        """Add a joint that turns about an axis; see :meth:`joint`."""
        data = {"limits": limits, "dry_friction": dry_friction, "armature": armature}
        return self.joint("revolute", name, predecessor, successor, axis=axis, coordinate=coordinate, **data)

    def prismatic(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinate: Any = None,
        limits: Any = None,
        dry_friction: Any = None,
        armature: Any = None,
    ) -> JointHandle:
        """Add a joint that slides along an axis; see :meth:`joint`."""
        data = {"limits": limits, "dry_friction": dry_friction, "armature": armature}
        return self.joint("prismatic", name, predecessor, successor, axis=axis, coordinate=coordinate, **data)

    def cylindrical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        limits: Any = None,
    ) -> JointHandle:
        """Add a joint that slides along an axis and turns about it; see :meth:`joint`."""
        return self.joint(
            "cylindrical", name, predecessor, successor, axis=axis, coordinates=coordinates, limits=limits
        )

    def spherical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str | None = None,
        coordinates: Sequence[Any] | None = None,
        limits: Any = None,
    ) -> JointHandle:
        """Add a ball joint in Euler angles (intrinsic, ``"xyz"`` unless given); see :meth:`joint`."""
        return self.joint(
            "spherical", name, predecessor, successor, sequence=sequence, coordinates=coordinates, limits=limits
        )

    def planar(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        limits: Any = None,
    ) -> JointHandle:
        """Add a joint that moves in a plane and turns about its normal, the axis; see :meth:`joint`."""
        return self.joint("planar", name, predecessor, successor, axis=axis, coordinates=coordinates, limits=limits)

    def free(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str | None = None,
        coordinates: Sequence[Any] | None = None,
        limits: Any = None,
    ) -> JointHandle:
        """Add six degrees of freedom: position, then Euler angles; see :meth:`joint`."""
        return self.joint(
            "free", name, predecessor, successor, sequence=sequence, coordinates=coordinates, limits=limits
        )

    def weld(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Fix two bodies to each other; see :meth:`joint`."""
        return self.joint("weld", name, predecessor, successor)

    def _joint_method(self, type_name: str) -> Callable[..., JointHandle] | None:
        """A method for a type of joint that has none written out here."""
        if type_name not in JOINTS:
            return None

        def method(name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
            return self.joint(type_name, name, predecessor, successor, **keys)

        return method
