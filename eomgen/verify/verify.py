"""A module, or a model and its module -> everything that was compared, in one table.

The order is: what the module says of itself; then, where the equations it was made from are there, the graph, the free
bodies, constraints, derivatives and runs; then what concerns the model as it was described.
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ..base.limits.numbers import EPS
from ..base.limits.runs import MOST_STATES
from ..base.texts import quote
from ..base.value_rules import read_count
from ..errors import EomgenError, off_range
from ..runtime.runs.events import inner_run
from .finding import Finding, Verification, failed
from .identities import identities, jacobians
from .random_states import random_states

if TYPE_CHECKING:
    from ..reading.derivation import Derivation
    from ..runtime.bound_model import BoundModel
    from .random_states import SystemState

STATES = 6  #: random states
SECONDS, LEAST = 12.0, 2.0  #: for all of it, and for variants of a model at least


def verify(module: BoundModel, /, *, states: int = STATES, seed: int = 0, seconds: float = SECONDS) -> Verification:
    """Compare this module with several independent calculations.

    Parameters
    ----------
    states : int
        Number of random states on the constraints, near the declared initial position.
    seed : int
        Of the states.
    seconds : float
        Time for all checks.  Variants (the same mechanism described differently) get the time that is left, and at
        least 2 s; variants for which no time is left are counted.

    Returns
    -------
    Verification
        ``ok``, ``table``, ``findings``, ``breaches``; printed, it is a table of the worst figures, their limits and
        where they are.

    Raises
    ------
    AssemblyError
        The loops do not close at the declared initial values.
    MissingDependencyError
        mpmath or SciPy is not installed.
    UsageError
        ``states``, ``seed`` or ``seconds`` is not a valid number.

    Notes
    -----
    A module that was compiled here is compared with its graph, with the graph in 50 digits, with Newton's and
    Euler's equations of every body, with SciPy and with variants of its mechanism.  One of an exported package is
    compared with itself, and by ``python -m NAME.selftest`` with what was recorded when it was generated.
    """
    states, seed = _read(states, seed, seconds)
    start = perf_counter()
    with inner_run():
        result = _of_module(module, states, seed, start + seconds)
    return Verification(module.name, tuple(result), perf_counter() - start)


def _read(states: object, seed: object, seconds: object) -> tuple[int, int]:
    """The number of states and the seed; what is none, or no time, is refused."""
    if (
        isinstance(seconds, bool)
        or not isinstance(seconds, int | float | np.integer | np.floating)
        or not seconds >= 0.0
    ):
        raise off_range(f"verify: seconds must be the time for all checks, a number of 0 or more, not {quote(seconds)}")
    most = read_count("verify: states, the number of random states,", states, 1, MOST_STATES)
    return most, read_count("verify: seed, of the random states,", seed)


def _of_module(module: BoundModel, states: int, seed: int, end: float) -> list[Finding]:
    if not module.n_x:
        return _of_fixed_bodies(module)
    random = random_states(module, states, seed)
    result = identities(module, random)
    equations = getattr(module, "equations", None)
    if equations is None:
        result += jacobians(module, random)
        why = "they need the equations, and a package does not contain them: verify the model that it was made from"
        result.append(Finding.skipped("graph, free bodies, derivatives, runs, variants", why))
    else:
        result += _with_equations(module, equations, random, seed, end)
    return result


def _of_fixed_bodies(module: BoundModel) -> list[Finding]:
    R = module.poses(np.empty(0))[:, :3, :3]
    worst = float(np.abs(R @ np.moveaxis(R, 1, 2) - np.eye(3)).max(initial=0.0))
    why = "the model has no coordinate: its bodies are fixed to ground"
    return [
        Finding("poses: rotation matrices are orthonormal", worst, 16.0 * EPS, states_compared=1),
        Finding.skipped("all that moves", why),
    ]


def _only_in_c(equations: Derivation | None) -> str:
    """Why nothing but the compiled module can evaluate some equations; empty where Python can."""
    functions = equations.kinematics.graph.functions.values() if equations is not None else ()
    blind = [function.name for function in functions if function.evaluator is None]
    return f"{', '.join(blind)} is C code without a Python version, so nothing else can evaluate it" if blind else ""


def _with_equations(
    module: BoundModel, equations: Derivation, random: list[SystemState], seed: int, end: float
) -> list[Finding]:
    """All groups, and variants until a time; one that cannot be carried out fails."""
    why = _only_in_c(equations)
    if why:
        return [Finding.skipped("graph, free bodies, derivatives, runs, variants", why)]
    from ..mechanics.methods.positive import FREE, note_lost_digits, smallest_share
    from . import check_bodies as b
    from . import check_kernels as k
    from .check_runs import check_runs
    from .checked import CheckedModel

    model, result = CheckedModel(module, equations, random), []
    parts = equations.kinematics, equations.mobility, equations.tree
    massless = module.info.no_inertia
    if massless:
        why = f"the model is for kinematics only: {massless}"
        result.append(Finding.skipped("bodies, joints, reactions, derivatives, runs, variants", why))
    elif equations.method not in FREE and (note := note_lost_digits(*parts)):
        share = smallest_share(*parts)
        result.append(Finding("accelerations: what rounding leaves open", EPS / max(share, EPS), 1.0, note=note))
    groups = [k.check_kernels, b.check_bodies, b.check_joints, b.check_reactions, b.check_reaction_laws]
    groups += [k.check_constraints, k.check_derivatives, check_runs]
    for check in [k.check_kernels, k.check_constraints] if massless else groups:
        try:
            result += check(model)
        except (EomgenError, ArithmeticError) as error:
            result.append(failed(f"checks of {check.__name__.removeprefix('check_')}", error))
    if not massless:
        from .variants import variant_findings

        result += variant_findings(model, max(LEAST, end - perf_counter()), seed)
    return result
