"""What several tests of SymPy's systems share: forming the bicycle takes SymPy seconds."""

from __future__ import annotations

import pytest
from sympy_systems import bicycle, bicycle_numbers

import eomgen as eg


@pytest.fixture(scope="package")
def whipple() -> eg.Model:
    """The Whipple bicycle of SymPy's own test."""
    return eg.from_sympy(bicycle(), "bicycle", parameters=bicycle_numbers())
