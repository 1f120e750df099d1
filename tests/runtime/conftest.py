"""Modules over the hand-written NumPy models."""

import importlib.util
import sys
from pathlib import Path

import pytest

from eomgen.api.module import Module
from eomgen.runtime import NumpyCore


@pytest.fixture(scope="session")
def models():
    """The hand-written models of tests/numeric."""
    name = "eomgen_test_hand_written"
    if name not in sys.modules:
        path = Path(__file__).parents[1] / "numeric" / "hand_written.py"
        spec = importlib.util.spec_from_file_location(name, path)
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture
def crank(models):
    """``crank(copies=1, **metadata)``: the slider-crank, its first loop row `copies` times."""

    def make(copies=1, **changes):
        return Module(NumpyCore(models.crank_metadata(copies, **changes), models.crank_blocks(copies)))

    return make


@pytest.fixture
def pendulum(models):
    """The pendulum, a tree."""
    return Module(NumpyCore(models.pendulum_metadata(), models.pendulum_blocks()))
