"""From a model to its compiled functions, in stages; the output of each is the input of the next.

Every stage is a package whose functions take and return frozen values; this file alone knows their order, and none of
the targets, which are rows of :data:`~.toolchain.targets.TARGETS`.

Stages
------
1. Description: what a user says -> Mechanism.  All faults are reported together, at their places.
2. Kinematics: Mechanism -> Kinematics, Mobility.  Tree, loops, constraints, degrees of freedom.
3. Equations: Kinematics -> TreeEquations, by one of the methods.  The three are a Derivation.
4. Program: Derivation -> Program.  Which functions to generate, of which inputs; values that depend on parameters alone
   are computed once.
5. Code: Program -> Core.  A target writes the functions in its language, compiles and loads them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from . import __version__
from .errors import EomgenError, cannot
from .expr.without_gc import timed, without_gc
from .reading.derivation import Derivation, Derived, derive_mechanism
from .runtime.argument_checks import read_names
from .toolchain.targets import TARGETS, find_function, find_target

if TYPE_CHECKING:
    from .codegen.program import Program
    from .model.model import Builder
    from .runtime.protocols import Core


def derive(
    kind: type[Derived],
    model: Builder,
    method: str = "auto",
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
) -> Derived:
    """Stages 1 to 3, Model -> this type of Derivation; see :meth:`eomgen.api.model.Model.derive`."""
    start = perf_counter()
    with without_gc(), np.errstate(all="ignore"):
        mechanism = model.mechanism()
    return derive_mechanism(kind, mechanism, method, independent, baumgarte, perf_counter() - start)


@without_gc()
@np.errstate(all="ignore")
def build(equations: Derivation, target: str = "cython", kernels: Sequence[str] | None = None) -> Program:
    """Stage 4, Derivation -> Program: the functions to generate for a target."""
    from .codegen.build import program_of
    from .model.mechanism import model_digest

    row = find_target(target)
    kernels = read_names("kernels", kernels or ())
    kinematics, mobility, tree = equations.fresh()
    made = {"target": target, "model_digest": model_digest(kinematics.mechanism), "eomgen": __version__}
    return program_of(kinematics, mobility, tree, made, row.arrays, kernels or row.kernels or None)


@np.errstate(all="ignore")
def compile_core(
    equations: Derivation, target: str = "cython", kernels: Sequence[str] | None = None, **options: Any
) -> Core:
    """Stages 4 and 5, Derivation -> Core; see :meth:`eomgen.api.equations.Equations.compile`."""
    from .base.kernel_table import KERNELS
    from .runtime.kernels import LazyCore

    row = find_target(target)
    if not row.load:
        modules = " or ".join(name for name, other in TARGETS.items() if other.load)
        about = f"target {target!r} makes a {row.about}, not a Python module"
        raise cannot(f"{about}; use generate, or target {modules}")

    def load(program: Program, seconds: dict[str, float]) -> Core:
        functions = equations.kinematics.graph.functions
        return cast("Core", find_function(row.load)(program, options, seconds, functions))

    def load_lazy(group: str) -> Core:
        return load(build(equations, target, [name for name, of in lazy.items() if of == group]), {})

    if kernels is not None:
        return load(build(equations, target, kernels), {})
    with timed(equations.seconds, "program"):
        program = build(equations, target, [k.name for k in KERNELS if not k.lazy])
    core = load(program, equations.seconds)
    lazy = {k.name: str(k.lazy) for k in KERNELS if k.lazy and 0 not in k.shape(program.sizes)}
    return LazyCore(core, list(lazy), load_lazy)


def make_functions(equations: Derivation, target: str, **options: Any) -> Any:
    """Stages 4 and 5, Derivation -> functions for another library or a device, as a module made in this process."""
    return find_function(find_target(target).functions)(with_start(equations, build(equations, target)), **options)


def with_start(equations: Derivation, program: Program) -> Program:
    """The program with the state in which the model starts, for libraries of functions, which assemble none."""
    from .runtime.bound_model import BoundModel

    try:
        start = BoundModel(compile_core(equations, "numpy")).x0()
    except EomgenError:  # functions that are in C alone, or no such state
        return program
    return replace(program, metadata={**program.metadata, "start": [float(x) for x in start]})
