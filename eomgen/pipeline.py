"""The one road, in order: describe -> kinematics -> equations -> program -> emit -> compilation -> runtime.

Each stage is a package whose functions take frozen values and return frozen values; only this file knows their order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from . import __version__
from .alone import alone
from .base.texts import shown
from .derivation import Derivation
from .describe.dotted_names import Undotted
from .describe.sympy_face import names_of
from .equations import GIVEN, METHODS, take_given
from .equations.digits_kept import note_lost_digits
from .equations.positive import require_inertia
from .errors import (
    AssemblyError,
    EomgenError,
    ModelError,
    ToolchainError,
    UsageError,
    cannot,
    ill_typed,
    no_such,
    off_range,
)
from .kinematics import Kinematics, analyse
from .kinematics.mobility import Mobility, find_mobility
from .kinematics.other_branches import other_branches
from .kinematics.report import MechanismReport, report
from .runtime.near_names import read_names, unknown
from .targets import TARGETS, find_target

if TYPE_CHECKING:
    from .describe.builder import Builder
    from .describe.mechanism import Mechanism
    from .program.choice import Choice
    from .program.program import Program
    from .runtime.protocols import Core

Derived = TypeVar("Derived", bound=Derivation)
#: Functions that the assembly of a state calls, and those for values of outputs.
OF_STARTS = (
    *("constraints", "constraint_jacobian", "coordinate_slopes", "velocity_constraints", "alignment"),
    *("loop_coordinates", "loop_coordinate_jacobian", "poses", "scales"),
)
OF_OUTPUTS = ("motion_outputs", "output_derivatives")
OF_LAGRANGIANS = ("lagrange", "hamilton", "augmented")  #: methods that take a bare Lagrangian


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = perf_counter()
    yield
    seconds[stage] = perf_counter() - start


def choose_method(mechanism: Mechanism, method: str) -> str:
    """Resolve ``auto`` for a bare Lagrangian; refuse a method that is not there or does not fit."""
    bare = mechanism.lagrangian is not None
    if not isinstance(method, str):
        raise ill_typed(f"method must be the name of a method, not {shown(method)}")
    if mechanism.given is not None:
        if method not in ("auto", GIVEN):
            raise cannot(f"method {method!r} needs bodies; for given equations there are: auto, {GIVEN}")
        return GIVEN
    if method == "auto" and bare:
        return "lagrange"
    if method not in ("auto", *METHODS):
        raise unknown("method", method, ("auto", *METHODS))
    if bare and method not in OF_LAGRANGIANS:
        raise cannot(
            f"method {method!r} needs bodies; for a bare Lagrangian there are: auto, {', '.join(OF_LAGRANGIANS)}"
        )
    return method


def derive(
    model: Builder,
    method: str = "auto",
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
) -> Derivation:
    """Derive the equations of motion of a model.

    Parameters
    ----------
    model : Model
    method : str
        One of ``equations.METHODS``, or ``auto``: embedding or recursive, whichever has the right-hand side of fewer
        operations; lagrange of a bare Lagrangian.
    independent : names of coordinates or velocities, optional
        Independent ones of a mechanism with loops; the model's own by default.  The best conditioned others join them
        where they are fewer than the degrees of freedom.
    baumgarte : (alpha, beta), optional
        Of the augmented form (1/s): C'' + 2 alpha C' + beta^2 C = 0 holds instead of C'' = 0, and the right-hand side
        does not project its states.

    Raises
    ------
    ModelError
        Every fault of the description at once.
    AssemblyError
        The loops do not close at the declared initial values.
    UsageError
        No such method.
    """
    return derive_as(Derivation, model, method, independent, baumgarte)


@np.errstate(all="ignore")  # results are looked at, and what is not finite is refused by name
def derive_as(
    kind: type[Derived],
    model: Builder,
    method: str = "auto",
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
) -> Derived:
    """The same as a result of another type."""
    start = perf_counter()
    with alone():
        mechanism = model.mechanism()
    return derive_mechanism(kind, mechanism, method, independent, baumgarte, perf_counter() - start)


@np.errstate(all="ignore")
def derive_mechanism(
    kind: type[Derived],
    mechanism: Mechanism,
    method: str,
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
    described: float = 0.0,
) -> Derived:
    """The equations of motion of what a model says; ``described`` is the time (s) that reading it took."""
    from .program.choice import choose

    seconds = {"describe": described}
    chosen = choose_method(mechanism, method)
    with alone(), _timed(seconds, "kinematics"):
        plain = Undotted(mechanism.instances).coordinate  # leg.hip of an instance is leg_hip
        wanted = tuple(map(plain, names_of("independent", independent, "a coordinate")))
        kinematics = analyse(mechanism, wanted)
        mobility = _mobility(kinematics, wanted)
    if baumgarte is not None:
        kinematics = _stabilised(kinematics, chosen, baumgarte)
    with alone(), _timed(seconds, "equations"):
        if mechanism.reaction_quantities or mechanism.switched or any(force.by_reaction for force in mechanism.forces):
            kinematics = _with_reactions(kinematics, mobility)
        choice: Choice | None = None
        if chosen == GIVEN:
            tree = take_given(kinematics)
        elif chosen != "auto":
            tree = METHODS[chosen](kinematics)
        else:
            tree, choice = choose(kinematics, mobility)
    with alone():
        return kind(kinematics, mobility, tree, seconds, choice)


def _stabilised(kinematics: Kinematics, method: str, baumgarte: Sequence[float]) -> Kinematics:
    """Kinematics with Baumgarte's terms, of the method that takes them."""
    from .equations.augmented import stabilise

    if method != "augmented":
        raise cannot(f"baumgarte works with method 'augmented' only, not {method!r}; other methods project states")
    try:
        alpha, beta = (float(x) for x in baumgarte)
    except (TypeError, ValueError):
        raise ill_typed(f"baumgarte must be two numbers (alpha, beta) in 1/s, not {baumgarte!r}") from None
    if not (0.0 <= alpha < float("inf") and 0.0 <= beta < float("inf")):
        raise off_range(f"baumgarte must be two finite numbers that are not negative, not {baumgarte!r}")
    if not kinematics.constraints.labels:
        raise cannot("baumgarte stabilises constraints, and this model has no constraints; leave it out")
    return stabilise(kinematics, alpha, beta)


