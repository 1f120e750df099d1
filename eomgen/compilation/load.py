"""Loading: a compiled model -> its core."""

from __future__ import annotations

import ctypes
from functools import partial
from pathlib import Path
from typing import Any

from ..base.files import find_module, keep_module, require_trusted
from ..errors import ToolchainError, bad_cache
from .build import Artifact
from .cache import Cache
from .native import find_native


def load_core(artifact: Artifact) -> Any:
    """Open a built model.

    It is named after the model and the key of the build, so different models, and different builds of one model, live
    side by side; loading one build again returns the same core.

    Parameters
    ----------
    artifact : Artifact
        From :func:`eomgen.compilation.compile_model`.

    Returns
    -------
    Model
        Of ``eomgen._native``.

    Raises
    ------
    ToolchainError
        If the file cannot be loaded.
    """
    return open_core(f"eomgen_models.{artifact.name}_{artifact.key[:16]}", artifact.path)


def open_core(name: str, file: Path) -> Any:
    """Open the library of a model in the cache, under a name of its own."""
    if (found := find_module(name)) is not None:
        return found
    native: Any = find_native()
    try:
        require_trusted(file)
        table = ctypes.CDLL(str(file)).eomgen_model_table
        table.restype = ctypes.c_void_p
        core = native.Model(table(), name, str(file), partial(_find_lanes, file))
    except ToolchainError:
        raise
    except Exception as error:  # of the loader, or a table of another layout
        Cache(file.parents[2]).discard(file.parent.name)
        raise bad_cache(
            f"the compiled model {file} cannot be loaded: {error}. It was removed from the cache; compile the model "
            "again, and use another compiler (CC) if this happens again"
        ) from error
    return keep_module(name, core)


def _find_lanes(file: Path) -> int:
    from .lanes import find_lanes  # rarely needed

    return find_lanes(file)
