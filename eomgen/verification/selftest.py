"""Stage verification, selftest: an exported package -> a table of its checks on the screen, and an exit code."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .verify import verify

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

BREACH = 5  #: exit code of a verification that failed
USAGE = 2  #: and of a wrong call


def main(module: BoundModel) -> None:
    """Print the verification of a module, and leave with 0 or 5."""
    if sys.argv[1:]:
        print(f"unknown argument {sys.argv[1]!r}: the selftest takes none", file=sys.stderr)
        sys.exit(USAGE)
    found = verify(module)
    print(found)
    sys.exit(0 if found.ok else BREACH)
