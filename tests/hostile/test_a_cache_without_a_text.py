"""A cache whose folder's name is no text in this locale: everything is built there, the Cython layer too."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from eomgen.compilation.commands import Running
from eomgen.compilation.cython_layer import _run_cython


@pytest.mark.parametrize("name", [b"\xff\xe4", b"a\xff 'b\""])
def test_cython_translates_in_any_folder(tmp_path: Path, name: bytes) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name))
    folder.mkdir()
    source = folder / "_core.pyx"
    source.write_text("def f(double x):\n    return 2.0 * x\n", encoding="ascii")
    _run_cython(source, Running())
    assert (folder / "_core.c").stat().st_size > 1000
