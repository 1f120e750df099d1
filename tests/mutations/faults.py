"""All deliberate faults, each with the test that notices it."""

from __future__ import annotations

from mutations import derivation, elements

FAULTS = (*derivation.FAULTS, *elements.FAULTS)
