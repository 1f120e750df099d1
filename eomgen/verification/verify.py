"""Stage verification, verify: a module, or a model and its module -> everything that was compared, in one table.

The order is: what the module says of itself; then, where the equations it was made from are there, the graph, the free
bodies, constraints, derivatives and runs; then what concerns the model as it was described.
"""

from __future__ import annotations

from importlib import import_module
from time import perf_counter
from typing import TYPE_CHECKING, Any

from ..errors import EomgenError, UsageError
from .cases import random_cases
from .comparison import failed
from .finding import Finding, Verification
from .identities import identities
from .jacobians import jacobians
from .recorded import recorded_findings

if TYPE_CHECKING:
    from ..derivation import Equations
    from ..runtime.module import Module
    from .cases import Case

STATES = 6  #: random states
LEAST = 2.0  #: seconds for variants of a model
#: Files of checks that need the equations, in the order of the table; each has ``check(bench)``.
GROUPS = ("kernels", "bodies", "joints", "reactions", "constraints", "derivatives", "runs")


def verify(module: Module, *, states: int = STATES, seed: int = 0) -> Verification:
    """Compare a module with everything that is independent of how it was made.

    Parameters
    ----------
    module : Module
    states : int
        Number of random states.
    seed : int

    Returns
    -------
    Verification

    Raises
    ------
    AssemblyError
        The loops do not close at the declared initial values.
    MissingDependencyError
        mpmath or SciPy is missing where the equations are there.
    UsageError
        ``states`` is no whole number from 1.
    """
    start = perf_counter()
    if isinstance(states, bool) or not isinstance(states, int) or states < 1:
        raise UsageError(f"verify: states is {states!r}; it is the number of random states, a whole number from 1")
    if module.metadata.get("no_inertia"):
        why = f"it is there for kinematics only: {module.metadata['no_inertia']}"
        return Verification(module.name, (Finding.skipped("all that moves by forces", why),))
    if not module.n_x:
        why = "the model has no coordinate: its bodies are fixed to ground"
        return Verification(module.name, (Finding.skipped("all that moves", why),))
    cases = random_cases(module, states, seed)
    found = identities(module, cases) + recorded_findings(module)
    equations = getattr(module, "equations", None)
    if equations is None:
        found += jacobians(module, cases)
        why = "they need the equations, which a package does not carry: verify the model that it was made from"
        found.append(Finding.skipped("graph, free bodies, derivatives, runs", why))
    else:
        found += _with_equations(module, equations, cases)
    return Verification(module.name, tuple(found), perf_counter() - start)


def verify_model(
    model: Any, module: Module, *, states: int = STATES, seed: int = 0, seconds: float = 12.0
) -> Verification:
    """:func:`verify` of a module, and what concerns the model that it was made from.

    Parameters
    ----------
    model : Model
    module : Module
    states, seed : int
    seconds : float
        Time for all of it; the same physics in other clothes has what is left, and at least :data:`LEAST`.
    """
    start = perf_counter()
    from .variants import variant_findings

    own = verify(module, states=states, seed=seed)
    if not module.n_x or module.metadata.get("no_inertia"):
        return Verification(own.name, (*own.findings, Finding.skipped("variants", own.findings[0].note)), own.seconds)
    found = (*own.findings, *variant_findings(model, seed=seed, seconds=max(LEAST, seconds - own.seconds)))
    return Verification(own.name, found, perf_counter() - start)


def _with_equations(module: Module, equations: Equations, cases: list[Case]) -> list[Finding]:
    """All groups; one that cannot be carried out fails."""
    functions = equations.kinematics.graph.functions.values()
    blind = [function.name for function in functions if function.evaluator is None]
    if blind:
        why = f"{', '.join(blind)} is C code without a Python twin, so that nothing else can evaluate it"
        return [Finding.skipped("graph, free bodies, derivatives, runs", why)]
    from .bench import Bench

    bench, found = Bench(module, equations, cases), []
    for group in GROUPS:
        check = import_module(f"{__package__}.check_{group}").check
        try:
            found += check(bench)
        except (EomgenError, ArithmeticError) as error:
            found.append(failed(f"checks of {group}", error))
    return found
