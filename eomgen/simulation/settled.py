"""Simulation: the arguments of a run that say nothing unusual -> its method, tolerances and events, found once.

A run over a given span takes them from here, unless it has inputs, events, steps or options of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import UsageError
from ..runtime.inputs import Forcing
from .compiled import can_run
from .events import Events
from .run_arguments import check_tolerances, declare, longest_step, own_step

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

MANY = 16  #: sets of arguments that are kept for a module
SIMPLE = frozenset((str, float, type(None)))  #: types of the arguments by which a run is found again


class Settled(NamedTuple):
    """What holds for every run with the same arguments; none of it is changed by a run."""

    forcing: Forcing  #: of no inputs, with the module's own values
    watched: Events
    title: str  #: the method
    end: float  #: by default (s)
    settings: dict[str, Any]  #: rtol and atol, checked
    shared: bool  #: whether runs that bind no values change nothing of the forcing: no rates, no sampled states


def settle(module: BoundModel, method: Any, rtol: Any, atol: Any) -> Settled | None:
    """What holds for a run in compiled code without inputs; None where the arguments must be read one by one."""
    key = (method, rtol, atol)
    if not ((method is None and rtol is None and atol is None) or SIMPLE.issuperset(map(type, key))):
        return None
    known = module._settled
    if key in known:
        found: Settled | None = known[key]
        return found
    try:
        found = _settle(module, method, rtol, atol)
    except UsageError:  # told where the arguments are read
        return None
    if len(known) >= MANY:
        known.clear()
    known[key] = found
    return found


def _settle(module: BoundModel, method: Any, rtol: Any, atol: Any) -> Settled | None:
    named, step = own_step(module, method, None)
    unusual = step is not None or "rigid_only" in module.metadata or "contact_shapes" in module.metadata
    if unusual or named in ("kinematic", "moreau", "RK4") or (named is None and not module.layout.n_dof):
        return None
    declared = declare(module)
    title = declared["method"] if method is None else method
    forcing = Forcing(module.layout, None)
    if forcing.values or title == "RK4" or longest_step(module, title) or not can_run(module, title, forcing):
        return None
    forcing.attach(module)
    given = {"rtol": declared["rtol"] if rtol is None else rtol, "atol": declared["atol"] if atol is None else atol}
    settings = check_tolerances(module.n_x, float("inf"), given)
    shared = not (module.layout.input_rates or module.metadata.get("clocks") or module.metadata.get("switched"))
    return Settled(forcing, Events(module.layout, None), str(title), float(declared["end"]), settings, shared)
