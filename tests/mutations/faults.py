"""All deliberate faults, each with the test that notices it."""

from __future__ import annotations

from mutations import c_code, derivation, elements, numerics

FAULTS = (*derivation.FAULTS, *elements.FAULTS, *numerics.FAULTS, *c_code.FAULTS)
