"""Source: the text of a Python module -> the module, compiled in memory.

No bytecode is read or written beside it: a damaged or foreign file of bytecode would run unchecked.  Nor is the module
entered among those of Python, where it would stay for good: it goes with its last user.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any
from weakref import WeakValueDictionary

_loaded: WeakValueDictionary[str, ModuleType] = WeakValueDictionary()


class _Text(importlib.abc.SourceLoader):
    def __init__(self, path: str, data: bytes) -> None:
        self.path, self.data = path, data

    def get_filename(self, fullname: str) -> str:
        return self.path

    def get_data(self, path: Any) -> bytes:
        return self.data


def load_source(name: str, path: str, data: bytes, given: Mapping[str, Any] | None = None) -> ModuleType:
    """Make a module from its text.

    Parameters
    ----------
    name : str
        Of the module; relative imports go by it.
    path : str
        What ``__file__`` says; not read.
    data : bytes
        The text.
    given : mapping, optional
        What the module knows before it runs.
    """
    loader = _Text(path, data)
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    vars(module).update(given or {})
    loader.exec_module(module)
    if not given:  # given other things, it is another module
        _loaded[name] = module
    return module


def find_module(name: str) -> ModuleType | None:
    """A module that is loaded, here or by Python's import; None if there is none."""
    return _loaded.get(name) or sys.modules.get(name)
