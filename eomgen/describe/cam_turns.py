"""Stage describe, checks of cams: profiles that repeat every turn go on where they began, in value and slope."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from ..base.value_rules import TURN
from ..constraints import Constraint
from ..constraints.profiles import Profile
from ..errors import ModelError
from ..graph.substitute import symbols_of
from .requirements import Requirements


def check_turns(constraints: Sequence[Constraint], requirements: Requirements) -> None:
    """Note periodic profiles that jump where a turn ends, as far as the values of parameters tell."""
    for constraint in constraints:
        for field in fields(constraint):
            profile = getattr(constraint, field.name)
            turn = profile.over_a_turn() if isinstance(profile, Profile) else None
            if turn is None:
                continue
            laws, angle = turn
            where = " at the declared values" if symbols_of(laws) - {angle} else ""
            try:
                requirements.judge(f"constraints.{constraint.name}.{field.name}", TURN, laws, (), [angle], where)
            except ModelError:  # native code without a twin in Python
                continue
