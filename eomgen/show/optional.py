"""Stage show, optional libraries: matplotlib, k3d and ipywidgets, imported where something is drawn."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import MissingDependencyError

K3D = (3, 2)  #: first version whose snapshots need no network


def matplotlib(part: str, purpose: str) -> Any:
    """A module of matplotlib.

    Raises
    ------
    MissingDependencyError
    """
    return _load(f"matplotlib.{part}", "matplotlib", purpose)


def k3d(purpose: str) -> Any:
    """k3d, of a version that writes pages which need no network.

    Raises
    ------
    MissingDependencyError
    """
    found = _load("k3d", "k3d>=3.2", purpose)
    version = tuple(int(x) for x in str(found.__version__).split(".")[:2] if x.isdigit())
    if version < K3D:
        raise MissingDependencyError(
            f'{purpose} needs k3d 3.2 or later, not {found.__version__}: pip install "k3d>=3.2"'
        )
    return found


def ipywidgets(purpose: str) -> Any:
    """Sliders and buttons of notebooks.

    Raises
    ------
    MissingDependencyError
    """
    return _load("ipywidgets", "ipywidgets>=8.1", purpose)


def _load(module: str, package: str, purpose: str) -> Any:
    top = module.partition(".")[0]
    try:
        return import_module(module)
    except ImportError as error:
        if error.name is not None and error.name.partition(".")[0] != top:
            raise  # the library is there and something it needs is not
        raise MissingDependencyError(f'{purpose} needs {top}: pip install "{package}"') from error
