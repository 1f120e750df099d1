"""What a user gives as the name of a file or folder -> Path."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ..errors import UsageError


def as_path(what: str, given: Any) -> Path:
    """A path of a text or path.

    Raises
    ------
    UsageError
        It is something else, empty, or holds a NUL, which no name can.
    """
    try:
        path = os.fspath(given)
        os.fsencode(path)
    except (TypeError, UnicodeEncodeError):
        path = b""
    if not isinstance(path, str) or not path or "\0" in path:
        raise UsageError(f"{what} must be the name of a file or folder, as text or Path, not {given!r:.80}")
    return Path(path)
