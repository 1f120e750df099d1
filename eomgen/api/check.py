"""Model -> all that can be wrong with it before code is generated, and what is noted about it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import AssemblyError, EomgenError, ModelError, UsageError
from ..mechanics.methods.positive import note_lost_digits, require_inertia
from ..mechanics.report import MechanismReport, other_branches, report
from ..pipeline import compile_core, derive
from ..reading.derivation import Derivation
from ..runtime.bound_model import BoundModel

if TYPE_CHECKING:
    from ..model.model import Builder

#: Functions that the assembly of a state calls, and those for values of outputs and markers.
OF_STARTS = (
    *("constraints", "constraint_jacobian", "coordinate_slopes", "velocity_constraints", "alignment"),
    *("loop_coordinates", "loop_coordinate_jacobian", "poses", "scales"),
)
OF_OUTPUTS = ("motion_outputs", "output_derivatives", "inertial_terms")


@np.errstate(all="ignore")
def check(model: Builder) -> MechanismReport:
    """Everything that can be wrong with a model before code is generated."""
    equations = derive(Derivation, model)
    equations.kinematics.mechanism.require_values()
    unbalanced = require_inertia(equations.kinematics, equations.mobility, equations.tree)
    result = report(equations.kinematics, equations.mobility)
    note = note_lost_digits(equations.kinematics, equations.mobility, equations.tree)
    if unbalanced:
        note = f"kinematics only (no masses, so no equations of motion): {unbalanced}"
    notes = [*result.notes, *([note] if note else []), *_assemble_start(equations)]
    return replace(result, notes=notes, other_branches=other_branches(equations.kinematics, equations.mobility))


def _assemble_start(equations: Derivation) -> list[str]:
    """Find the state in which a run starts, as a run does, where it is more than the position found already.

    Returns notes on what was not looked at.

    Raises
    ------
    ModelError, AssemblyError
        The initial values that a run would refuse, at their place.
    """
    mechanism = equations.kinematics.mechanism
    known = {*equations.kinematics.names, *equations.kinematics.loop_coordinates.names}
    rates = [
        name for name in mechanism.defaults.initial if name not in known
    ]  # which contradict nothing in an open tree
    more = [*mechanism.defaults.initial_outputs, *(rates if equations.kinematics.constraints.labels else ())]
    if not more and not equations.mobility.driven:
        return []
    try:
        wanted = [*OF_STARTS, *(OF_OUTPUTS if mechanism.defaults.initial_outputs else ())]
        module = BoundModel(compile_core(equations, "numpy", wanted))
    except EomgenError as error:
        first_line = str(error).splitlines()[0]
        return [f"the initial values of {', '.join(more) or 'driven velocities'} are not checked here: {first_line}"]
    try:
        module.x0()
    except (AssemblyError, UsageError) as error:
        named = next((name for name in more if name in str(error)), more[0] if more else "")
        problem = mechanism.problem(f"initial.{named}" if named else "initial", str(error), code=error.code)
        if isinstance(error, AssemblyError):
            raise AssemblyError(str(problem), error.rows, error.code) from None
        raise ModelError([problem]) from None
    return []
