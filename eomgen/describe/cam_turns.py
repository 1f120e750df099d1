"""Stage describe, checks of cams: profiles that repeat every turn go on where they began, in value and slope."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

from ..constraints import Constraint
from ..constraints.profiles import Profile
from ..errors import ModelError
from ..graph.substitute import symbols_of
from .description import Faults

REMEDY = (
    "make value and slope at 2 pi equal to those at 0, with pieces or a table of kind periodic; give periodic: false "
    "for a cam that stays within one turn"
)


def check_turns(constraints: Sequence[Constraint], values: Mapping[str, float], faults: Faults) -> None:
    """Note periodic profiles that jump where a turn ends, as far as the declared values of parameters tell."""
    for constraint in constraints:
        for field in fields(constraint):
            profile = getattr(constraint, field.name)
            if not isinstance(profile, Profile) or not profile.periodic:
                continue
            names = symbols_of([profile.expression]) - symbols_of([profile.local])
            if not names <= values.keys():
                continue
            try:
                gap = profile.gap(values)
            except ModelError:  # native code without a twin in Python
                continue
            if gap is not None:
                what, first, last = gap
                message = f"does not close after a turn: its {what} is {first:.6g} at theta = 0 and {last:.6g} at 2 pi"
                at = " at the declared values" if names else ""
                faults.add(f"constraints.{constraint.name}.{field.name}", message + at, REMEDY)
