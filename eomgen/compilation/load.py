"""Loading: a compiled extension -> its core module."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
import threading
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base.files import require_trusted
from ..errors import ToolchainError, bad_cache
from .build import Artifact
from .cache import Cache

_lock = threading.Lock()


def load_core(artifact: Artifact) -> ModuleType:
    """Import a built extension from its file.

    The module is named after the model and the key of the build, so different models, and different builds of one
    model, live side by side; loading one build again returns the same module.

    Parameters
    ----------
    artifact : Artifact
        From :func:`eomgen.compilation.compile_sources`.

    Returns
    -------
    module
        The core, with ``metadata``, ``names``, ``context``, ``timed``, ``state``, ``motion``, ``address``, ``capsule``.

    Raises
    ------
    ToolchainError
        If the file cannot be loaded.
    """
    # The last part of the name decides which initialiser Python looks for in the file.
    name = f"eomgen_models.{artifact.name}_{artifact.key[:16]}._core"
    with _lock:
        if name in sys.modules:
            return sys.modules[name]
        loader = importlib.machinery.ExtensionFileLoader(name, str(artifact.path))
        spec = importlib.util.spec_from_file_location(name, artifact.path, loader=loader)
        assert spec is not None
        try:
            require_trusted(artifact.path)
            module = importlib.util.module_from_spec(spec)
            loader.exec_module(module)
        except ToolchainError:
            raise
        except Exception as error:  # of the loader, or of the first lines of the module
            Cache(artifact.directory.parents[1]).discard(artifact.key)
            raise bad_cache(
                f"the compiled model {artifact.path} cannot be loaded: {error}. It was removed from the cache; compile "
                "the model again, and use another compiler (CC) if this happens again"
            ) from error
        offer_late(module, artifact.path)
        sys.modules[name] = module
        return module


def offer_late(core: Any, file: Path) -> None:
    """Let a core from the cache have its lanes, ensembles and rigid contacts when they are first needed."""

    def find() -> int:
        from .late_lanes import find_lanes  # rarely needed

        return find_lanes(file)

    def find_late(name: str) -> Any:
        from .late_classes import find_class  # rarely needed

        return find_class(core, file, name)

    core.offer_lanes(find)
    core.__getattr__ = find_late
