"""Stage describe: what every part of the builder and its handles share, the description that grows."""

from __future__ import annotations

from typing import Any

from ..graph.shown import shown
from .description import Description


class Described:
    """A mechanism under description."""

    _description: Description

    @property
    def description(self) -> Description:
        """The description of the model, with the same structure as a model file."""
        return self._description

    @property
    def name(self) -> Any:
        """Name of the model."""
        return shown(self._description.values.get("name", ""))
