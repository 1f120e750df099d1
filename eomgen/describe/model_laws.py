"""Stage describe, the builder's elements of their own law: laws along a path, bushings, gravity of a point, muscles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .keywords import names_keywords
from .model_force_parts import ForceParts, Value


@names_keywords
class LawMethods(ForceParts):
    """Methods of Model that add elements whose law is given, and those between two frames or along a muscle."""

    def element(
        self,
        name: str,
        *between: Any,
        law: Value = 0,
        potential: Value = 0,
        joint: Any = None,
        via: Sequence[Any] = (),
    ) -> None:
        """Add a force of any law along a joint's coordinate, the line between two markers, or a path.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handle or str
            One joint or coordinate, or two markers.
        law : scalar, optional
            Force that drives the coordinate up or pushes the markers apart (N, or N m for an angle); it may use
            ``length`` (``angle`` if the coordinate is one) and ``rate`` besides all that forces may.
        potential : scalar, optional
            Potential energy V of ``length`` or ``angle`` and parameters (J); the force -dV/dlength comes with it.
        joint : handle or str, optional
            The joint, instead of ``between``.
        via : sequence, optional
            What a path between the markers runs over, in order: markers it slides through, and cylinders
            ``{"around": marker, "radius": r, "sense": "positive"}`` about the marker's z axis.
        """
        self._force(
            "element",
            name,
            **self._where(between, joint),
            via=self._via(via),
            **_given(law=law, potential=potential),
        )

    def torsional_element(
        self, name: str, *between: Any, law: Value = 0, potential: Value = 0, joint: Any = None
    ) -> None:
        """Add a torque of any law on an angle: of a joint, or of the second marker about the z axis of the first.

        Parameters
        ----------
        name : str
            Identifier.
        *between : handle or str
            One joint or coordinate, or two markers.
        law : scalar, optional
            Torque along the angle (N m); it may use ``angle`` and ``rate``.
        potential : scalar, optional
            Potential energy V of ``angle`` and parameters (J); the torque -dV/dangle comes with it.
        joint : handle or str, optional
            The joint, instead of ``between``.
        """
        self._force("torsional_element", name, **self._where(between, joint), **_given(law=law, potential=potential))

    def bushing(
        self, name: str, a: Any, b: Any, stiffness: Sequence[Any], damping: Sequence[Any] = (0, 0, 0, 0, 0, 0)
    ) -> None:
        """Add a bushing between two markers.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Displacements are those of ``b`` from ``a``, in the axes of ``a``: three lengths, then three angles.
        stiffness, damping : sequence
            Six values for the diagonal or a 6 x 6 matrix (N/m, N, N m/rad and the same per velocity); the stiffness
            symmetric.
        """
        self._force("bushing", name, between=self._pair(a, b), stiffness=stiffness, damping=damping)

    def point_gravity(self, name: str, center: Any, body: Any, mu: Value, extent: str = "point") -> None:
        """Add the gravity of a point on a body.

        Parameters
        ----------
        name : str
            Identifier.
        center : handle or str
            The marker that attracts; it bears the reaction.
        body : handle or str
            The body that is attracted, at its centre of mass.
        mu : scalar
            Gravitational parameter G M of the centre (m^3/s^2).
        extent : {"point", "maccullagh"}
            Whether the body's inertia counts, to second order: gravity-gradient torque and its force.
        """
        self._force("point_gravity", name, center=self._marker(center), body=self._marker(body), mu=mu, extent=extent)

    def muscle(
        self,
        name: str,
        a: Any,
        b: Any,
        activation: Value,
        force_max: Value,
        fiber_length: Value,
        slack_length: Value,
        velocity_max: Value | None = None,
        pennation: Value = 0,
        damping: Value = 0.1,
        via: Sequence[Any] = (),
    ) -> None:
        """Add a Hill-type muscle with a rigid tendon (De Groote and others, 2016) between two markers.

        Parameters
        ----------
        name : str
            Identifier.
        a, b : handle or str
            Origin and insertion.
        activation : scalar
            0 to 1: an input or any expression that forces may use.
        force_max : scalar
            Largest active force (N).
        fiber_length, slack_length : scalar
            Optimal length of the fibres, length of the tendon (m).
        velocity_max : scalar, optional
            Fastest shortening of the fibres, by which their velocity is normalised (m/s); 10 ``fiber_length`` a second
            if not given, as De Groote and others have it.
        pennation : scalar, optional
            Angle of the fibres to the tendon at their optimal length (rad).
        damping : scalar, optional
            Damping force at ``velocity_max``, in parts of ``force_max``.
        via : sequence, optional
            What the path runs over, as in :meth:`element`.
        """
        self._force(
            "muscle",
            name,
            between=self._pair(a, b),
            via=self._via(via),
            activation=activation,
            force_max=force_max,
            fiber_length=fiber_length,
            slack_length=slack_length,
            velocity_max=velocity_max,
            pennation=pennation,
            damping=damping,
        )


def _given(**laws: Value) -> dict[str, Value]:
    """Laws less those left at 0; 0 said by both means a law all the same."""
    kept = {key: law for key, law in laws.items() if not (isinstance(law, int | float) and law == 0)}
    return kept or {"law": 0}
