"""All deliberate faults, each with the test that notices it."""

from __future__ import annotations

from mutations import c_drivers, c_steppers, derivation, elements, emitters, numerics, reading, runtime, written

FAULTS = (
    *derivation.FAULTS,
    *reading.FAULTS,
    *elements.FAULTS,
    *numerics.FAULTS,
    *emitters.FAULTS,
    *c_drivers.FAULTS,
    *c_steppers.FAULTS,
    *runtime.FAULTS,
    *written.FAULTS,
)
