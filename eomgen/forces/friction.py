"""Force elements, dry friction: regularised laws of a sliding velocity, and friction of a joint."""

from __future__ import annotations

from typing import ClassVar

from ..graph.core import Expr
from ..records import dataclass
from .base import Force, Load, View
from .paths import Path


@dataclass(frozen=True)
class Friction:
    """Coulomb and Stribeck friction; what multiplies the direction of sliding, opposed to it.

    ``dynamic``, ``static`` and ``viscous`` are forces for a joint and parts of the normal force for a contact.

        c(v) = dynamic + (static - dynamic) exp(-(v / stribeck)^2)

    after Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.  ``static`` None
    means dynamic.  At rest friction is 0: a body on a slope creeps, at a part of the velocity ``smoothing``.
    """

    dynamic: Expr
    smoothing: Expr
    viscous: Expr
    static: Expr | None = None
    stribeck: Expr | None = None

    def level(self, squared: Expr) -> Expr:
        """c of the squared sliding velocity."""
        if self.static is None or self.stribeck is None:
            return self.dynamic
        fall = squared.graph.apply("exp", -squared / (self.stribeck * self.stribeck))
        return self.dynamic + (self.static - self.dynamic) * fall

    def along(self, rate: Expr) -> Expr:
        """c tanh(v / smoothing) + viscous v of a velocity along a line."""
        direction = rate.graph.apply("tanh", rate / self.smoothing)
        return self.level(rate * rate) * direction + self.viscous * rate

    def per_velocity(self, squared: Expr) -> Expr:
        """c / sqrt(v^2 + smoothing^2) + viscous: times the velocity in a plane it is the friction; smooth at rest."""
        size = squared.graph.apply("sqrt", squared + self.smoothing * self.smoothing)
        return self.level(squared) / size + self.viscous


@dataclass(frozen=True)
class JointFriction(Force):
    """Friction -[c(v) tanh(v / smoothing) + viscous v] on a joint's coordinate of rate v (N or N m).

    The tanh is the regularisation of Andersson, Soderberg and Bjorklund (2007), Tribol. Int. 40, 580-587.  It does not
    depend on the joint's reactions, unless the coefficients are given so.
    """

    type_name: ClassVar[str] = "friction"
    path: Path
    law: Friction

    def loads(self, view: View) -> list[Load]:
        _, rate = self.path.measure(view)
        return self.path.loads(view, -self.law.along(rate))
