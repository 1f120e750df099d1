"""One deliberate fault: what is changed where, and which test notices it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]


class Fault(NamedTuple):
    """A change of the sources that makes results wrong.

    ``old`` occurs exactly once in ``file`` and becomes ``new``.  ``caught_by`` names the tests of which at least one
    must fail then: pytest node ids, files among them.
    """

    id: str
    file: str  #: below the root of the repository
    old: str
    new: str
    breaks: str  #: what is wrong then, in words
    caught_by: tuple[str, ...]

    def apply(self, root: Path) -> None:
        """Put the fault into a copy of the repository.

        Raises
        ------
        ValueError
            The text does not occur exactly once.
        """
        path = root / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.id}: {self.old!r} occurs {text.count(self.old)} times in {self.file}, not once")
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")
