"""The hand-written systems of tests/emit."""

import importlib.util
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def systems():
    name = "eomgen_test_emit_systems"
    if name not in sys.modules:
        path = Path(__file__).parent.parent / "emit" / "systems.py"
        spec = importlib.util.spec_from_file_location(name, path)
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[name]