def _with_reactions(kinematics: Kinematics, mobility: Mobility) -> Kinematics:
    """Kinematics with laws that speak of the joints' reactions solved for these."""
    from .program.reaction_laws import with_reactions

    return with_reactions(kinematics, mobility)


def _mobility(kinematics: Kinematics, independent: Sequence[str]) -> Mobility:
    """The mobility; a loop that does not close is reported at its joint's place in the description."""
    try:
        return find_mobility(kinematics, independent)
    except AssemblyError as error:
        mechanism = kinematics.mechanism
        names = [row.partition(".")[0] for row in error.rows]
        places = [f"joints.{j.name}" for j in mechanism.joints if j.name in names]
        places += [f"constraints.{c.name}" for c in mechanism.constraints if c.name in names]
        place = min(places, key=lambda place: names.index(place.partition(".")[2]), default=None)
        if place is None:
            raise
        raise AssemblyError(str(mechanism.problem(place, str(error))), error.rows, error.code) from None


@np.errstate(all="ignore")
def check(model: Builder) -> MechanismReport:
    """Everything that can be wrong with a model before code is generated.

    Raises
    ------
    ModelError, AssemblyError
    """
    equations = derive(model)
    equations.kinematics.mechanism.require_values()
    idle = require_inertia(equations.kinematics, equations.mobility, equations.tree)
    found = report(equations.kinematics, equations.mobility)
    note = note_lost_digits(equations.kinematics, equations.mobility, equations.tree)
    more = [f"kinematics only (no masses, so no equations of motion): {idle}"] if idle else [note] if note else []
    more += _assemble_start(equations)
    others = other_branches(equations.kinematics, equations.mobility)
    return replace(found, notes=[*found.notes, *more], other_branches=others)


def _assemble_start(equations: Derivation) -> list[str]:
    """Find the state in which a run starts, as a run does, where it is more than the position found already.

    Returns notes on what was not looked at.

    Raises
    ------
    ModelError, AssemblyError
        The initial values that a run would refuse, at their place.
    """
    from .runtime.bound_model import BoundModel

    mechanism = equations.kinematics.mechanism
    known = {*equations.kinematics.names, *equations.kinematics.loop_coordinates.names}
    rates = [name for name in mechanism.initial if name not in known]  # which contradict nothing in an open tree
    more = [*mechanism.initial_outputs, *(rates if equations.kinematics.constraints.labels else ())]
    if not more and not equations.mobility.driven:
        return []
    try:
        wanted = [*OF_STARTS, *(OF_OUTPUTS if mechanism.initial_outputs else ())]
        module = BoundModel(compile_core(equations, "numpy", wanted))
    except EomgenError as error:
        told = str(error).splitlines()[0]
        return [f"the initial values of {', '.join(more) or 'driven velocities'} are not checked here: {told}"]
    try:
        module.x0()
    except (AssemblyError, UsageError) as error:
        named = next((name for name in more if name in str(error)), more[0] if more else "")
        problem = mechanism.problem(f"initial.{named}" if named else "initial", str(error), code=error.code)
        if isinstance(error, AssemblyError):
            raise AssemblyError(str(problem), error.rows, error.code) from None
        raise ModelError([problem]) from None
    return []


