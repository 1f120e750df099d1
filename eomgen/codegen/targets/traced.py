"""Targets casadi, jax: Program -> functions that another library traces, differentiates and compiles.

One Python file of straight-line functions of lists, the linear algebra that closed loops need, and a few functions in
which the libraries differ (``templates/casadi``, ``templates/jax``).  Projections take a fixed number of steps.
"""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from inspect import getsource, signature
from types import ModuleType
from typing import Any, NamedTuple

from ...base.files import find_module
from ...base.kernel_table import NAMED
from ...base.limits.constraints import ACCEPTED, DIFFERENTIATED
from ...base.scales import Space
from ...errors import MissingDependencyError, cannot
from ...expr.functions import Curve, Surface, bicubic, combined, cubic, hermite
from ...toolchain.targets import TRACED_KERNELS
from ...toolchain.trusted_files import load_source
from ..c_functions import used_calls
from ..files import example_state, render
from ..pair_sums import refuse_sums
from ..program import Program
from ..python_text import print_block, print_table

STEPS = 6  #: of Newton's iteration: the error of the position is squared by each, so a tenth of a length is enough
LIBRARIES = {"casadi": ("CasADi", "casadi>=3.6.5"), "jax": ("JAX", "jax>=0.4.30")}
#: Functions written into the module for a kind of table.
TABLES: dict[type, list[Callable[..., Any]]] = {Curve: [cubic], Surface: [hermite, combined, bicubic]}
OF_LOOPS = {"rhs": "rhs_of_loops", "project": "project_state", "outputs": "outputs_of_loops"}


class Traced(NamedTuple):
    """A public function."""

    name: str
    arguments: dict[str, int]  #: their lengths, of those between t and u
    shape: tuple[int, ...]
    result: str  #: what it is
    function: str  #: how it is made


def emit_traced(program: Program, library: str) -> str:
    """The text of the module ``<name>`` for 'casadi' or 'jax', of :data:`~...toolchain.targets.TRACED_KERNELS`.

    Raises UsageError (something in the model has no form that a library can trace).
    """
    return render("traced/__init__.py.j2", _context(program, library))


def package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Functions of CasADi's SX with named arguments, or pure functions of JAX arrays in 64 bits."""
    context = context | _context(program, context["target"])
    return {
        "py.typed": "",
        "__init__.py": render("traced/__init__.py.j2", context),
        "pyproject.toml": render("python/pyproject.toml.j2", context),
        "README.md": render("traced/README.md.j2", context),
    }


def _context(program: Program, library: str) -> dict[str, Any]:
    _require_traceable(program, library)
    metadata, blocks, sizes = program.metadata, program.block_names, program.sizes
    functions = [f for f, _ in used_calls(program).values()]
    kinds = {type(f.evaluator) for f in functions}
    drivers = {d.name for d in program.drivers}
    has_loops, n_v = program.has_loops, sizes.n_v
    space = Space.of(n_v, program.quaternion_slots, program.n_states)
    minimal = has_loops and "kinematics" in drivers
    public = _public(program, minimal)
    moving = [k for k in program.preferred if k < n_v - program.n_states]
    independent_q = [program.coordinate_of[k] for k in moving]
    aliases = program.aliases
    return {
        "name": program.name,
        "doc": str(metadata.get("doc") or "").strip(),
        "metadata": metadata,
        "library": library,
        "library_name": LIBRARIES[library][0],
        "requirements": LIBRARIES[library][1:],
        "steps": STEPS,
        "p_values": _numbers(metadata.get("p_values")),
        "u_values": _numbers(metadata.get("u_values")),
        "x0": _numbers(example_state(program)),
        "curves": Curve in kinds,
        "surfaces": Surface in kinds,
        "tables": [_source(f) for kind, used in TABLES.items() if kind in kinds for f in used],
        "definitions": [print_table(f, "curve", "surface") for f in functions],
        "functions": [
            *(print_block(program, b, True) for b in (*program.blocks, program.precompute) if b.name not in aliases),
            *(f"block_{name} = block_{first}\n" for name, first in aliases.items()),
        ],
        "has_loops": has_loops,
        "n_h": sizes.n_h,
        "redundant": sizes.n_c > n_v - sizes.n_dof,
        "passes": 4 if sizes.n_c > n_v - sizes.n_dof else 1,
        "tikhonov": DIFFERENTIATED,
        "accepted": ACCEPTED,
        "composed": not has_loops and "rhs" in drivers,
        "by_columns": "mass_times" in blocks,
        "has_outputs": "outputs" in drivers,
        "outputs_by_acceleration": "outputs" in drivers and metadata["output_accelerations"],
        "tree_rhs": "rhs_of_tree" if "rhs" in drivers else "straight(block_rhs)",
        "minimal": minimal,
        "independent_q": independent_q,
        "independent_names": [program.velocities[k] for k in program.preferred],
        "turned": space is not None,
        "general_rates": program.general_rates,
        "n_states": program.n_states,
        "slots": [list(slot) for slot in program.quaternion_slots],
        "plain": [] if space is None else list(zip(space.plain_q.tolist(), space.plain_v.tolist(), strict=True)),
        "public": public,
    }


