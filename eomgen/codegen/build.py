"""SystemTerms -> Program: what functions to generate, hoisted, counted.

Public kernels that can be are straight-line blocks; the rest are drivers that the target's own code computes from
blocks (Newton iterations, factorisations of the embedded system).  Trees that do not exceed
:attr:`Limits.unrolled` have their right-hand side wholly on the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ..base.kernel_table import KERNELS, Kernel, Sizes
from ..base.names import hint, joined
from ..equations.positive import require_inertia
from ..equations.tree_equations import TreeEquations
from ..errors import UsageError, ill_placed, no_such
from ..graph.substitute import symbols_of
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from .collect import collect_metadata, collect_terms
from .held_columns import HELD
from .jacobian_blocks import sparsity
from .kernels import BlockMaker
from .loops.block_groups import SHIFTS
from .program import Block, KernelDriver, Limits, Program, count_apart, hoist
from .terms import SystemTerms

#: Version of the generated functions' signatures and of the table that describes them.
ABI = 1
#: Kernels whose metadata tell the places of entries that are not identically zero, where they are straight-line code.
SPARSE = ("jacobian", "input_jacobian", "parameter_jacobian", "mass_matrix", "constraint_jacobian")


def program_of(
    kinematics: Kinematics, mobility: Mobility, tree: TreeEquations, made: dict[str, Any], arrays: bool,
    kernels: Sequence[str] | None,
) -> Program:  # fmt: skip
    """The functions to generate; ``made`` joins the metadata, ``arrays``: loops do better than long text."""
    kinematics.mechanism.require_values()
    idle = require_inertia(kinematics, mobility, tree)
    strange = bool(idle or kinematics.mechanism.negative)
    if strange and tree.accelerations is not None:
        tree = tree.without_accelerations()  # which divide by pivots before they are looked at
    metadata = collect_metadata(kinematics, mobility, tree) | made
    limits = Limits(unrolled_loops=0) if arrays else None
    if idle:
        metadata["no_inertia"] = idle
    if kinematics.mechanism.negative:
        metadata["indefinite"] = True
    if strange:
        limits = Limits(unrolled=0, unrolled_loops=0)  # drivers that look before they divide
    terms = collect_terms(kinematics, mobility, tree, in_c=not arrays and not strange)
    return build_program(terms, metadata, kernels=kernels, limits=limits)


def build_program(
    terms: SystemTerms,
    metadata: dict[str, Any],
    *,
    kernels: Sequence[str] | None = None,
    limits: Limits | None = None,
) -> Program:
    """Decide what functions to generate.

    Parameters
    ----------
    terms : SystemTerms
        The equations.
    metadata : dict
        JSON-able; ``name`` is the prefix of all functions.  A copy is completed with ``abi``, the sizes,
        ``kernels`` (shapes by name), ``sparsity`` (of derivatives: places, row by row, of entries that do not
        vanish identically) and ``operations`` (counts per block; hoisted work under ``precompute``).
    kernels : sequence of str, optional
        Public kernels wanted; all by default.
    limits : Limits, optional

    Returns
    -------
    Program

    Raises
    ------
    UsageError
        Sizes contradict each other, an unknown kernel, or a name that is no C identifier.
    """
    terms.check_shapes()
    name = str(metadata["name"])
    if not (name.isidentifier() and name.isascii()) or name == "eomgen":
        raise UsageError(
            f"{name!r} cannot name a generated module; use letters, digits and _, but not the name eomgen",
            code="EG-NAME-FORM",
        )
    limits = limits or Limits()
    sizes = _measure(terms)
    maker = BlockMaker(terms, sizes, limits)
    has = {"kinematics": terms.has_minimal_form, "coordinate_slopes": bool(terms.coordinate_slopes)}
    has["energy"] = bool(metadata.get("energy_known", True))
    has |= {"events": bool(terms.events), "resets": bool(terms.resets), "meeting_time": bool(terms.meeting_times)}
    has["held_errors"] = bool(terms.held_errors)
    if terms.given_rates or not terms.projects:  # their derivatives by inputs and parameters are not derived
        has |= dict.fromkeys(SHIFTS, False)
    if terms.given_rates:
        has |= {"dae_residual": False, "dae_jacobian": False}
    if kernels is not None and "rhs" in kernels and terms.meeting_times:  # no run goes without
        kernels = [*kernels, "meeting_time"]
    wanted = [k for k in _select(kernels) if has.get(k.name, True) and not (k.late and 0 in k.shape(sizes))]
    blocks: dict[str, Block] = {}
    drivers: list[KernelDriver] = []
    needed: dict[str, None] = {}
    for kernel in wanted:
        block = maker.public(kernel.name)
        if block is not None:
            blocks[kernel.name] = block
            continue
        behind = maker.drivers_need(kernel.name)
        needed.update(dict.fromkeys(behind))
        drivers.append(KernelDriver(kernel.name, tuple(map(maker.port, kernel.inputs)), kernel.shape(sizes), behind))
    for other in needed:
        if other not in blocks:
            public = maker.public(other) if any(k.name == other for k in KERNELS) else None
            blocks[other] = public or maker.internal(other)
    made = {*(d.name for d in drivers), *(b.name for b in blocks.values() if b.public)}
    kernel_shapes = {k.name: list(k.shape(sizes)) for k in KERNELS if k.name in made}

    roots = [y for block in blocks.values() for y in block.roots]
    hoisted, parameter_only = hoist(terms.graph, roots, terms.p)
    counts = {b.name: count_apart((*b.outputs, *b.checks), parameter_only) for b in blocks.values()}
    counts["precompute"] = count_apart(hoisted, frozenset())
    complete = {
        **metadata,
        "abi": ABI,
        **sizes._asdict(),
        "output_accelerations": maker.outputs_need_accelerations,
        "kernels": kernel_shapes,
        "sparsity": {b.name: sparsity(b.outputs) for b in blocks.values() if b.outputs and b.name in SPARSE},
        "operations": {key: value.as_dict() for key, value in counts.items()},
    }
    _check_symbols(terms, blocks.values())
    return Program(
        name=name,
        metadata=complete,
        graph=terms.graph,
        time=terms.t,
        coordinates=terms.q,
        velocities=terms.v,
        parameters=terms.p,
        inputs=terms.u,
        sizes=sizes,
        blocks=tuple(blocks.values()),
        drivers=tuple(drivers),
        hoisted=hoisted,
        parameter_only=parameter_only,
        preferred=terms.preferred,
        parent=terms.parent,
        quaternion_slots=terms.quaternion_slots,
        given_rates=terms.given_rates,
        coordinate_of=terms.coordinate_of,
        counts=counts,
        limits=limits,
        system=terms.system,
        projects=terms.projects,
        n_states=terms.n_states,
        held=maker.held if HELD[0] in blocks else None,
    )


def _measure(terms: SystemTerms) -> Sizes:
    return Sizes(
        n_q=len(terms.q),
        n_v=terms.n_v,
        n_x=len(terms.q) + terms.n_v,
        n_u=len(terms.u),
        n_p=len(terms.p),
        n_y=len(terms.outputs),
        n_c=terms.n_c,
        n_h=len(terms.constraints),
        n_dof=terms.n_dof,
        n_bodies=len(terms.poses) // 16,
        n_loop_coordinates=terms.n_loop_coordinates,
        n_alignments=len(terms.alignment),
        n_com=3 if terms.centroidal else 0,
        n_finite_forces=len(terms.finite_forces),
        n_coordinate_slopes=len(terms.coordinate_slopes),
        n_wrenches=terms.wrenches.needed_size if terms.wrenches else 0,
        n_wrench_geometry=terms.wrenches.size if terms.wrenches else 0,
        n_momenta=len(terms.canonical) // 2,
        n_events=len(terms.events),
        n_resets=len(terms.resets),
        n_held=len(terms.held_errors),
        n_strike=_strike_rows(terms),
        n_states=terms.n_states,
        n_spots=len(terms.near_pairs),
        n_dae=len(terms.q) + terms.n_v + terms.n_c + len(terms.constraints),
    )


def _strike_rows(terms: SystemTerms) -> int:
    """Rows of ``strike_derivatives``: of models whose events change velocities that impulses or constraints rule."""
    ruled = terms.impacts or (terms.resets and terms.constraint_jacobian)
    count = 2 * terms.n_v + terms.n_c + len(terms.events) + len(terms.held_errors) // 2
    return count if ruled and not terms.given_rates else 0


def _select(kernels: Sequence[str] | None) -> list[Kernel]:
    known = [k.name for k in KERNELS]
    for name in kernels or ():
        if name not in known:
            near = joined(hint(name, known), f"there are {', '.join(known)}")
            raise no_such(f"no kernel is named {name!r}; {near}")
    return [k for k in KERNELS if kernels is None or k.name in kernels]


def _check_symbols(terms: SystemTerms, blocks: Iterable[Block]) -> None:
    """A symbol that is no input of the function it stands in is a fault of the equations."""
    for block in blocks:
        known = {terms.t, *terms.p, *terms.u, *block.inputs}
        unknown = sorted(symbols_of((*block.outputs, *block.checks)) - known)
        if unknown:
            raise ill_placed(f"{block.name} depends on {', '.join(unknown)}, which it is not given")
