"""What a user gives as the name of a file or folder -> Path."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ..errors import bad_file, ill_typed
from ..texts import shown


def as_path(what: str, given: Any) -> Path:
    """A path of a text or path.

    Raises
    ------
    UsageError
        It is something else (bytes too), empty, or holds what no name can: a NUL, half of a surrogate pair.
    """
    return Path(as_name(what, given))


def as_name(what: str, given: Any) -> str:
    """The same as text, as it was written.

    Raises
    ------
    UsageError
    """
    name = usable_name(given)
    if name is None:
        raise ill_typed(f"{what} must be the name of a file or folder, as text or Path, not {shown(given)}")
    return name


def usable_name(given: Any) -> str | None:
    """The text of a path; None where it is none."""
    try:
        name = os.fspath(given)
        usable = isinstance(name, str) and name and b"\0" not in os.fsencode(name)
    except Exception:  # of an object's own __fspath__ too
        return None
    return name if usable else None


def beside(file: str, name: str) -> str:
    """The path of a file that another names: in the folder of that one, or below.

    Raises
    ------
    UsageError
        It lies outside that folder.
    """
    folder = os.path.realpath(os.path.dirname(os.path.abspath(file)))
    path = os.path.realpath(os.path.join(folder, name))
    if os.path.isabs(name) or os.path.commonpath((folder, path)) != folder:
        raise bad_file(
            f"{name} lies outside the folder of the model file; a model file can name only files in its own folder"
        )
    return path
