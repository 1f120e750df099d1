"""Files of another user, for tests: given away where the tests run as root, else only said to be."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from eomgen.base import files as ownership

STRANGER = 12345  #: a user id that nobody has


def give_away(path: Path, monkeypatch: pytest.MonkeyPatch, owner: int = STRANGER) -> None:
    """Make a file, folder or link belong to another user."""
    if os.geteuid() == 0:
        os.lchown(path, owner, -1)
        return
    found, judge = os.lstat(path), ownership._require_own

    def judged(place: str, status: os.stat_result, *, above: bool) -> None:
        if (status.st_dev, status.st_ino) == (found.st_dev, found.st_ino):
            status = os.stat_result((*status[:4], owner, *status[5:]))
        judge(place, status, above=above)

    monkeypatch.setattr(ownership, "_require_own", judged)
