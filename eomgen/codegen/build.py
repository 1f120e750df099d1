"""Kinematics, Mobility and TreeEquations -> Program: what functions to generate, hoisted, counted.

Public kernels that can be are straight-line blocks; the rest are drivers that the target's own code computes from
blocks (Newton iterations, factorisations of the embedded system).  Trees that do not exceed
:attr:`Limits.unrolled` have their right-hand side wholly on the graph.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..base.kernel_table import KERNELS, NAMED, Kernel
from ..base.operations import operations_with
from ..base.texts import hint, joined
from ..errors import UsageError, ill_placed, no_such
from ..expr.core import LEAVES, Expr, Graph, reachable, symbols_of
from ..expr.functions import Curve, Function, NativeCode, Surface
from ..expr.schedule import count
from ..mechanics import Kinematics
from ..mechanics.methods.positive import require_inertia
from ..mechanics.methods.tree_equations import TreeEquations
from ..mechanics.mobility import Mobility
from ..runtime.layout import ABI, ModelInfo
from .kernels import BlockMaker
from .metadata import collect_metadata
from .program import COLUMNS, SHIFTS, Block, KernelDriver, Limits, Program, hoist
from .terms import SystemTerms

#: Kernels whose metadata tell the places of entries that are not identically zero, where they are straight-line code.
SPARSE = ("jacobian", "input_jacobian", "parameter_jacobian", "mass_matrix", "constraint_jacobian")
#: What a program takes from the terms as it is.
OF_TERMS = ("graph", "sizes", "preferred", "parent", "quaternion_slots", "general_rates", "coordinate_of", "system",
            "projects", "n_states")  # fmt: skip


def program_of(
    kinematics: Kinematics, mobility: Mobility, tree: TreeEquations, made: dict[str, Any], arrays: bool,
    kernels: Sequence[str] | None,
) -> Program:  # fmt: skip
    """The functions to generate; ``made`` joins the metadata, ``arrays``: loops do better than long text."""
    kinematics.mechanism.require_values()
    massless = require_inertia(kinematics, mobility, tree)
    indefinite = kinematics.mechanism.negative
    if (massless or indefinite) and tree.accelerations is not None:
        tree = replace(tree, accelerations=None, pivots=())  # which divide by pivots before they are looked at
    metadata = collect_metadata(kinematics, mobility, tree) | made
    metadata |= {"no_inertia": massless or "", "indefinite": bool(indefinite)}
    limits = Limits(unrolled_loops=0) if arrays else Limits()
    if massless or indefinite:
        limits = Limits(unrolled=0, unrolled_loops=0)  # drivers that look before they divide
    terms = SystemTerms(kinematics, mobility, tree, in_c=not (arrays or massless or indefinite))
    return _build(terms, metadata, kernels, limits)


def _build(terms: SystemTerms, metadata: dict[str, Any], kernels: Sequence[str] | None, limits: Limits) -> Program:
    """Decide what functions to generate, of all kernels or some.

    The metadata are completed with sizes, shapes and counts.
    Raises UsageError (an unknown kernel, or a name that is no C identifier).
    """
    name = str(metadata["name"])
    if not (name.isidentifier() and name.isascii()) or name == "eomgen":
        raise UsageError(
            f"{name!r} cannot name a generated module; use letters, digits and _, but not the name eomgen",
            code="EG-NAME-FORM",
        )
    sizes, maker = terms.sizes, BlockMaker(terms, limits)
    blocks: dict[str, Block] = {}
    drivers: list[KernelDriver] = []
    needed: dict[str, None] = {}
    for kernel in _select(terms, bool(metadata["energy_known"]), kernels):
        block = maker.public(kernel.name)
        if block is not None:
            blocks[kernel.name] = block
            continue
        behind = maker.drivers_need(kernel.name)
        needed.update(dict.fromkeys(behind))
        drivers.append(KernelDriver(kernel.name, tuple(map(maker.port, kernel.inputs)), kernel.shape(sizes), behind))
    for other in needed:
        if other not in blocks:
            blocks[other] = (maker.public(other) if other in NAMED else None) or maker.internal(other)
    made = {*(d.name for d in drivers), *(b.name for b in blocks.values() if b.public)}
    hoisted, parameter_only = hoist(terms.graph, [y for block in blocks.values() for y in block.roots], terms.p)
    nodes, plain = terms.graph.nodes, operations_with(lambda row: not row.bends) | LEAVES
    motion = reachable(terms.graph, (x.id for x in (*terms.inverse_dynamics, *terms.gamma, *terms.rates)))
    counts = {b.name: count((*b.outputs, *b.checks), parameter_only) for b in blocks.values()}
    counts["precompute"] = count(hoisted)
    derivatives = [b for b in blocks.values() if b.outputs and b.name in SPARSE]
    info = ModelInfo(
        **metadata,
        abi=ABI,
        sizes=sizes,
        smooth=all(nodes[i][0] in plain or i in parameter_only for i in motion),
        output_accelerations=maker.outputs_need_accelerations,
        kernels={k.name: list(k.shape(sizes)) for k in KERNELS if k.name in made},
        sparsity={b.name: [k for k, x in enumerate(b.outputs) if not x.is_zero] for b in derivatives},
        operations={key: value.as_dict() for key, value in counts.items()},
    )
    _check_symbols(terms, blocks.values())
    contacts = maker.contacts if COLUMNS[0] in blocks else None
    made_of_terms = {name: getattr(terms, name) for name in OF_TERMS}
    return Program(
        name, info.to_dict(), blocks=tuple(blocks.values()), drivers=tuple(drivers), hoisted=hoisted,
        parameter_only=parameter_only, counts=counts, limits=limits, contacts=contacts, time=terms.t,
        coordinates=terms.q, velocities=terms.v, parameters=terms.p, inputs=terms.u, **made_of_terms,
    )  # fmt: skip


def _select(terms: SystemTerms, has_energy: bool, kernels: Sequence[str] | None) -> list[Kernel]:
    """The kernels that are wanted, of those that the system has."""
    for name in kernels or ():
        if name not in NAMED:
            near = joined(hint(name, list(NAMED)), f"there are {', '.join(NAMED)}")
            raise no_such(f"no kernel is named {name!r}; {near}")
    wanted = set(NAMED if kernels is None else kernels)
    if "rhs" in wanted:  # no run goes without
        wanted.add("meeting_time")
    wanted -= set() if terms.has_minimal_form else {"kinematics"}
    wanted -= set() if has_energy else {"energy"}
    wanted -= set() if terms.meeting_times else {"meeting_time"}
    if terms.general_rates or not terms.projects:  # their derivatives by inputs and parameters are not derived
        wanted -= SHIFTS.keys()
    if terms.general_rates:
        wanted -= {"dae_residual", "dae_jacobian"}
    return [k for k in KERNELS if k.name in wanted and not (k.optional and 0 in k.shape(terms.sizes))]


def _check_symbols(terms: SystemTerms, blocks: Iterable[Block]) -> None:
    """A symbol that is no input of the function it stands in is a fault of the equations."""
    for block in blocks:
        known = {terms.t, *terms.p, *terms.u, *block.inputs}
        unknown = sorted(symbols_of((*block.outputs, *block.checks)) - known)
        if unknown:
            raise ill_placed(f"{block.name} depends on {', '.join(unknown)}, which it is not given")


#: Types that say what they are by their fields, besides the dataclasses of programs.
FIELDS = (Function, NativeCode, Curve, Surface)

#: Objects by their identity, which they keep while they are held here, and the hash of their fields.
Known = dict[int, tuple[Any, str]]


def fingerprint(program: Program) -> str | None:
    """SHA-256 of everything a program holds; None where it holds what has no text (Python fallbacks of native code).

    Programs of one fingerprint have the same sources, whatever writes them.  The numbers of nodes count too, as they
    decide on orders.
    """
    known: Known = {}
    try:
        text = repr([_spell(getattr(program, part.name), known) for part in fields(program) if part.name != "graph"])
        text += repr(_spell_graph(program, known))
    except TypeError:
        return None
    return hashlib.sha256(text.encode()).hexdigest()


def _spell_graph(program: Program, known: Known) -> list[Any]:
    """The nodes that can be reached, and what calls among them mean."""
    graph: Graph = program.graph
    expressions = [y for block in program.blocks for y in block.roots] + list(program.hoisted)
    if program.system is not None:
        system = program.system
        expressions += [*system.entries, *system.right, *system.sizes, *system.accelerations]
    used = sorted(reachable(graph, [y.id for y in expressions]))
    nodes = [(i, graph.nodes[i]) for i in used]
    calls = {node[0] for _, node in nodes} & graph.calls.keys()
    return [nodes, graph.marks, [(call, _spell(graph.calls[call], known)) for call in sorted(calls)]]


def _spell(value: Any, known: Known) -> Any:
    """A value as what has one exact ``repr``; objects that many hold by what their fields hash to, once for all.

    Raises TypeError (it has none).
    """
    kind = type(value)
    if kind in (str, int, float, bool, type(None)):
        return value
    if kind is Expr:
        return ("node", value.id)
    if kind in (tuple, list):
        return [kind.__name__, *(_spell(part, known) for part in value)]
    if isinstance(value, tuple) and hasattr(kind, "_fields"):
        parts = zip(kind._fields, value, strict=True)
        return [kind.__qualname__, *((name, _spell(part, known)) for name, part in parts)]
    if isinstance(value, Mapping):
        return ["mapping", *((_spell(k, known), _spell(v, known)) for k, v in value.items())]
    if kind in (set, frozenset):
        return ["set", *sorted(value, key=repr)]
    if kind is np.ndarray:
        return ["array", value.shape, value.dtype.str, value.tobytes()]
    if kind.__module__.startswith("eomgen.") and (kind in FIELDS or hasattr(kind, "__dataclass_fields__")):
        if id(value) not in known:
            # what is worked out once and kept is no part of it
            fields = getattr(kind, "__dataclass_fields__", vars(value))
            spelled = [_spell(getattr(value, name), known) for name in fields if name != "place"]
            known[id(value)] = value, hashlib.sha256(repr((list(fields), spelled)).encode()).hexdigest()
        return [kind.__qualname__, known[id(value)][1]]
    raise TypeError(f"{kind.__name__} has no text")
