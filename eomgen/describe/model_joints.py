"""Stage describe, the builder's joints: one method for each type of joint -> an entry of the joints section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..joints import JOINTS
from .described import Described
from .fields import joint_fields
from .handles import JointHandle
from .keywords import check_keywords, names_keywords
from .references import marker_reference

Axis = str | Sequence[float]


@names_keywords
class JointMethods(Described):
    """Methods of Model that add joints.

    ``predecessor`` and ``successor`` are bodies or markers, as handles or names.  A coordinate is the motion of the
    successor relative to the predecessor, along or about the axis, which is given in the axes of the markers.
    """

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
            Whatever the type knows: axis, coordinate, coordinates, sequence, rotation, pitch, length, curve, surface;
            and data: limits, dry_friction, armature.

        Returns
        -------
        JointHandle
        """
        between = [marker_reference(self, predecessor), marker_reference(self, successor)]
        given = {key: value for key, value in keys.items() if value is not None}
        entry = self._description.add("joints", name, {"type": type, "between": between, **given})
        return JointHandle(self, entry)

    def _checked(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """Add a joint by the method of its type, which a misspelt keyword must not pass unseen."""
        check_keywords(type, keys, [key for key in joint_fields(type) if key not in ("type", "between")])
        return self.joint(type, name, predecessor, successor, **keys)

    def revolute(
        self, name: str, predecessor: Any, successor: Any, axis: Axis = "z", coordinate: Any = None, **data: Any
    ) -> JointHandle:
        """Add a joint that turns about an axis; see :meth:`joint`."""
        return self._checked("revolute", name, predecessor, successor, axis=axis, coordinate=coordinate, **data)

    def continuous(
        self, name: str, predecessor: Any, successor: Any, axis: Axis = "z", coordinate: Any = None, **data: Any
    ) -> JointHandle:
        """Add a revolute joint that turns on and on; see :meth:`joint`."""
        return self._checked("continuous", name, predecessor, successor, axis=axis, coordinate=coordinate, **data)

    def prismatic(
        self, name: str, predecessor: Any, successor: Any, axis: Axis = "z", coordinate: Any = None, **data: Any
    ) -> JointHandle:
        """Add a joint that slides along an axis; see :meth:`joint`."""
        return self._checked("prismatic", name, predecessor, successor, axis=axis, coordinate=coordinate, **data)

    def screw(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        pitch: Any,
        axis: Axis = "z",
        coordinate: Any = None,
        **data: Any,
    ) -> JointHandle:
        """Add a joint that turns about an axis and slides along it by ``pitch`` (m) a turn; see :meth:`joint`."""
        keys = {"pitch": pitch, "axis": axis, "coordinate": coordinate}
        return self._checked("screw", name, predecessor, successor, **keys, **data)

    def cylindrical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add a joint that slides along an axis and turns about it; see :meth:`joint`."""
        return self._checked("cylindrical", name, predecessor, successor, axis=axis, coordinates=coordinates, **data)

    def universal(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add a Cardan joint between shafts along the axis.

        With the default axis its cross turns about x of the predecessor and y of the successor; see :meth:`joint`.
        """
        return self._checked("universal", name, predecessor, successor, axis=axis, coordinates=coordinates, **data)

    def constant_velocity(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add a joint that bends across the axis and passes turning about it on evenly; see :meth:`joint`."""
        keys = {"axis": axis, "coordinates": coordinates}
        return self._checked("constant_velocity", name, predecessor, successor, **keys, **data)

    def spherical(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str | None = None,
        coordinates: Sequence[Any] | None = None,
        rotation: str | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add a ball joint, in Euler angles (``"xyz"`` unless given) or Euler parameters; see :meth:`joint`."""
        keys = {"sequence": sequence, "coordinates": coordinates, "rotation": rotation}
        return self._checked("spherical", name, predecessor, successor, **keys, **data)

    def planar(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        axis: Axis = "z",
        coordinates: Sequence[Any] | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add a joint that moves in a plane and turns about its normal, the axis; see :meth:`joint`."""
        return self._checked("planar", name, predecessor, successor, axis=axis, coordinates=coordinates, **data)

    def free(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        sequence: str | None = None,
        coordinates: Sequence[Any] | None = None,
        rotation: str | None = None,
        **data: Any,
    ) -> JointHandle:
        """Add six degrees of freedom: position, then rotation as for a spherical joint; see :meth:`joint`."""
        keys = {"sequence": sequence, "coordinates": coordinates, "rotation": rotation}
        return self._checked("free", name, predecessor, successor, **keys, **data)

    def weld(self, name: str, predecessor: Any, successor: Any) -> JointHandle:
        """Fix two bodies to each other; see :meth:`joint`."""
        return self._checked("weld", name, predecessor, successor)

    def distance(self, name: str, predecessor: Any, successor: Any, length: Any) -> JointHandle:
        """Hold two points ``length`` (m) apart by a massless rod: a pure constraint; see :meth:`joint`."""
        return self._checked("distance", name, predecessor, successor, length=length)

    def point_on_curve(
        self, name: str, predecessor: Any, successor: Any, curve: Sequence[Any], **keys: Any
    ) -> JointHandle:
        """Guide the successor's origin along a curve of the predecessor; it turns freely.

        ``curve`` is a point [x, y, z] (m) by the joint's first coordinate, ``<name>_s`` unless named; further keys are
        those of a spherical joint; see :meth:`joint`, and :meth:`curve_slider` for a successor that does not turn.
        """
        return self._checked("point_on_curve", name, predecessor, successor, curve=curve, **keys)

    def curve_slider(
        self,
        name: str,
        predecessor: Any,
        successor: Any,
        curve: Sequence[Any],
        coordinate: Any = None,
        **data: Any,
    ) -> JointHandle:
        """Guide the successor's origin along a curve of the predecessor, without turning: a bead on a wire.

        ``curve`` is a point [x, y, z] (m) by the joint's coordinate; see :meth:`joint`.
        """
        return self._checked("curve_slider", name, predecessor, successor, curve=curve, coordinate=coordinate, **data)

    def point_on_surface(
        self, name: str, predecessor: Any, successor: Any, surface: Sequence[Any], **keys: Any
    ) -> JointHandle:
        """Guide the successor's origin on a surface of the predecessor; it turns freely.

        ``surface`` is a point [x, y, z] (m) by the joint's first two coordinates, ``<name>_u`` and ``<name>_v`` unless
        named; further keys are those of a spherical joint; see :meth:`joint`, and :meth:`surface_slider` for a
        successor that does not turn.
        """
        return self._checked("point_on_surface", name, predecessor, successor, surface=surface, **keys)

    def surface_slider(
        self, name: str, predecessor: Any, successor: Any, surface: Sequence[Any], **keys: Any
    ) -> JointHandle:
        """Guide the successor's origin on a surface of the predecessor, without turning; see :meth:`joint`."""
        return self._checked("surface_slider", name, predecessor, successor, surface=surface, **keys)

    def _joint_method(self, type_name: str) -> Callable[..., JointHandle] | None:
        """A method for a type of joint that has none written out here."""
        if type_name not in JOINTS:
            return None

        def method(name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
            return self._checked(type_name, name, predecessor, successor, **keys)

        return method
