"""What is the name of a file is the same wherever one is given: text or Path, not empty, with what a name can hold."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import eomgen as eg
from eomgen.files.path_names import as_name, as_path
from eomgen.files.reading import open_plain
from eomgen.runtime import load_trajectory
from eomgen.solids.mesh import measure_mesh

PENDULUM = Path(__file__).parents[2] / "examples" / "pendulum.yaml"


class Odd(os.PathLike[str]):
    """Its path is an error."""

    def __fspath__(self) -> str:
        raise ZeroDivisionError


class Bytes(os.PathLike[bytes]):
    """Its path is of bytes."""

    def __fspath__(self) -> bytes:
        return b"a.yaml"


NONE = (b"a.yaml", bytearray(b"a.yaml"), "", None, 3, ["a.yaml"], "a\0.yaml", "\ud800.yaml", Odd(), Bytes())
DOORS: dict[str, Callable[[Any], Any]] = {
    "load": eg.load,
    "robot": lambda path: eg.load(path) if not isinstance(path, str) else eg.load(path.replace(".yaml", ".urdf")),
    "open": open_plain,
    "mesh": measure_mesh,
    "trajectory": load_trajectory,
    "save a model": lambda path: eg.load(PENDULUM).save(path),
    "save a run": lambda path: eg.load(PENDULUM).compile(target="numpy").simulate(0.01).save(path),
    "path": lambda path: as_path("path", path),
    "name": lambda path: as_name("path", path),
}


@pytest.mark.parametrize("door", DOORS)
def test_what_is_no_path_is_refused_in_the_same_words(door: str) -> None:
    for given in NONE:
        with pytest.raises(eg.UsageError, match="^path must be the name of a file or folder, as text or Path, not "):
            DOORS[door](given)


def test_texts_and_paths_are_names(tmp_path: Path) -> None:
    file = tmp_path / "a b ä.yaml"
    file.write_bytes(PENDULUM.read_bytes())
    for given in (str(file), file):
        assert eg.load(given).name == "pendulum"
        with open_plain(given) as opened:
            assert opened.read() == PENDULUM.read_bytes()
    assert as_name("path", "a/") == "a/"
    assert as_path("path", "a/") == Path("a")