def _public(program: Program, minimal: bool) -> list[Traced]:
    """The public functions, in the order of the table of kernels."""
    collected, drivers, sizes = [], {d.name for d in program.drivers}, program.sizes
    for kernel in program.kernels:
        if kernel.name not in TRACED_KERNELS or kernel.name == "kinematics" or not kernel.n_out:
            continue
        function = f"straight(block_{kernel.name})"
        if kernel.name in drivers:
            function = OF_LOOPS[kernel.name] if program.has_loops else f"{kernel.name}_of_tree"
            function = "tree_mass_matrix" if kernel.name == "mass_matrix" else function
        collected.append(Traced(kernel.name, kernel.arguments, kernel.shape, NAMED[kernel.name].result, function))
    if minimal:
        n = 2 * sizes.n_dof - sizes.n_states
        takes = {"z": n, "q_guess": sizes.n_q}
        if n:
            collected.append(
                Traced("minimal_rhs", takes, (n,), "z' of z = [q_i; v_i], the degrees of freedom", "minimal")
            )
        collected.append(Traced("full_state", takes, (sizes.n_x,), "x = [q; v] that belongs to z", "tree_state"))
    return collected


def _require_traceable(program: Program, library: str) -> None:
    """Refuse what has no form of straight lines and fixed numbers of steps."""
    refuse_sums(program, f"target {library!r}")
    problems = []
    native = [f.name for f, _ in used_calls(program).values() if f.native is not None]
    if native:
        problems.append(
            f"function {', '.join(native)} is C code, which {LIBRARIES[library][0]} cannot differentiate; give a table "
            "or an expression"
        )
    if program.system is not None:
        problems.append(
            f"method {program.metadata.get('method')!r} solves a linear system by pivoting; derive by method 'auto'"
        )
    if program.general_rates and program.has_loops:
        problems.append("equations with given rates q' = N v and constraints are projected by pivoting")
    if problems:
        raise cannot(f"target {library!r}: {'; '.join(problems)}")


def _numbers(values: Any) -> str:
    texts = ['float("nan")' if x is None or x != x else repr(float(x)) for x in values or ()]
    return f"({', '.join(texts)}{',' if len(texts) == 1 else ''})"


def _source(function: Callable[..., Any]) -> str:
    """The text of a function without the types of its arguments."""
    text, names = getsource(function), ", ".join(signature(function).parameters)
    return f"def {function.__name__}({names}):\n    {text[text.index(chr(34) * 3) :]}"


def functions(program: Program) -> ModuleType:
    """The functions of a model for a library, as a module made in this process: the same as the package.

    It has functions such as ``rhs(t, x, u, p)``, the names ``x_names``, ``u_names``, ``p_names``, and the values
    ``x0``, ``u_values``, ``p_values``.

    Raises
    ------
    UsageError
        Something in the model has no form that the library can trace: functions in C, or a method that solves by
        pivoting.
    MissingDependencyError
        The library is not installed.
    """
    library = program.metadata["target"]
    text = emit_traced(program, library)
    name = f"{program.name}_{library}_{sha256(text.encode()).hexdigest()[:16]}"
    collected: ModuleType | None = find_module(name)
    if collected is not None:
        return collected
    title, requirement = LIBRARIES[library]
    try:
        return load_source(name, f"<{name}>", text.encode())
    except ImportError as error:
        raise MissingDependencyError(f"{title} is not installed; pip install '{requirement}'") from error
