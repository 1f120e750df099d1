"""Stage describe, the builder's bodies: Model.body with every way to give mass and inertia."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .described import Described
from .handles import BodyHandle, placed_markers


class BodyMethods(Described):
    """The part of Model that adds bodies."""

    def body(
        self,
        name: str,
        mass: Any = None,
        com: Sequence[Any] | None = None,
        inertia: Any = None,
        *,
        principal: Sequence[Any] | None = None,
        first_moment: Sequence[Any] | None = None,
        about: Any = None,
        axes: Sequence[Any] | None = None,
        solids: Sequence[Mapping[str, Any]] | None = None,
        points: Sequence[Mapping[str, Any]] | None = None,
        check_inertia: bool | str | None = None,
        markers: Mapping[str, Any] | None = None,
        display: Sequence[Mapping[str, Any]] | None = None,
    ) -> BodyHandle:
        """Add a rigid body.

        Values are numbers, texts or SymPy expressions of parameters; parameters stay symbols in the equations.

        Parameters
        ----------
        name : str
            Identifier.
        mass : number, str or SymPy expression
            Mass (kg); 0 for a body without mass.
        com : sequence of three, optional
            Centre of mass in body axes (m); the origin unless given.
        inertia : sequence of three, 3 x 3 tensor or mapping, optional
            About the centre of mass in body axes (kg m^2): ``(xx, yy, zz)``, a tensor, or a mapping of ``xx`` .. ``yz``
            with the tensor's own sign; what is missing is 0.  One moment alone is that of a body moving in a plane.
        principal : sequence of three, optional
            Principal moments (kg m^2) instead of ``inertia``, along ``axes``.
        first_moment : sequence of three, optional
            m c about the body's origin (kg m) instead of ``com``.
        about : {'com', 'origin'}, name of a marker of the body, or sequence of three, optional
            The point that ``inertia`` or ``principal`` is about; a marker gives its axes too.
        axes : sequence of three, optional
            Fixed-axis roll, pitch, yaw (rad) of the axes that ``inertia`` or ``principal`` is written in.
        solids : sequence of mappings, optional
            Solids of uniform density, from which mass, centre of mass and inertia follow:
            ``{"type": "box", "size": (a, b, c), "density": rho, "at": (x, y, z), "rpy": (r, p, y)}``; the types are
            box, cylinder, tube, sphere, rod, cone, ellipsoid and mesh (an STL file); ``"subtract": True`` makes a hole.
        points : sequence of mappings, optional
            Point masses to add: ``{"mass": m, "at": (x, y, z)}``.
        check_inertia : {'error', 'note', 'off'} or bool, optional
            Whether a mass and inertia that no rigid body can have is refused, noted (``note``) or taken in silence
            (``off``, False); the model's own setting unless given.
        markers : mapping, optional
            Named markers, as in the model file: a position ``{"tip": (l, 0, 0)}`` (m, body axes), or a mapping of
            ``at``, ``rpy``, ``axes`` and ``matrix`` as :meth:`.BodyHandle.marker` takes them.  Each is known as
            ``body.name`` everywhere.
        display : sequence of mappings, optional
            Shapes to draw, as in the model file: ``shape``, its sizes, ``at``, ``rpy``; data only.

        Returns
        -------
        BodyHandle
        """
        given = {
            "mass": mass,
            "com": com,
            "inertia": inertia,
            "principal": principal,
            "first_moment": first_moment,
            "about": about,
            "axes": axes,
            "solids": solids,
            "points": points,
            "check_inertia": check_inertia,
            "markers": placed_markers(markers),
            "display": display,
        }
        values = {key: value for key, value in given.items() if value is not None}
        return BodyHandle(self, name, self._add("bodies", name, values))

    @property
    def check_inertia(self) -> bool | str:
        """What happens to a mass and inertia that no rigid body can have: error (True), note or off (False)."""
        given: bool | str = self._description.values.get("check_inertia", True)
        return given

    @check_inertia.setter
    def check_inertia(self, check: bool | str) -> None:
        self._description.values["check_inertia"] = check
