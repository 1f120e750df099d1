"""Simulation: a module and its forcing -> steps with rigid contacts in compiled code, where the module has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..runtime.late import LateCore, eager

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing
    from .rigid_rows import RigidContacts

DONE, TOO_LONG = 0, 1  #: what a step comes back with: eomgen/native/contacts/eomgen_contacts.h
NEEDED = ("mass_matrix", "near_pairs", "motion_axes", "bias_apart")
OF_CONSTRAINTS = ("constraint_jacobian", "velocity_constraints", "constraints")


def rigid_stepper(
    module: BoundModel, forcing: Forcing, contacts: RigidContacts, tolerance: float, iterations: int
) -> Any | None:
    """The compiled steps of one run; None where the module has none."""
    make = getattr(eager(module.core), "rigid_stepper", None)
    layout = module.layout
    wanted = [*NEEDED, *(OF_CONSTRAINTS if layout.n_c else ())]
    known = module.kernels.core.names
    if make is None or not set(wanted) <= {*known} | ({"constraints"} if not layout.n_h else set()):
        return None
    wanted += ["meeting_time"]
    bound = module.kernels.context
    cores: list[Any] = []
    sources: dict[str, Any] = {}
    for name in wanted:
        if name not in known:
            continue
        core: Any = module.kernels.core
        core = core.having(name) if isinstance(core, LateCore) and name not in core.core.names else eager(core)
        context = bound if core is eager(module.core) else core.context(bound.p, bound.u, UsageError)
        cores.append(core)
        sources[name] = core.address(name), context.c
    space = layout.space
    plain = [(k, k) for k in range(layout.n_q)] if space is None else [*zip(space.plain_q, space.plain_v, strict=True)]
    tables = {
        "rows": layout.rows,
        "plain": np.ravel(plain),
        "balls": np.ravel([] if space is None else space.quaternion_slots),
        "lists": np.ravel([(numbers, count) for _, numbers, count in contacts.lists]),
        "moved": contacts.moves,
    }
    facts = {
        "n_rows": layout.n_c,
        "n_c": len(layout.rows),
        "n_h": int(np.count_nonzero(layout.rows < layout.n_h)),
        "n_spots": sum(numbers for _, numbers, _ in contacts.lists),
    }
    n_work = max(core.sizes["n_work"] for core in cores)
    outside = forcing if forcing.foreign else None
    within = forcing.within or (-np.inf, np.inf)
    signals = [] if outside is not None else forcing.encode()
    return make(bound, sources, n_work, facts, tables, tolerance, iterations, signals, outside, within)
