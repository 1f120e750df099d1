"""All deliberate faults, each with the test that notices it."""

from __future__ import annotations

from mutations import c_code, derivation, elements, emitters, numerics, runtime

FAULTS = (
    *derivation.FAULTS,
    *elements.FAULTS,
    *numerics.FAULTS,
    *emitters.FAULTS,
    *c_code.FAULTS,
    *runtime.FAULTS,
)
