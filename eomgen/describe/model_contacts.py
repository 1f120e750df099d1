"""Stage describe, the builder's stops, contacts and friction: one method for each -> an entry of the forces section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .keywords import names_keywords
from .model_force_parts import ForceParts, Value


@names_keywords
class ContactMethods(ForceParts):
    """Methods of Model that add friction and one-sided forces.

    The normal force of stops and contacts is ``stiffness d**exponent max(0, 1 + dissipation d_dot)`` of the penetration
    d > 0 (Hunt and Crossley, 1975); instead of the dissipation (s/m) a coefficient of ``restitution`` may be given with
    the ``velocity`` of impact it belongs to, and the ``formula`` that connects them: ``hunt_crossley``, ``lankarani``,
    ``flores``.  Friction of contacts takes ``friction`` and ``smoothing`` (m/s), and may take ``static_friction`` with
    ``stribeck`` (m/s), and ``viscous_friction`` (s/m).
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
        """Add friction to a joint's coordinate.

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
        static, stribeck : scalar, optional
            Friction at the onset of sliding, and the velocity over which it falls to Coulomb's.
        smoothing : scalar, optional
            Velocity v0 of the regularisation tanh(v / v0); needed with ``coulomb``.
        """
        if isinstance(viscous, int | float) and viscous == 0 and coulomb is not None:
            viscous = None
        self._force(
            "friction",
            name,
            joint=self._joint(joint),
            viscous=viscous,
            coulomb=coulomb,
            static=static,
            stribeck=stribeck,
            smoothing=smoothing,
        )

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
        formula: str | None = None,
    ) -> None:
        """Add limit stops to a joint's coordinate: below ``lower``, above ``upper`` or both (rad or m)."""
        self._force(
            "stop",
            name,
            joint=self._joint(joint),
            stiffness=stiffness,
            lower=lower,
            upper=upper,
            exponent=exponent,
            dissipation=dissipation,
            restitution=restitution,
            velocity=velocity,
            formula=formula,
        )

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
        formula: str | None = None,
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of a point at ``b`` with the plane of ``a``, whose z axis points out of the solid."""
        self._force(
            "point_plane",
            name,
            between=self._pair(a, b),
            stiffness=stiffness,
            exponent=exponent,
            dissipation=dissipation,
            restitution=restitution,
            velocity=velocity,
            formula=formula,
            friction=friction,
            static_friction=static_friction,
            stribeck=stribeck,
            viscous_friction=viscous_friction if friction is not None or viscous_friction != 0 else None,
            smoothing=smoothing,
        )

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
        formula: str | None = None,
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of a sphere about ``b`` with the plane of ``a``, whose z axis points out of the solid."""
        self._force(
            "sphere_plane",
            name,
            between=self._pair(a, b),
            radius=radius,
            stiffness=stiffness,
            exponent=exponent,
            dissipation=dissipation,
            restitution=restitution,
            velocity=velocity,
            formula=formula,
            friction=friction,
            static_friction=static_friction,
            stribeck=stribeck,
            viscous_friction=viscous_friction if friction is not None or viscous_friction != 0 else None,
            smoothing=smoothing,
        )

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
        formula: str | None = None,
        friction: Value = None,
        static_friction: Value = None,
        stribeck: Value = None,
        viscous_friction: Value = 0,
        smoothing: Value = None,
    ) -> None:
        """Add contact of two spheres about ``a`` and ``b``."""
        self._force(
            "sphere_sphere",
            name,
            between=self._pair(a, b),
            radii=radii,
            stiffness=stiffness,
            exponent=exponent,
            dissipation=dissipation,
            restitution=restitution,
            velocity=velocity,
            formula=formula,
            friction=friction,
            static_friction=static_friction,
            stribeck=stribeck,
            viscous_friction=viscous_friction if friction is not None or viscous_friction != 0 else None,
            smoothing=smoothing,
        )
