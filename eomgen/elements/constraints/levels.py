"""Markers that stay at a height."""

from __future__ import annotations

from typing import ClassVar

from ...expr.core import Expr
from ..dimensions import LENGTH
from ..element_type import element, key, table
from ..frames import Marker
from ..glyphs import CROSS, Drawn, Glyph
from ..kinds import MarkerReference, Scalar
from .constraint import Condition, Constraint, ConstraintView


class Level(Constraint):
    """A marker stays at a height over ground."""

    sentence: ClassVar[str] = "The marker stays at the height $h$."
    formula: ClassVar[str] = r"z = h"
    marker: Marker = key(MarkerReference("marker that stays at the height", required=True))
    height: Expr = key(Scalar("height (m)", default=0, dimension=LENGTH))

    def glyphs(self) -> list[Glyph]:
        return [Drawn((self.marker,), about=CROSS)]

    def conditions(self, view: ConstraintView) -> list[Condition]:
        return [Condition("height", view.position(self.marker)[2] - self.height, "length")]


TYPES = table(element(Level, "level", "a marker that stays at a height."))