@alone()
@np.errstate(all="ignore")
def build(equations: Derivation, target: str = "cython", kernels: Sequence[str] | None = None) -> Program:
    """The functions to generate for a target."""
    from .describe.digest import model_digest
    from .program import Limits
    from .program.build_program import build_program
    from .program.collect import collect_metadata, collect_terms

    row = find_target(target)
    kernels = read_names("kernels", kernels or ())
    kinematics, mobility, tree = equations.fresh()
    kinematics.mechanism.require_values()
    idle = require_inertia(kinematics, mobility, tree)
    strange = bool(idle or kinematics.mechanism.negative)
    if strange and tree.accelerations is not None:
        tree = tree.without_accelerations()  # which divide by pivots before they are looked at
    made = {"target": target, "model_digest": model_digest(kinematics.mechanism), "eomgen": __version__}
    metadata = collect_metadata(kinematics, mobility, tree) | made
    limits = Limits(unrolled_loops=0) if row.arrays else None
    if idle:
        metadata["no_inertia"] = idle
    if kinematics.mechanism.negative:
        metadata["indefinite"] = True
    if strange:
        limits = Limits(unrolled=0, unrolled_loops=0)  # drivers that look before they divide
    terms = collect_terms(kinematics, mobility, tree, in_c=not row.arrays and not strange)
    return build_program(terms, metadata, kernels=kernels or row.kernels or None, limits=limits)


@np.errstate(all="ignore")
def compile_core(
    equations: Derivation, target: str = "cython", kernels: Sequence[str] | None = None, **options: Any
) -> Core:
    """Generate, compile and load; see :meth:`eomgen.api.equations.Equations.compile`."""
    from .program import KERNELS
    from .runtime.late import LateCore

    if not find_target(target).module:
        modules = " or ".join(name for name, row in TARGETS.items() if row.module)
        about = f"target {target!r} makes a {TARGETS[target].about}, not a Python module"
        raise cannot(f"{about}; use generate, or target {modules}")
    if kernels is not None:
        return _load(equations, build(equations, target, kernels), target, options)
    with _timed(equations.seconds, "program"):
        program = build(equations, target, [k.name for k in KERNELS if not k.late])
    core = _load(equations, program, target, options, equations.seconds)
    late = {k.name: str(k.late) for k in KERNELS if k.late and 0 not in k.shape(program.sizes)}

    def load_late(group: str) -> Core:
        wanted = [name for name, of in late.items() if of == group]
        return _load(equations, build(equations, target, wanted), target, options)

    return LateCore(core, list(late), load_late)


def with_start(equations: Derivation, program: Program) -> Program:
    """The program with the state in which the model starts, for libraries of functions, which assemble none."""
    from .runtime.bound_model import BoundModel

    try:
        start = BoundModel(compile_core(equations, "numpy")).x0()
    except EomgenError:  # functions that are in C alone, or no such state
        return program
    return replace(program, metadata={**program.metadata, "start": [float(x) for x in start]})


def _load(
    equations: Derivation,
    program: Program,
    target: str,
    options: dict[str, Any],
    seconds: dict[str, float] | None = None,
) -> Core:
    """Emit, compile and load."""
    seconds = {} if seconds is None else seconds
    if target == "numpy":
        from .compilation.numpy_module import load_numpy
        from .emit import emit_numpy
        from .emit.numpy_functions import twins

        if options:
            raise cannot(f"target 'numpy' has no options, and these are given: {', '.join(options)}")
        with alone(), _timed(seconds, "emit"):
            sources = emit_numpy(program)
        with _timed(seconds, "load"):
            return cast("Core", load_numpy(sources, equations.name, twins(program)))
    from .compilation import Options, compile_sources, load_core
    from .compilation.native_faults import blame_source
    from .compilation.shortcut import Shortcut
    from .program.fingerprint import fingerprint

    allowed = Options.__dataclass_fields__
    unknown = [name for name in options if name not in allowed]
    if unknown:
        raise no_such(f"no option {', '.join(unknown)}; there are: {', '.join(allowed)}")
    chosen = Options(**options)
    with alone(), _timed(seconds, "emit"):
        shortcut = Shortcut(fingerprint(program), chosen)
        artifact = shortcut.find()
        if artifact is None:
            from .emit import emit_c
            from .emit.sources import keep_bytecode

            keep_bytecode(shortcut.cache.templates)
            sources = emit_c(program)
    with _timed(seconds, "compile"):
        if artifact is None:
            try:
                artifact = compile_sources(sources, equations.name, chosen)
            except ToolchainError as error:
                raise blame_source(error, equations.kinematics.graph.functions.values()) or error from None
            shortcut.keep(artifact)
    with alone(), _timed(seconds, "load"):
        return cast("Core", load_core(artifact))
