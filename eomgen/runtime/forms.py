"""Stage runtime: other forms of the equations of a Module: canonical, and differential-algebraic."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from .canonical import Canonical
    from .dae import Dae
    from .module import Module


class Forms:
    """Part of :class:`~.module.Module`: forms with other unknowns than x, each made when it is first asked for."""

    @cached_property
    def canonical(self) -> Canonical:
        """Hamilton's equations on [q; p], of a model derived by ``hamilton``; see :class:`~.canonical.Canonical`."""
        from .canonical import Canonical

        return Canonical(cast("Module", self))

    @cached_property
    def dae(self) -> Dae:
        """F(t, y, y') = 0 with multipliers, for differential-algebraic solvers; see :class:`~.dae.Dae`."""
        from .analyses import require_velocities
        from .dae import Dae

        require_velocities(cast("Module", self).layout)
        return Dae(cast("Module", self))
