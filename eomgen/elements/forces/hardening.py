"""Springs that harden."""

from __future__ import annotations

from typing import ClassVar

from ...base.value_rules import POSITIVE
from ...expr.core import Expr
from ..dimensions import STIFFNESS
from ..element_type import element, key, table
from ..glyphs import COIL, SPIRAL, Glyph
from ..kinds import Scalar
from .force import View
from .paths import LINE, PathForce


class HardeningSpring(PathForce):
    """Force -k s - k3 s^3 of the distance s."""

    sentence: ClassVar[str] = "A spring that hardens by the third power of its length."
    formula: ClassVar[str] = r"F = -k s - k_3 s^3"
    stiffness: Expr = key(Scalar("stiffness (N/m)", required=True, dimension=STIFFNESS, allowed=POSITIVE))
    hardening: Expr = key(Scalar("stiffness per squared length (N/m^3)", default=0))

    def push(self, value: Expr, rate: Expr) -> Expr:
        return -self.stiffness * value - self.hardening * value**3

    def potential(self, view: View) -> Expr | None:
        s, _ = self.path.measure(view)
        return 0.5 * self.stiffness * s**2 + 0.25 * self.hardening * s**4

    def glyphs(self) -> list[Glyph]:
        return [self.path.glyphs(COIL, SPIRAL)]


TYPES = table(element(HardeningSpring, "hardening_spring", "a spring that hardens.", LINE))
