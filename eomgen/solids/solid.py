"""Stage describe, solids: what a type of solid must answer, in its own axes and from its own reference point.

Formulas after Bauchau, *Flexible Multibody Dynamics* (2011), app. A, and any table of mass moments of inertia; tests
integrate the density over each solid instead.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from ..elements.kinds import Fields
from ..graph import vectors as vec
from ..graph.core import Expr, Graph
from ..graph.vectors import Vec3
from ..records import dataclass


@dataclass(frozen=True)
class Solid(ABC):
    """A solid of uniform density.

    Attributes
    ----------
    lengths : mapping of str to Vec3
        Dimensions (m); a single one is repeated three times.
    """

    lengths: Mapping[str, Vec3]

    type_name: ClassVar[str]
    dimensions: ClassVar[Fields]  #: its keys
    has_axis: ClassVar[bool] = False  #: whether z of its own axes can be laid along an ``axis``
    content_key: ClassVar[str] = "density"  #: the key that gives the mass through :meth:`content`

    def length(self, name: str) -> Expr:
        """A dimension that is one length."""
        return self.lengths[name][0]

    @property
    def graph(self) -> Graph:
        """The graph of the dimensions."""
        return next(iter(self.lengths.values()))[0].graph

    @abstractmethod
    def content(self) -> Expr:
        """What the density is multiplied with: the volume (m^3), of a rod its length (m)."""

    @abstractmethod
    def gyration(self) -> Vec3:
        """Principal moments about the centre of mass in the solid's own axes, for each kg (m^2)."""

    def centre(self) -> Vec3:
        """Centre of mass from the solid's reference point, in its own axes (m)."""
        return vec.zero(self.graph)
