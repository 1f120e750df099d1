"""A pytest plugin for runs with a fault.

The Cython layer, which takes half a minute to compile, is shared between the runs of one list, and Hypothesis does not
look for a simpler example once it has found one.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from hypothesis import Phase, settings


def _entries(cache: Path) -> list[Path]:
    from eomgen.compilation import Cache

    return [entry.directory for entry in Cache(cache).entries() if entry.kind == "layer"]


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutations", settings.get_profile("eomgen"), phases=phases, database=None)
    settings.load_profile("mutations")
    shared, own = Path(os.environ["EOMGEN_MUTATION_LAYERS"]), Path(os.environ["EOMGEN_CACHE_DIR"])
    if (shared / "entries").is_dir():
        (own / "entries").mkdir(parents=True, exist_ok=True, mode=0o700)
        own.chmod(0o700)
        for entry in _entries(shared):
            shutil.copytree(entry, own / "entries" / entry.name, dirs_exist_ok=True)


@pytest.hookimpl(tryfirst=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    if os.environ.get("EOMGEN_MUTATION_KEEP"):
        shared, own = Path(os.environ["EOMGEN_MUTATION_LAYERS"]), Path(os.environ["EOMGEN_CACHE_DIR"])
        if own.is_dir():
            (shared / "entries").mkdir(parents=True, exist_ok=True, mode=0o700)
            shared.chmod(0o700)
            for entry in _entries(own):
                shutil.copytree(entry, shared / "entries" / entry.name, dirs_exist_ok=True)
