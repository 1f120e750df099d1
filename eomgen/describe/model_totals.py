"""Stage describe, the builder's sums over the mechanism: energy, mass, centre of mass and momenta, for outputs."""

from __future__ import annotations

from typing import Any

from .described import Described
from .handles import MarkerHandle, Triple
from .names import COM
from .sympy_face import symbol


class TotalMethods(Described):
    """The part of Model that names what belongs to the mechanism as a whole, as SymPy symbols for outputs."""

    @property
    def total_energy(self) -> Any:
        """Kinetic and potential energy together (J)."""
        return symbol("total_energy")

    @property
    def total_mass(self) -> Any:
        """Mass of all bodies (kg)."""
        return symbol("total_mass")

    @property
    def center_of_mass(self) -> MarkerHandle:
        """The centre of mass of all bodies: its ``.position``, ``.velocity`` and ``.acceleration`` in ground axes."""
        return MarkerHandle(self, COM)

    @property
    def momentum(self) -> Triple:
        """Linear momentum of all bodies in ground axes (kg m/s)."""
        return symbol("momentum_x"), symbol("momentum_y"), symbol("momentum_z")

    def angular_momentum(self, about: Any = COM) -> Triple:
        """Angular momentum of all bodies in ground axes (kg m^2/s).

        Parameters
        ----------
        about : body, marker or their name, optional
            The point; the centre of mass of all bodies unless given.  ``m.ground`` is the origin of ground.  A moving
            point counts where it is, and velocities are those relative to ground.
        """
        label = self._label(about)
        x, y, z = (symbol(f"angular_momentum_{axis}({label})") for axis in "xyz")
        return x, y, z

    def inertia_about(self, about: Any = COM) -> tuple[Triple, Triple, Triple]:
        """Inertia of all bodies in ground axes (kg m^2), rows of a symmetric tensor.

        Parameters
        ----------
        about : body, marker or their name, optional
            The point; the centre of mass of all bodies unless given.
        """
        label = self._label(about)
        xx, yy, zz, xy, xz, yz = (symbol(f"inertia_{e}({label})") for e in ("xx", "yy", "zz", "xy", "xz", "yz"))
        return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)

    @staticmethod
    def _label(about: Any) -> str:
        if isinstance(about, MarkerHandle):
            about.note()
            return about.label
        return str(about)
