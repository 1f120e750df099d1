"""Stage describe: what every part of the builder and its handles share, the description that grows."""

from __future__ import annotations

from typing import Any

from ..errors import calling_line
from ..graph.shown import shown
from .description import DescribedEntry, Description
from .sympy_face import require_name


class Described:
    """A mechanism under description."""

    _description: Description

    @property
    def description(self) -> Description:
        """The description of the model, with the same structure as a model file."""
        return self._description

    def _add(self, section: str, name: str, values: dict[str, Any]) -> DescribedEntry:
        """Append an entry to a section, with the file and line of the call."""
        entry = self._description.add(section, require_name(section, name), values)
        self._description.lines[entry.path] = calling_line()
        return entry

    def _note_line(self, *paths: str) -> None:
        """Note the file and line of the user's call for what was said there."""
        self._description.lines.update(dict.fromkeys(paths, calling_line()))

    @property
    def name(self) -> Any:
        """Name of the model."""
        return shown(self._description.values.get("name", ""))
